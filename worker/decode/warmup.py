"""A first file of our own, read by each cell before it is given a stranger's.

A forked process owns a page of memory only once it has written to it, and Python writes wherever it looks. So
a cell's first file is slow, and this one, which lies in no folder and shows nothing, is it.
"""

import struct
from dataclasses import asdict
from typing import Final

import imagecodecs
import numpy as np

from worker.decode import ljpeg, messages
from worker.decode.budget import allow_all
from worker.decode.malloc import keep_memory
from worker.decode.reader import Reader, Window
from worker.decode.source import Source

_SIDE_PX: Final = 16
# A region of 5 % of 50 million pixels, and a MiB for its decoder. What is larger comes from the kernel, and
# goes back to it at once. From 4 MiB on numpy asks for huge pages, of which 6 MiB cost what 2 MiB of small
# ones do.
_OWNED_BYTES: Final = 6 << 20
_PAGE_BYTES: Final = 4096
_SHORT, _LONG, _BYTE = 3, 4, 1
_HEAD: Final = 8
_TAGS: Final = (
    (256, _LONG, 1, struct.pack("<I", _SIDE_PX)),
    (257, _LONG, 1, struct.pack("<I", _SIDE_PX)),
    (258, _SHORT, 1, struct.pack("<I", 16)),
    (259, _SHORT, 1, struct.pack("<I", 1)),
    (262, _SHORT, 1, struct.pack("<I", 32803)),
    (273, _LONG, 1, struct.pack("<I", _HEAD)),
    (279, _LONG, 1, struct.pack("<I", 2 * _SIDE_PX**2)),
    (33421, _SHORT, 2, struct.pack("<HH", 2, 2)),
    (33422, _BYTE, 4, bytes((0, 1, 1, 2))),
    (50706, _BYTE, 4, bytes((1, 4, 0, 0))),
)


def make_smallest_dng() -> bytes:
    """Return a mosaic of zeros with the least that a DNG must say."""
    samples = bytes(2 * _SIDE_PX**2)
    entries = b"".join(struct.pack("<HHI4s", *tag) for tag in _TAGS)
    directory = struct.pack("<H", len(_TAGS)) + entries + bytes(4)
    return struct.pack("<2sHI", b"II", 42, _HEAD + len(samples)) + samples + directory


def make_smallest_stream() -> bytes:
    """Return a lossless JPEG of zeros."""
    return bytes(imagecodecs.ljpeg_encode(np.zeros((_SIDE_PX, _SIDE_PX), np.uint16), bitspersample=16))


def own_memory() -> None:
    """Write to as much memory as a region needs, and let the C library keep it for that."""
    keep_memory(2 * _OWNED_BYTES)
    np.empty(_OWNED_BYTES, np.uint8)[::_PAGE_BYTES] = 0


def warm_up(content: bytes, stream: bytes) -> None:
    """Read a file and a compressed piece as a cell does, for the sake of what that touches."""
    reader = Reader(Source(content), allow_all)
    messages.decode(messages.encode(asdict(reader.read_header())))
    reader.read_window(Window(0, 0, _SIDE_PX, _SIDE_PX))
    ljpeg.decode(stream, samples=_SIDE_PX**2)
