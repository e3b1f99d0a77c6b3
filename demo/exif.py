"""The EXIF directory of a frame, as bytes that can be placed anywhere in a TIFF file.

tifffile writes no directory of EXIF tags (its extratags cannot be IFDs), and a camera's DNG has one.
"""

import math
import struct
from dataclasses import dataclass
from datetime import datetime
from fractions import Fraction

_ASCII, _SHORT, _RATIONAL, _UNDEFINED, _SRATIONAL = 2, 3, 5, 7, 10
_MANUAL_MODE, _MANUAL_PROGRAM, _ISO_IS_RECOMMENDED_INDEX = 1, 1, 2

Entry = tuple[int, int, int, bytes]  # tag, type, count, value


@dataclass(frozen=True, kw_only=True)
class Exposure:
    """What a camera writes about one exposure. Nominal and APEX values agree: both come from these."""

    exposure_time_s: float
    f_number: float
    iso: int
    taken_at: datetime
    body_serial: str
    lens_make: str
    lens_model: str
    lens_serial: str
    focal_length_mm: float


def exif_directory(exposure: Exposure, *, offset: int) -> bytes:
    """Lay out the directory for the place ``offset`` [bytes] in a little-endian file."""
    entries = sorted(_entries(exposure))
    table = struct.pack("<H", len(entries))
    values = b""
    values_at = offset + 2 + 12 * len(entries) + 4
    for tag, kind, count, value in entries:
        if len(value) <= 4:
            inline = value.ljust(4, b"\0")
        else:
            inline = struct.pack("<I", values_at + len(values))
            values += value + b"\0" * (len(value) % 2)
        table += struct.pack("<HHI", tag, kind, count) + inline
    return table + struct.pack("<I", 0) + values


def _entries(exposure: Exposure) -> list[Entry]:
    moment = exposure.taken_at
    return [
        _rational(33434, exposure.exposure_time_s),  # ExposureTime
        _rational(33437, exposure.f_number),  # FNumber
        _short(34850, _MANUAL_PROGRAM),  # ExposureProgram
        _short(34855, exposure.iso),  # PhotographicSensitivity
        _short(34864, _ISO_IS_RECOMMENDED_INDEX),  # SensitivityType
        (36864, _UNDEFINED, 4, b"0230"),  # ExifVersion
        _ascii(36867, moment.strftime("%Y:%m:%d %H:%M:%S")),  # DateTimeOriginal
        _ascii(36881, moment.strftime("%z")[:3] + ":" + moment.strftime("%z")[3:5]),  # OffsetTimeOriginal
        _signed_rational(37377, -math.log2(exposure.exposure_time_s)),  # ShutterSpeedValue
        _rational(37378, 2 * math.log2(exposure.f_number)),  # ApertureValue
        _rational(37386, exposure.focal_length_mm),  # FocalLength
        _short(41986, _MANUAL_MODE),  # ExposureMode
        _ascii(42033, exposure.body_serial),  # BodySerialNumber
        _ascii(42035, exposure.lens_make),  # LensMake
        _ascii(42036, exposure.lens_model),  # LensModel
        _ascii(42037, exposure.lens_serial),  # LensSerialNumber
    ]


def _short(tag: int, value: int) -> Entry:
    return tag, _SHORT, 1, struct.pack("<H", value)


def _ascii(tag: int, text: str) -> Entry:
    value = text.encode("ascii") + b"\0"
    return tag, _ASCII, len(value), value


def _rational(tag: int, value: float) -> Entry:
    return tag, _RATIONAL, 1, struct.pack("<II", *_ratio(value))


def _signed_rational(tag: int, value: float) -> Entry:
    return tag, _SRATIONAL, 1, struct.pack("<ii", *_ratio(value))


def _ratio(value: float) -> tuple[int, int]:
    """The simplest fraction that is closer than any tolerance: 1/60 s stays 1/60."""
    return Fraction(value).limit_denominator(1_000_000).as_integer_ratio()
