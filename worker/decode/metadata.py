"""Camera and exposure by EXIF and DNG tags. Nothing here can make a file unreadable."""

import math
import re
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from radiometry.findings import InputRejected
from radiometry.frame import PositionFix, StatedAngle
from worker.decode import limits, tags
from worker.decode.attitude import read_attitude
from worker.decode.position import read_fix, read_height, read_position
from worker.decode.tiff import Directory
from worker.decode.xmp import Xmp, read_xmp

_ASK_ELSEWHERE: Final = 65_535  # EXIF 2.3: the ISO does not fit, another tag has it
_PROGRAMS: Final = {
    1: "manual",
    2: "program",
    3: "aperture_priority",
    4: "shutter_priority",
    5: "creative",
    6: "action",
    7: "portrait",
    8: "landscape",
}
_MODES: Final = {0: "auto", 1: "manual", 2: "bracket"}
# Compiled here, once, rather than by each cell.
_FRACTION: Final = re.compile(r"[0-9]{1,9}")
_OFFSET: Final = re.compile(r"[+-]([01][0-9]|2[0-3]):[0-5][0-9]|Z")
_ISO_TAGS: Final = (
    tags.ISO_RATINGS,
    tags.RECOMMENDED_EXPOSURE_INDEX,
    tags.ISO_SPEED,
    tags.STANDARD_OUTPUT_SENSITIVITY,
)


@dataclass(frozen=True, kw_only=True)
class Metadata:
    """The fields of FrameHeader of the same names.

    There is no sensor temperature: neither EXIF nor DNG has a tag for it (AmbientTemperature is the air's),
    and maker notes are not read.
    """

    exposure_time_s: float | None
    exposure_time_apex_s: float | None
    f_number: float | None
    f_number_apex: float | None
    iso: float | None
    exposure_mode: str | None
    exposure_program: str | None
    make: str | None
    model: str | None
    serial: str | None
    lens_make: str | None
    lens_model: str | None
    lens_serial: str | None
    taken_at: str | None
    orientation: int | None
    software: str | None
    latitude_deg: float | None
    longitude_deg: float | None
    altitude_m: float | None
    position_fix: PositionFix | None
    height_above_takeoff_m: float | None
    attitude: tuple[StatedAngle, ...]


class _Tags:
    """Tags looked up in EXIF first and then beside the image, where TIFF/EP puts the same ones."""

    def __init__(self, main: Directory) -> None:
        self._directories = [main]
        try:
            exif = main.directory(tags.EXIF)
        except InputRejected:
            exif = None
        if exif is not None:
            self._directories.insert(0, exif)

    def numbers(self, tag: int) -> list[float]:
        for directory in self._directories:
            try:
                values = directory.numbers(tag, at_most=64)
            except InputRejected:
                continue
            stated = [float(value) for value in values if value is not None]
            if stated:
                return stated
        return []

    def number(self, tag: int) -> float | None:
        """Not negative: no quantity read here can be."""
        values = self.numbers(tag)
        return values[0] if values and values[0] >= 0 else None

    def code(self, tag: int) -> int | None:
        values = self.numbers(tag)
        return int(values[0]) if values else None

    def text(self, *wanted: int) -> str | None:
        for tag in wanted:
            for directory in self._directories:
                try:
                    text = _clean(directory.raw(tag, at_most=4096))
                except InputRejected:
                    continue
                if text:
                    return text
        return None


def read_metadata(main: Directory) -> Metadata:
    found = _Tags(main)
    exposure_time_s, f_number = found.number(tags.EXPOSURE_TIME), found.number(tags.F_NUMBER)
    position, xmp = read_position(main), Xmp(read_xmp(main))
    return Metadata(
        latitude_deg=position.latitude_deg,
        longitude_deg=position.longitude_deg,
        altitude_m=position.altitude_m,
        position_fix=read_fix(xmp),
        height_above_takeoff_m=read_height(xmp),
        attitude=read_attitude(xmp),
        exposure_time_s=exposure_time_s,
        exposure_time_apex_s=_from_apex(found.numbers(tags.SHUTTER_SPEED_VALUE), -1.0, exposure_time_s),
        f_number=f_number,
        f_number_apex=_from_apex(found.numbers(tags.APERTURE_VALUE), 0.5, f_number),
        iso=_read_iso(found),
        exposure_mode=_MODES.get(_or_none(found.code(tags.EXPOSURE_MODE))),
        exposure_program=_PROGRAMS.get(_or_none(found.code(tags.EXPOSURE_PROGRAM))),
        make=found.text(tags.MAKE),
        model=found.text(tags.MODEL, tags.UNIQUE_CAMERA_MODEL),
        serial=found.text(tags.CAMERA_SERIAL, tags.BODY_SERIAL),
        lens_make=found.text(tags.LENS_MAKE),
        lens_model=found.text(tags.LENS_MODEL),
        lens_serial=found.text(tags.LENS_SERIAL),
        taken_at=_read_time(found),
        orientation=_read_orientation(found),
        software=found.text(tags.SOFTWARE),
    )


def _or_none(code: int | None) -> int:
    return -1 if code is None else code


def _clean(raw: bytes) -> str | None:
    """Printable text up to the first NUL; a database stores no NUL and a page shows no control characters."""
    raw = raw.split(b"\0", 1)[0]
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    return printable.strip()[: limits.MAX_TEXT].strip() or None


def _from_apex(exponents: list[float], factor: float, nominal: float | None) -> float | None:
    """2**(factor * APEX value); beyond 2**64 it is no exposure of this world.

    A writer that knows nothing fills both tags with zeros, and an APEX value of zero would become 1 s or f/1.
    """
    if not exponents or abs(exponents[0]) > 64 or (exponents[0] == nominal == 0):
        return None
    return math.exp2(factor * exponents[0])


def _read_iso(found: _Tags) -> float | None:
    """The first one that is stated and positive; a zero only when nothing better is there."""
    stated = [
        value for tag in _ISO_TAGS for value in found.numbers(tag) if value >= 0 and value != _ASK_ELSEWHERE
    ]
    return next((value for value in stated if value > 0), stated[0] if stated else None)


def _read_orientation(found: _Tags) -> int | None:
    code = found.code(tags.ORIENTATION)
    return code if code is not None and 1 <= code <= 8 else None


def _read_time(found: _Tags) -> str | None:
    text = found.text(tags.DATE_TIME_ORIGINAL) or ""
    try:
        taken = datetime.strptime(text[:19], "%Y:%m:%d %H:%M:%S")  # noqa: DTZ007  EXIF time is local
    except ValueError:
        return None
    fraction = found.text(tags.SUB_SEC_TIME_ORIGINAL) or ""
    offset = found.text(tags.OFFSET_TIME_ORIGINAL) or ""
    stamp = taken.isoformat()
    if _FRACTION.fullmatch(fraction):
        stamp += f".{fraction}"
    if _OFFSET.fullmatch(offset):
        stamp += offset
    return stamp
