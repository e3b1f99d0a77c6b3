"""Messages between a decoder and who asks it."""

import json
import math
import os
import select
import struct
import time
from typing import Any, Final

import numpy as np

_LENGTHS: Final = struct.Struct(">II")
MAX_JSON_BYTES: Final = 1 << 20
MAX_BODY_BYTES: Final = 6 * 250_000_000  # a whole RGB frame of the largest size


class BrokenMessageError(Exception):
    """The other side closed the socket, ran out of time, or does not keep to the protocol."""


def send(descriptor: int, message: dict[str, Any], body: bytes | memoryview = b"") -> None:
    encoded = encode(message)
    content = memoryview(body).cast("B")
    _write(descriptor, memoryview(_LENGTHS.pack(len(encoded), len(content)) + encoded))
    _write(descriptor, content)


def receive(
    descriptor: int, *, deadline: float | None = None, max_body_bytes: int = 0
) -> tuple[dict[str, Any], memoryview]:
    lengths = _read(descriptor, _LENGTHS.size, deadline)
    json_bytes, body_bytes = _LENGTHS.unpack(lengths)
    if json_bytes > MAX_JSON_BYTES or body_bytes > max_body_bytes:
        raise BrokenMessageError("a message longer than was asked for")
    message = decode(bytes(_read(descriptor, json_bytes, deadline)))
    return message, _read(descriptor, body_bytes, deadline)


def encode(message: dict[str, Any]) -> bytes:
    return json.dumps(message, allow_nan=False).encode()


def decode(content: bytes) -> dict[str, Any]:
    try:
        message = json.loads(content, parse_constant=_finite, parse_float=_finite)
    except (ValueError, RecursionError) as error:
        raise BrokenMessageError("a message that is no JSON") from error
    if not isinstance(message, dict):
        raise BrokenMessageError("a message that is no object")
    return message


def _write(descriptor: int, content: memoryview) -> None:
    while content:
        content = content[os.write(descriptor, content) :]


def _read(descriptor: int, size: int, deadline: float | None) -> memoryview:
    # not a bytearray, which would be filled with zeros first
    rest = content = np.empty(size, np.uint8).data
    poll = select.poll()
    poll.register(descriptor, select.POLLIN)
    while rest:
        if deadline is not None and not poll.poll(max(0.0, deadline - time.monotonic()) * 1000):
            raise TimeoutError
        if not (count := os.readv(descriptor, [rest])):
            raise BrokenMessageError("the socket was closed")
        rest = rest[count:]
    return content


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value
