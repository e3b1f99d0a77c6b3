"""A cell: a process forked for one file. It loses the world, then reads that file, and ends with it.

It never sees another file. So nothing of one can come out with another's samples, and a file that took its
decoder over has gained a process that can compute, answer, and nothing else.
"""

import errno
import fcntl
import mmap
import os
import socket
import sys
from dataclasses import asdict, dataclass
from typing import Any, Final

from radiometry.findings import InputRejected
from store.sandbox import OPEN_FILES, Restrictions, Sandbox
from worker.decode import messages
from worker.decode.budget import Budget
from worker.decode.pieces import start_second_thread
from worker.decode.reader import Reader, Window
from worker.decode.settings import NOT_SHUT_IN, DecoderLimits
from worker.decode.source import Source, SourceDamagedError
from worker.decode.warmup import own_memory, warm_up

TALK: Final = 0


@dataclass(frozen=True, kw_only=True)
class Prepared:
    """Resources that the zygote has prepared for all of its cells.

    ``address_space`` : of a process without a file, in bytes; ``first_file``, ``first_stream`` : of our own
    """

    restrictions: Restrictions
    bounds: DecoderLimits
    address_space: int
    first_file: bytes
    first_stream: bytes


def live(prepared: Prepared, expected: Sandbox) -> int:
    """Lose the world, wait for the file, and answer until nobody asks any more; the exit code.

    Nobody asks any more when the socket is closed: that raises BrokenMessageError or BrokenPipeError.
    Descriptor 0 brings the file and the requests and takes the answers, 1 and 2 lead nowhere; there are no
    others.
    """
    talk = socket.socket(fileno=os.dup(TALK))
    if prepared.restrictions.shut_in(start_second_thread) != expected:
        return NOT_SHUT_IN
    own_memory()
    warm_up(prepared.first_file, prepared.first_stream)
    descriptor = _receive_file(talk)
    if descriptor is None:
        return 0
    content = _map(descriptor)
    budget = Budget(prepared.bounds, before=prepared.address_space, file_bytes=len(content))
    request, _ = messages.receive(TALK)
    digests = None if request["digests"] is None else bytes.fromhex(request["digests"])
    try:
        reader = Reader(Source(content, digests), budget.allow)
    except SourceDamagedError:
        messages.send(TALK, {"damaged": True})
        return 0
    while True:
        messages.send(TALK, *_answer(reader, request))
        request, _ = messages.receive(TALK)
        budget.begin_request()


def _receive_file(talk: socket.socket) -> int | None:
    """The file's descriptor, which comes with the first byte; None when there will be no file."""
    with talk:
        content, descriptors, _, _ = socket.recv_fds(talk, 1, 1)
    return descriptors[0] if content and len(descriptors) == 1 else None


def _map(descriptor: int) -> mmap.mmap | bytes:
    """Map the file and let go of its descriptor: what is left is memory that nobody can write to."""
    if fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_ACCMODE != os.O_RDONLY:
        raise ValueError("a cell is given a file that is open for reading only")
    # not asked of fstat: on some systems that is a call which also takes paths, and is lost
    size = os.lseek(descriptor, 0, os.SEEK_END)
    # a mapping of nothing is refused by the system
    content = mmap.mmap(descriptor, size, access=mmap.ACCESS_READ) if size else b""
    # the descriptor, and the copy that Python keeps with the mapping
    os.closerange(3, OPEN_FILES)
    return content


def _read(reader: Reader, request: dict[str, Any]) -> tuple[dict[str, Any], bytes | memoryview]:
    match request["do"]:
        case "read_header":
            return {"header": asdict(reader.read_header())}, b""
        case "read_window":
            frame = reader.read_window(Window(*request["window"]))
            told = {name: value for name, value in vars(frame).items() if name != "samples_dn"}
            return {"frame": told}, frame.samples_dn.data
        case _:
            preview, proof = reader.inspect(request["longest_side_px"])
            return {"proof": asdict(proof)}, preview


def _answer(reader: Reader, request: dict[str, Any]) -> tuple[dict[str, Any], bytes | memoryview]:
    try:
        return _read(reader, request)
    except InputRejected as refusal:
        return {"refused": {"code": str(refusal.code), "message": refusal.message}}, b""
    except SourceDamagedError:
        return {"damaged": True}, b""
    except Exception as error:  # noqa: BLE001  the last line before a hostile file becomes our failure
        if isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM:
            return {"failed": "it needs more memory than is allowed"}, b""
        print(f"{request.get('do')}: {error!r}", file=sys.stderr)  # noqa: T201
        return {"failed": type(error).__name__}, b""
