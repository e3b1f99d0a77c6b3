"""Arrays as text: base64 of zlib of little-endian values, with their type and shape."""

import base64
import math
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radiometry.records import Record, about

_TYPES = ("<u2", "<i4", "<f2", "<f4")


class Packed(Record):
    """An array that can be stored in JSON."""

    dtype: str = about('"<u2", "<i4", "<f2" or "<f4".')
    shape: tuple[int, ...] = about("Shape of the array.")
    data: str = about("Base64 of the compressed values in row-major order.")


def pack(array: NDArray[Any], *, dtype: str) -> Packed:
    """Write an array as text; the same array gives the same text on one machine."""
    plain = np.ascontiguousarray(array, np.dtype(dtype))
    text = base64.b64encode(zlib.compress(plain.tobytes(), level=6)).decode("ascii")
    return Packed(dtype=dtype, shape=plain.shape, data=text)


def unpack(packed: Packed) -> NDArray[np.float64]:
    """Read an array back, as float64."""
    if packed.dtype not in _TYPES:
        raise ValueError(f"dtype {packed.dtype!r} is none of {', '.join(_TYPES)}")
    kind = np.dtype(packed.dtype)
    size = math.prod(packed.shape) * kind.itemsize
    plain = zlib.decompressobj().decompress(base64.b64decode(packed.data, validate=True), size + 1)
    if len(plain) != size:
        raise ValueError(f"{len(plain)} bytes do not fill an array of shape {packed.shape}")
    return np.frombuffer(plain, kind).reshape(packed.shape).astype(np.float64)
