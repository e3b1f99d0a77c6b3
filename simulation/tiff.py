"""TIFF files byte by byte, in either order, right or wrong as a test wants them."""

import struct
from collections.abc import Mapping
from datetime import datetime
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.exposure import Settings

BYTE, ASCII, SHORT, LONG, RATIONAL, UNDEFINED, SRATIONAL, DOUBLE = 1, 2, 3, 4, 5, 7, 10, 12
_FORMATS = {SHORT: "H", LONG: "I", RATIONAL: "II", SRATIONAL: "ii", DOUBLE: "d"}
_LARGEST_DENOMINATOR = 1_000_000

Entries = dict[int, tuple[int, Any]]  # kind and values by tag; a fraction is a pair


class TiffWriter:
    """Writer that only appends: data, then the directories that point to it, then the first directory."""

    def __init__(self, order: str = "<") -> None:
        self.order = order
        self.content = bytearray((b"II*\0" if order == "<" else b"MM\0*") + b"\0\0\0\0")

    def append(self, data: bytes | bytearray) -> int:
        """Append data on a word; return its offset."""
        self.content += b"\0" * (len(self.content) % 2)
        offset = len(self.content)
        self.content += data
        return offset

    def directory(self, entries: Mapping[int, tuple[int, Any]]) -> int:
        """Append a directory; return its offset."""
        table = b""
        for tag, (kind, values) in sorted(entries.items()):
            data, count = self._encode(kind, values)
            if len(data) > 4:
                data = struct.pack(self.order + "I", self.append(data))
            table += struct.pack(self.order + "HHI", tag, kind, count) + data.ljust(4, b"\0")
        return self.append(struct.pack(self.order + "H", len(entries)) + table + b"\0\0\0\0")

    def finish(self, first_directory: int) -> bytes:
        """Return the file."""
        struct.pack_into(self.order + "I", self.content, 4, first_directory)
        return bytes(self.content)

    def _encode(self, kind: int, values: Any) -> tuple[bytes, int]:  # noqa: ANN401  of any kind
        if kind in (ASCII, UNDEFINED, BYTE):
            data = values.encode() + b"\0" if isinstance(values, str) else bytes(values)
            return data, len(data)
        values = values if isinstance(values, list) else [values]
        layout = self.order + _FORMATS[kind]
        pairs = [value if isinstance(value, tuple) else (value,) for value in values]
        return b"".join(struct.pack(layout, *pair) for pair in pairs), len(values)


def describe_image(samples: NDArray[np.uint16], *, photometric: int) -> Entries:
    """Return the entries of an image of 16-bit words, without those of its data."""
    rows, cols = samples.shape
    return {
        254: (LONG, 0),  # NewSubfileType
        256: (LONG, cols),
        257: (LONG, rows),
        258: (SHORT, 16),
        259: (SHORT, 1),  # Compression: none
        262: (SHORT, photometric),
        277: (SHORT, 1),  # SamplesPerPixel
        284: (SHORT, 1),  # PlanarConfiguration
    }


def append_strip(writer: TiffWriter, samples: NDArray[np.uint16]) -> Entries:
    """Append an image as one strip; return the entries of its data."""
    offset = writer.append(samples.astype(writer.order + "u2").tobytes())
    return {273: (LONG, offset), 278: (LONG, samples.shape[0]), 279: (LONG, samples.nbytes)}


def approximate(value: float) -> tuple[int, int]:
    """Return the nearest fraction with a denominator of at most 10^6: 1/60 s stays 1/60."""
    return Fraction(value).limit_denominator(_LARGEST_DENOMINATOR).as_integer_ratio()


def describe_exposure(settings: Settings, taken_at: datetime) -> Entries:
    """Return the EXIF entries of nominal settings and of a time with its offset."""
    offset = f"{taken_at:%z}"
    return {
        33434: (RATIONAL, approximate(settings.exposure_time_s)),  # ExposureTime
        33437: (RATIONAL, approximate(settings.f_number)),  # FNumber
        34855: (SHORT, round(settings.iso)),  # PhotographicSensitivity
        36867: (ASCII, f"{taken_at:%Y:%m:%d %H:%M:%S}"),  # DateTimeOriginal
        36881: (ASCII, f"{offset[:3]}:{offset[3:5]}"),  # OffsetTimeOriginal
    }
