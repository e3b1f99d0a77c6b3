"""Deflate, LZW and PackBits pieces, decompressed to their end, which has to be where they say.

Deflate ends with a checksum of its bytes. LZW ends with a code of its own; PackBits ends with its last byte:
both prove how much there is, and nothing of what it is.
"""

import zlib
from typing import Final

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from radiometry.findings import files
from worker.decode import tags

_LZW_END: Final = 257
_LZW_BITS: Final = range(9, 13)
# An end code ends anywhere in the last byte, before which a writer may have set one more.
_MOST_PADDING_BITS: Final = 15


def expand(data: bytes, compression: int, *, wanted: int, most: int) -> tuple[NDArray[np.uint8], int]:
    """Decompress a piece, and count the bytes that it took.

    ``wanted`` : bytes that are returned; ``most`` : bytes that it may hold, however much it would expand to
    """
    try:
        if compression in (tags.DEFLATE, tags.DEFLATE_OLD):
            plain, took = _inflate(data, most)
        elif compression == tags.LZW:
            # one more than it may hold: an end that lies beyond is no end
            plain, took = bytes(imagecodecs.lzw_decode(data, out=most + 1)), len(data)
            _require_lzw_end(data)
        else:
            plain, took = bytes(imagecodecs.packbits_decode(data, out=most + 1)), len(data)
    except (zlib.error, RuntimeError, ValueError) as error:
        raise files.INCOMPLETE_IMAGE.refuse(
            "A piece of the image cannot be decompressed to its end."
        ) from error
    if len(plain) < wanted:
        raise files.TRUNCATED.refuse("A piece of the compressed image ends early.")
    if len(plain) > most:
        raise files.INCOMPLETE_IMAGE.refuse("A piece of the compressed image does not end where it should.")
    return np.frombuffer(plain, np.uint8, count=wanted), took


def _inflate(data: bytes, most: int) -> tuple[bytes, int]:
    """Read on behind the last byte, where the checksum stands: zlib compares it only there."""
    inflate = zlib.decompressobj()
    plain = inflate.decompress(data, most)
    if not inflate.eof:
        plain += inflate.decompress(inflate.unconsumed_tail, 1)
    if not inflate.eof or any(inflate.unused_data):
        raise files.INCOMPLETE_IMAGE.refuse("A piece of the compressed image does not end with its checksum.")
    return plain, len(data) - len(inflate.unused_data)


def _require_lzw_end(data: bytes) -> None:
    if data[:1] == b"\0":
        return  # of the order of bits before TIFF 6, whose end code is written the other way round
    tail = int.from_bytes(data[-4:], "big")
    for padding in range(_MOST_PADDING_BITS + 1):
        if tail & ((1 << padding) - 1):
            break
        if any((tail >> padding) & ((1 << bits) - 1) == _LZW_END for bits in _LZW_BITS):
            return
    raise files.INCOMPLETE_IMAGE.refuse("A piece of the compressed image does not end with its end code.")
