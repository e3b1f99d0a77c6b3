"""Claims of a JPEG, read from hostile bytes: its size and its EXIF, and that it reaches its own end."""

import re
import struct
from dataclasses import dataclass
from typing import Final

from radiometry.findings import files

MAGIC: Final = b"\xff\xd8\xff"
_END, _START_OF_SCAN, _EXIF = 0xD9, 0xDA, 0xE1
_EXIF_HEAD: Final = b"Exif\0\0"
_FRAMES: Final = {0xC0: "baseline", 0xC1: "extended", 0xC2: "progressive"}
_OTHER_FRAMES: Final = frozenset({0xC3, *range(0xC5, 0xC8), *range(0xC9, 0xCC), *range(0xCD, 0xD0)})
# In coded data FF is followed by 0 (a stuffed byte), a restart, or another FF that only fills.
_MARKER: Final = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]", re.DOTALL)
_MOST_SEGMENTS: Final = 10_000
# A block of 8 x 8 samples takes at least a bit in some scan: no picture is smaller than that.
_PIXELS_PER_BYTE: Final = 512


@dataclass(frozen=True, kw_only=True)
class JpegClaims:
    """``exif`` : the TIFF structure within its EXIF segment, empty where there is none."""

    height_px: int
    width_px: int
    samples: int
    exif: bytes


def read_claims(buffer: bytes) -> JpegClaims:
    """Walk the file's segments to its end; nothing is decoded.

    libjpeg fills what is missing with grey and says nothing, so a file without its end is refused here. A
    picture that was cut and closed again cannot be told from a whole one: the format has no checksum.
    """
    frame: tuple[int, int, int] | None = None
    exif = b""
    place, scanned = 2, 0
    for _ in range(_MOST_SEGMENTS):
        marker, place = _next_marker(buffer, place)
        if marker == _END:
            break
        body, place = _segment(buffer, place)
        if marker in _FRAMES:
            frame = frame or _read_frame(body)
        elif marker in _OTHER_FRAMES:
            raise files.UNSUPPORTED_COMPRESSION.refuse(
                "The JPEG is lossless or arithmetically coded: not read."
            )
        elif marker == _EXIF and body.startswith(_EXIF_HEAD):
            exif = exif or body[len(_EXIF_HEAD) :]
        elif marker == _START_OF_SCAN:
            start, place = place, _skip_coded(buffer, place)
            scanned += place - start
    else:
        raise files.UNSUPPORTED_LAYOUT.refuse("The JPEG is cut into more pieces than is sane.")
    if frame is None:
        raise files.SIZE_MISMATCH.refuse("The JPEG does not state its size.")
    height, width, samples = frame
    if height * width > scanned * _PIXELS_PER_BYTE:
        raise files.SIZE_MISMATCH.refuse(f"The JPEG claims {width} x {height} pixels and holds far fewer.")
    return JpegClaims(height_px=height, width_px=width, samples=samples, exif=exif)


def _next_marker(buffer: bytes, place: int) -> tuple[int, int]:
    if place + 2 > len(buffer):
        raise files.TRUNCATED.refuse("The JPEG ends before its own end marker: it was cut short.")
    if buffer[place] != 0xFF:
        raise files.SIZE_MISMATCH.refuse("The JPEG's segments do not follow each other.")
    while place + 1 < len(buffer) and buffer[place + 1] == 0xFF:
        place += 1
    if place + 1 >= len(buffer):
        raise files.TRUNCATED.refuse("The JPEG ends before its own end marker: it was cut short.")
    return buffer[place + 1], place + 2


def _segment(buffer: bytes, place: int) -> tuple[bytes, int]:
    length = int.from_bytes(buffer[place : place + 2], "big")
    end = place + length
    if end > len(buffer) or place + 2 > len(buffer):
        raise files.TRUNCATED.refuse("The JPEG ends within one of its segments: it was cut short.")
    if length < 2:
        raise files.SIZE_MISMATCH.refuse("The JPEG has a segment without a length.")
    return bytes(buffer[place + 2 : end]), end


def _skip_coded(buffer: bytes, place: int) -> int:
    found = _MARKER.search(buffer, place)
    if found is None:
        raise files.TRUNCATED.refuse("The JPEG ends before its own end marker: it was cut short.")
    return found.start()


def _read_frame(body: bytes) -> tuple[int, int, int]:
    if len(body) < 6:
        raise files.SIZE_MISMATCH.refuse("The JPEG does not state its size.")
    bits, height, width, samples = struct.unpack(">BHHB", body[:6])
    if bits != 8 or samples not in (1, 3):
        raise files.UNSUPPORTED_LAYOUT.refuse(
            f"The JPEG has {samples} samples of {bits} bits per pixel; grey or RGB of 8 bits is read.",
        )
    return height, width, samples
