"""EXIF and GPS directories of a little-endian TIFF file.

tifffile writes no directory but the image's own (its extratags cannot be IFDs), and cameras write EXIF and
GPS. tifffile therefore reserves their places, and they are appended afterwards.
"""

import struct
from collections.abc import Iterable
from datetime import datetime
from fractions import Fraction
from pathlib import Path

from radiometry.frame.exposure import Settings

EXIF, GPS = 34665, 34853
_NAMES = {EXIF: "ExifTag", GPS: "GPSTag"}  # by their numbers tifffile would refuse them

_ASCII, _SHORT, _LONG, _RATIONAL, _UNDEFINED, _SRATIONAL = 2, 3, 4, 5, 7, 10
_LARGEST_DENOMINATOR = 1_000_000

Entry = tuple[int, int, int, bytes]  # tag, type, count, value


def reserve(tag: int) -> tuple[str, int, int, int, bool]:
    """Return the extratag that reserves the place of a directory in that of the image."""
    return _NAMES[tag], _LONG, 1, 0, True


def append_directory(path: Path, tag: int, entries: Iterable[Entry]) -> None:
    """Append a directory to a file, and write its offset where ``reserve`` kept a place."""
    with path.open("r+b") as file:
        at = file.seek(0, 2)
        at += file.write(b"\0" * (at % 2))  # a directory begins on a word
        file.write(lay_out(entries, offset=at))
        file.seek(4)
        (first,) = struct.unpack("<I", file.read(4))
        file.seek(first)
        (count,) = struct.unpack("<H", file.read(2))
        known = [file.read(12) for _ in range(count)]
        index = [struct.unpack("<H", entry[:2])[0] for entry in known].index(tag)
        file.seek(first + 2 + 12 * index + 8)
        file.write(struct.pack("<I", at))


def lay_out(entries: Iterable[Entry], *, offset: int) -> bytes:
    """Return a directory as bytes for the place ``offset`` [bytes]."""
    ordered = sorted(entries)
    table = struct.pack("<H", len(ordered))
    values = b""
    values_at = offset + 2 + 12 * len(ordered) + 4
    for tag, kind, count, value in ordered:
        if len(value) <= 4:
            inline = value.ljust(4, b"\0")
        else:
            inline = struct.pack("<I", values_at + len(values))
            values += value + b"\0" * (len(value) % 2)
        table += struct.pack("<HHI", tag, kind, count) + inline
    return table + struct.pack("<I", 0) + values


def short(tag: int, value: int) -> Entry:
    """Return an entry of 16 bits."""
    return tag, _SHORT, 1, struct.pack("<H", value)


def text(tag: int, value: str) -> Entry:
    """Return an entry of text."""
    encoded = value.encode("ascii") + b"\0"
    return tag, _ASCII, len(encoded), encoded


def undefined(tag: int, value: bytes) -> Entry:
    """Return an entry of bytes whose meaning the tag defines."""
    return tag, _UNDEFINED, len(value), value


def rational(tag: int, *values: float) -> Entry:
    """Return an entry of fractions."""
    return tag, _RATIONAL, len(values), b"".join(struct.pack("<II", *ratio(value)) for value in values)


def signed_rational(tag: int, value: float) -> Entry:
    """Return an entry of a fraction that may be negative."""
    return tag, _SRATIONAL, 1, struct.pack("<ii", *ratio(value))


def ratio(value: float) -> tuple[int, int]:
    """Return the nearest fraction with a denominator of at most 10^6: 1/60 s stays 1/60."""
    return Fraction(value).limit_denominator(_LARGEST_DENOMINATOR).as_integer_ratio()


def describe_exposure(settings: Settings, taken_at: datetime) -> list[Entry]:
    """Return the EXIF entries of nominal settings and of a time with its offset."""
    offset = f"{taken_at:%z}"
    return [
        rational(33434, settings.exposure_time_s),  # ExposureTime
        rational(33437, settings.f_number),  # FNumber
        short(34855, round(settings.iso)),  # PhotographicSensitivity
        text(36867, f"{taken_at:%Y:%m:%d %H:%M:%S}"),  # DateTimeOriginal
        text(36881, f"{offset[:3]}:{offset[3:5]}"),  # OffsetTimeOriginal
    ]
