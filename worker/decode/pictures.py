"""JPEG and PNG pictures: for charts only, where shapes are measured and not light."""

import abc
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, files
from radiometry.frame import FrameHeader, proof
from worker.decode import limits, metadata, tiff

_JPEG_MAGIC: Final = b"\xff\xd8\xff"
_END, _START_OF_SCAN, _EXIF = 0xD9, 0xDA, 0xE1
_EXIF_HEAD: Final = b"Exif\0\0"
_FRAMES: Final = {0xC0: "baseline", 0xC1: "extended", 0xC2: "progressive"}
_OTHER_FRAMES: Final = frozenset({0xC3, *range(0xC5, 0xC8), *range(0xC9, 0xCC), *range(0xCD, 0xD0)})
# In coded data FF is followed by 0 (a stuffed byte), a restart, or another FF that only fills.
_MARKER: Final = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]", re.DOTALL)
_MOST_SEGMENTS: Final = 10_000
_CUT: Final = "The JPEG ends before its own end marker: it was cut short."
# A block of 8 x 8 samples takes at least a bit in some scan: no picture is smaller than that.
_PIXELS_PER_BYTE: Final = 512


@dataclass(frozen=True, kw_only=True)
class Claims:
    """A picture by its own words. ``exif`` : the TIFF structure of its EXIF, empty where there is none."""

    height_px: int
    width_px: int
    samples: int
    bits: int
    exif: bytes


def _read_jpeg(buffer: bytes) -> Claims:
    """Walk the file's segments to its end; nothing is decoded."""
    frame: tuple[int, int, int] | None = None
    exif = b""
    place, scanned = 2, 0
    for _ in range(_MOST_SEGMENTS):
        marker, place = _next_marker(buffer, place)
        if marker == _END:
            break
        body, place = _read_segment(buffer, place)
        if marker in _FRAMES:
            frame = frame or _read_jpeg_frame(body)
        elif marker in _OTHER_FRAMES:
            message = "The JPEG is lossless or arithmetically coded: not read."
            raise files.UNSUPPORTED_COMPRESSION.refuse(message)
        elif marker == _EXIF and body.startswith(_EXIF_HEAD):
            exif = exif or body[len(_EXIF_HEAD) :]
        elif marker == _START_OF_SCAN:
            if (found := _MARKER.search(buffer, place)) is None:
                raise files.TRUNCATED.refuse(_CUT)
            scanned += found.start() - place
            place = found.start()
    else:
        raise files.UNSUPPORTED_LAYOUT.refuse("The JPEG is cut into more pieces than is sane.")
    if frame is None:
        raise files.SIZE_MISMATCH.refuse("The JPEG does not state its size.")
    height, width, samples = frame
    if height * width > scanned * _PIXELS_PER_BYTE:
        raise files.SIZE_MISMATCH.refuse(f"The JPEG claims {width} x {height} pixels and holds far fewer.")
    return Claims(height_px=height, width_px=width, samples=samples, bits=8, exif=exif)


def _next_marker(buffer: bytes, place: int) -> tuple[int, int]:
    if place + 2 > len(buffer):
        raise files.TRUNCATED.refuse(_CUT)
    if buffer[place] != 0xFF:
        raise files.SIZE_MISMATCH.refuse("The JPEG's segments do not follow each other.")
    while place + 1 < len(buffer) and buffer[place + 1] == 0xFF:
        place += 1
    if place + 1 >= len(buffer):
        raise files.TRUNCATED.refuse(_CUT)
    return buffer[place + 1], place + 2


def _read_segment(buffer: bytes, place: int) -> tuple[bytes, int]:
    length = int.from_bytes(buffer[place : place + 2], "big")
    end = place + length
    if end > len(buffer) or place + 2 > len(buffer):
        raise files.TRUNCATED.refuse("The JPEG ends within one of its segments: it was cut short.")
    if length < 2:
        raise files.SIZE_MISMATCH.refuse("The JPEG has a segment without a length.")
    return bytes(buffer[place + 2 : end]), end


def _read_jpeg_frame(body: bytes) -> tuple[int, int, int]:
    if len(body) < 6:
        raise files.SIZE_MISMATCH.refuse("The JPEG does not state its size.")
    bits, height, width, samples = struct.unpack(">BHHB", body[:6])
    if bits != 8 or samples not in (1, 3):
        message = f"The JPEG has {samples} samples of {bits} bits per pixel; grey or RGB of 8 bits is read."
        raise files.UNSUPPORTED_LAYOUT.refuse(message)
    return height, width, samples


PNG_MAGIC: Final = b"\x89PNG\r\n\x1a\n"
_SAMPLES: Final = {0: 1, 2: 3}
_MOST_CHUNKS: Final = 100_000
_MOST_EXIF_BYTES: Final = 1 << 20
# Deflate never packs tighter than 258 bytes into two bits.
_EXPANSION: Final = 1032


