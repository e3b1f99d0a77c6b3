"""Claims of a PNG, read from hostile bytes: its size and its EXIF, and that it reaches its own end."""

import struct
from dataclasses import dataclass
from typing import Final

from radiometry.findings import files

MAGIC: Final = b"\x89PNG\r\n\x1a\n"
_SAMPLES: Final = {0: 1, 2: 3}
_MOST_CHUNKS: Final = 100_000
_MOST_EXIF_BYTES: Final = 1 << 20
# Deflate never packs tighter than 258 bytes into two bits.
_EXPANSION: Final = 1032


@dataclass(frozen=True, kw_only=True)
class PngClaims:
    """``exif`` : the TIFF structure of its eXIf chunk, empty where there is none."""

    height_px: int
    width_px: int
    samples: int
    bits: int
    exif: bytes


def read_claims(buffer: bytes) -> PngClaims:
    """Walk the file's chunks to its end; nothing is decompressed."""
    width, height, bits, samples = _read_head(buffer)
    place, packed, exif = len(MAGIC), 0, b""
    for _ in range(_MOST_CHUNKS):
        if place + 12 > len(buffer):
            raise files.TRUNCATED.refuse("The PNG ends before its own last chunk: it was cut short.")
        length, kind = struct.unpack(">I4s", buffer[place : place + 8])
        if place + 12 + length > len(buffer):
            raise files.TRUNCATED.refuse("The PNG ends within one of its chunks: it was cut short.")
        if kind == b"IEND":
            break
        if kind == b"IDAT":
            packed += length
        elif kind == b"eXIf" and length <= _MOST_EXIF_BYTES:
            exif = exif or bytes(buffer[place + 8 : place + 8 + length])
        place += 12 + length
    else:
        raise files.UNSUPPORTED_LAYOUT.refuse("The PNG is cut into more pieces than is sane.")
    if height * width * samples * (bits // 8) > packed * _EXPANSION:
        raise files.SIZE_MISMATCH.refuse(f"The PNG claims {width} x {height} pixels and holds far fewer.")
    return PngClaims(height_px=height, width_px=width, samples=samples, bits=bits, exif=exif)


def _read_head(buffer: bytes) -> tuple[int, int, int, int]:
    head = bytes(buffer[len(MAGIC) : len(MAGIC) + 18])
    if len(head) < 18:
        raise files.TRUNCATED.refuse("The PNG ends within its own header.")
    length, kind, width, height, bits, colour = struct.unpack(">I4sIIBB", head)
    if (length, kind) != (13, b"IHDR"):
        raise files.SIZE_MISMATCH.refuse("The PNG does not begin with its header.")
    if colour not in _SAMPLES or bits not in (8, 16):
        raise files.UNSUPPORTED_LAYOUT.refuse(
            "The PNG has a palette, transparency or fewer than 8 bits; grey or RGB of 8 or 16 bits is read.",
        )
    return width, height, bits, _SAMPLES[colour]
