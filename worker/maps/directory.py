"""EXIF and GPS directories of a map, as bytes appended to its file: tifffile writes none."""

import math
import struct
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Final

from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Exposure
from worker.decode import tags

_ASCII, _BYTE, _SHORT, _LONG, _RATIONAL, _SRATIONAL = 2, 1, 3, 4, 5, 10
_WHOLE: Final = 0xFFFF
_PER_MILLIMETRE: Final = 4
_LARGEST: Final = 1_000_000

Entry = tuple[int, int, int, bytes]  # tag, type, count, value


def append_directories(path: Path, header: FrameHeader, exposure: Exposure | None) -> None:
    """Hang what is known of the exposure and the place into a little-endian TIFF with empty pointers."""
    if has_exif(header, exposure):
        _append(path, tags.EXIF, _exif_entries(header, exposure))
    if header.latitude_deg is not None and header.longitude_deg is not None:
        _append(path, tags.GPS, _gps_entries(header.latitude_deg, header.longitude_deg, header.altitude_m))


def has_exif(header: FrameHeader, exposure: Exposure | None) -> bool:
    """Return True if there is anything to write: a directory without an entry is none."""
    return bool(_exif_entries(header, exposure))


def _exif_entries(header: FrameHeader, exposure: Exposure | None) -> list[Entry]:
    entries = [*(_exposure_entries(exposure) if exposure is not None else []), *_focal_plane(header)]
    texts = {
        tags.BODY_SERIAL: header.serial,
        tags.LENS_MAKE: header.lens_make,
        tags.LENS_MODEL: header.lens_model,
        tags.LENS_SERIAL: header.lens_serial,
    }
    if header.taken_at is not None:
        clock, offset = header.taken_at[:19], header.taken_at[19:]
        fraction, offset = ("", offset) if not offset.startswith(".") else _split_fraction(offset)
        texts[tags.DATE_TIME_ORIGINAL] = clock.replace("-", ":").replace("T", " ")
        texts[tags.SUB_SEC_TIME_ORIGINAL] = fraction
        texts[tags.OFFSET_TIME_ORIGINAL] = "+00:00" if offset == "Z" else offset
    return entries + [_text(tag, text) for tag, text in texts.items() if text]


def _exposure_entries(exposure: Exposure) -> list[Entry]:
    entries = [
        _rational(tags.EXPOSURE_TIME, exposure.exposure_time_s),
        _rational(tags.F_NUMBER, exposure.f_number),
        _iso(exposure.iso),
    ]
    if exposure.exposure_time_apex_s is not None:
        entries.append(_signed(tags.SHUTTER_SPEED_VALUE, -math.log2(exposure.exposure_time_apex_s)))
    if exposure.f_number_apex is not None:
        entries.append(_rational(tags.APERTURE_VALUE, 2 * math.log2(exposure.f_number_apex)))
    return entries


def _focal_plane(header: FrameHeader) -> list[Entry]:
    lens = header.multispectral.geometry if header.multispectral is not None else None
    if lens is None or lens.pixels_per_mm is None:
        return []
    x, y = lens.pixels_per_mm
    unit = (tags.FOCAL_PLANE_RESOLUTION_UNIT, _SHORT, 1, struct.pack("<H", _PER_MILLIMETRE))
    focal_px = lens.focal_length_px
    if lens.model == "fisheye" and lens.fisheye_affine and len(lens.fisheye_polynomial) > 1:
        # rho = p1 2 angle / pi times C near the axis
        focal_px = 2.0 / math.pi * lens.fisheye_affine[0] * lens.fisheye_polynomial[1]
    focal = [_rational(tags.FOCAL_LENGTH, focal_px / x)] if focal_px and focal_px > 0.0 else []
    return [
        *focal,
        _rational(tags.FOCAL_PLANE_X_RESOLUTION, x),
        _rational(tags.FOCAL_PLANE_Y_RESOLUTION, y),
        unit,
    ]


def _split_fraction(rest: str) -> tuple[str, str]:
    digits = rest[1:]
    length = len(digits) - len(digits.lstrip("0123456789"))
    return digits[:length], digits[length:]


def _gps_entries(latitude_deg: float, longitude_deg: float, altitude_m: float | None) -> list[Entry]:
    entries = [
        (0, _BYTE, 4, b"\2\3\0\0"),
        _text(tags.GPS_LATITUDE_REF, "S" if latitude_deg < 0 else "N"),
        _angle(tags.GPS_LATITUDE, latitude_deg),
        _text(tags.GPS_LONGITUDE_REF, "W" if longitude_deg < 0 else "E"),
        _angle(tags.GPS_LONGITUDE, longitude_deg),
    ]
    if altitude_m is not None:
        entries.append((tags.GPS_ALTITUDE_REF, _BYTE, 1, bytes([altitude_m < 0])))
        entries.append(_rational(tags.GPS_ALTITUDE, abs(altitude_m)))
    return entries


def _append(path: Path, pointer: int, entries: Sequence[Entry]) -> None:
    with path.open("r+b") as file:
        at = file.seek(0, 2)
        at += file.write(b"\0" * (at % 2))  # a directory begins on a word
        file.write(_lay_out(sorted(entries), offset=at))
        file.seek(4)
        (first,) = struct.unpack("<I", file.read(4))
        file.seek(first)
        (count,) = struct.unpack("<H", file.read(2))
        index = [struct.unpack("<H", file.read(12)[:2])[0] for _ in range(count)].index(pointer)
        file.seek(first + 2 + 12 * index + 8)
        file.write(struct.pack("<I", at))


def _lay_out(entries: Sequence[Entry], *, offset: int) -> bytes:
    table, values = struct.pack("<H", len(entries)), b""
    values_at = offset + 2 + 12 * len(entries) + 4
    for tag, kind, count, value in entries:
        inline = value.ljust(4, b"\0")
        if len(value) > 4:
            inline = struct.pack("<I", values_at + len(values))
            values += value + b"\0" * (len(value) % 2)
        table += struct.pack("<HHI", tag, kind, count) + inline
    return table + struct.pack("<I", 0) + values


def _text(tag: int, text: str) -> Entry:
    value = text.encode("utf-8") + b"\0"
    return tag, _ASCII, len(value), value


def _iso(iso: float) -> Entry:
    number = round(iso)
    return (
        (tags.ISO_RATINGS, _SHORT, 1, struct.pack("<H", number))
        if number < _WHOLE
        else (tags.RECOMMENDED_EXPOSURE_INDEX, _LONG, 1, struct.pack("<I", number))
    )


def _rational(tag: int, value: float) -> Entry:
    return tag, _RATIONAL, 1, struct.pack("<II", *_ratio(value))


def _signed(tag: int, value: float) -> Entry:
    return tag, _SRATIONAL, 1, struct.pack("<ii", *_ratio(value))


def _angle(tag: int, degrees: float) -> Entry:
    """Whole degrees and minutes, seconds to a millionth: 30 um on the ground."""
    micro = round(abs(degrees) * 3600 * _LARGEST)
    whole, rest = divmod(micro, 3600 * _LARGEST)
    minutes, seconds = divmod(rest, 60 * _LARGEST)
    return tag, _RATIONAL, 3, struct.pack("<IIIIII", whole, 1, minutes, 1, seconds, _LARGEST)


def _ratio(value: float) -> tuple[int, int]:
    """The simplest fraction that is closer than any tolerance: 1/60 s stays 1/60."""
    return Fraction(value).limit_denominator(_LARGEST).as_integer_ratio()