def _read_png(buffer: bytes) -> Claims:
    """Walk the file's chunks to its end; nothing is decompressed."""
    width, height, bits, samples = _read_png_head(buffer)
    place, packed, exif = len(PNG_MAGIC), 0, b""
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
    return Claims(height_px=height, width_px=width, samples=samples, bits=bits, exif=exif)


def _read_png_head(buffer: bytes) -> tuple[int, int, int, int]:
    head = bytes(buffer[len(PNG_MAGIC) : len(PNG_MAGIC) + 18])
    if len(head) < 18:
        raise files.TRUNCATED.refuse("The PNG ends within its own header.")
    length, kind, width, height, bits, colour = struct.unpack(">I4sIIBB", head)
    if (length, kind) != (13, b"IHDR"):
        raise files.SIZE_MISMATCH.refuse("The PNG does not begin with its header.")
    if colour not in _SAMPLES or bits not in (8, 16):
        raise files.UNSUPPORTED_LAYOUT.refuse(
            "The PNG has a palette, transparency or fewer than 8 bits; grey or RGB of 8 or 16 bits is read."
        )
    return width, height, bits, _SAMPLES[colour]


# A picture is decoded as a whole: three times as many bytes, and twice that as the window that is sent.
MAX_PICTURE_PX: Final = 100_000_000
_NOTHING: Final = tiff.Directory(b"", "<", {})


def is_picture(head: bytes) -> bool:
    return head.startswith((_JPEG_MAGIC, PNG_MAGIC))


class WholeFile(abc.ABC):
    """A file whose samples are all there at once, and mean what they are."""

    header: FrameHeader
    lowest_dn = 0.0

    @abc.abstractmethod
    def read(self, row0: int, col0: int, height: int, width: int) -> NDArray[np.uint16]: ...

    def bands(self) -> Iterator[tuple[int, NDArray[np.uint16]]]:
        yield 0, self.read(0, 0, self.header.height_px, self.header.width_px)

    def black_level(self, *_window: int) -> tuple[float, ...]:
        return self.header.black_level_dn


class PictureFile(WholeFile):
    """An opened JPEG or PNG. It is decoded whenever samples are asked for, and never kept."""

    def __init__(self, source: tiff.Source) -> None:
        self._source = source
        content = source[:]
        self._jpeg = content[:3] == _JPEG_MAGIC
        claims = _read_jpeg(content) if self._jpeg else _read_png(content)
        self.header = _describe("jpeg" if self._jpeg else "png", claims)

    def read(self, row0: int, col0: int, height: int, width: int) -> NDArray[np.uint16]:
        window = self._decode()[row0 : row0 + height, col0 : col0 + width]
        return window.astype(np.uint16)

    def vouch(self) -> tuple[proof.Voucher, tuple[proof.PieceRun, ...]]:
        """Return what proves the samples whole: a PNG has checksums, a JPEG only an end."""
        return "end" if self._jpeg else "checksum", ()

    def _decode(self) -> NDArray[np.uint8 | np.uint16]:
        header = self.header
        decode = imagecodecs.jpeg8_decode if self._jpeg else imagecodecs.png_decode
        try:
            samples: NDArray[np.uint8 | np.uint16] = decode(self._source[:])
        except (RuntimeError, ValueError) as error:
            raise files.SIZE_MISMATCH.refuse("The picture cannot be decoded.") from error
        colours = (3,) if header.cfa == "rgb" else ()
        wanted = np.uint8 if header.bits_per_sample == 8 else np.uint16
        if samples.shape != (header.height_px, header.width_px, *colours) or samples.dtype != wanted:
            raise files.SIZE_MISMATCH.refuse("The picture is not what its own header says.")
        return samples


def _describe(container: str, claims: Claims) -> FrameHeader:
    height_px, width_px, samples = claims.height_px, claims.width_px, claims.samples
    limits.check_frame_size(height_px, width_px)
    if height_px * width_px > MAX_PICTURE_PX:
        raise files.FRAME_TOO_LARGE.refuse(
            f"The picture claims {width_px} x {height_px} pixels, above the limit of "
            f"{MAX_PICTURE_PX // 1_000_000} megapixels."
        )
    return FrameHeader(
        container=container,
        decoder="imagecodecs",
        rendered=True,
        compression="jpeg" if container == "jpeg" else "deflate",
        bits_per_sample=claims.bits,
        width_px=width_px,
        height_px=height_px,
        cfa="rgb" if samples == 3 else "grey",
        black_level_dn=(0.0,) * samples,
        black_level_origin="default",
        white_level_dn=(float((1 << claims.bits) - 1),) * samples,
        white_level_origin="default",
        # Whoever needs bands reads the picture in one: each would decode all of it.
        band_rows=height_px,
        first_band_rows=height_px,
        **_read_exif(claims.exif),
    )


def _read_exif(exif: bytes) -> dict[str, Any]:
    """Read what the camera wrote beside the picture; damage there costs the metadata and not the picture."""
    try:
        main = tiff.read_directories(exif)[0] if tiff.is_tiff(exif) else _NOTHING
    except InputRejected:
        main = _NOTHING
    return metadata.read_metadata(main)
