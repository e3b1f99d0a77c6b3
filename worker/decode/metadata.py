"""Camera and exposure by EXIF and DNG tags. Nothing here can make a file unreadable."""

import math
import re
from collections.abc import Mapping
from datetime import datetime
from typing import Any, Final
from xml.parsers import expat

from radiometry import findings, frame
from worker.decode import limits, tags, tiff

MAX_BYTES: Final = 256 << 10
MAX_DEPTH: Final = 16
MAX_PROPERTIES: Final = 2_000
MAX_TEXT_BYTES: Final = 128 << 10
_MOST_TERMS: Final = 64
_LARGEST: Final = 1e15
_RDF: Final = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
# By what their addresses hold: firmware writes them with and without version and closing slash.
_FAMILIES: Final = (
    ("micasense.com/MicaSense", "micasense"),
    ("micasense.com/DLS", "dls"),
    ("pix4d.com", "camera"),
    ("dji.com/drone-dji", "drone-dji"),
)
_CONTAINERS: Final = frozenset(f"{_RDF} {name}" for name in ("RDF", "Description", "Seq", "Bag", "Alt"))
_ITEM: Final = f"{_RDF} li"

Properties = Mapping[str, tuple[str, ...]]


class _RefusedError(Exception):
    """The packet is beyond the bounds, or declares a document type."""


class _Collector:
    """Gathers the properties of the known families: an attribute, an element's text, or its list's items."""

    def __init__(self) -> None:
        self.found: dict[str, list[str]] = {}
        self._depth = 0
        self._count = 0
        self._size = 0
        self._property: str | None = None
        self._opened_at = 0
        self._text: list[str] = []
        self._items: list[str] = []

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self._count += 1 + len(attributes)
        if self._depth > MAX_DEPTH or self._count > MAX_PROPERTIES:
            raise _RefusedError
        if self._property is None and name not in _CONTAINERS:
            self._property, self._opened_at = _key(name), self._depth
            self._text, self._items = [], []
        elif name == _ITEM:
            self._text = []
        for attribute, value in attributes.items():
            if (key := _key(attribute)) and self._property is None:
                self._add(key, [value])

    def end(self, name: str) -> None:
        if name == _ITEM and self._property is not None:
            self._items.append("".join(self._text))
        elif self._property is not None and self._depth == self._opened_at:
            self._add(self._property, self._items or ["".join(self._text)])
            self._property = None
        self._depth -= 1

    def text(self, text: str) -> None:
        if self._property is not None:
            self._size += len(text)
            if self._size > MAX_TEXT_BYTES:
                raise _RefusedError
            self._text.append(text)

    def _add(self, key: str, values: list[str]) -> None:
        self.found.setdefault(key, [value.strip() for value in values])


def _key(name: str) -> str | None:
    """`family:Name` of a known family."""
    address, _, local = name.rpartition(" ")
    return next((f"{family}:{local}" for part, family in _FAMILIES if part in address), None)


def read_xmp(main: tiff.Directory) -> Properties:
    """The packet's properties of the known families; empty where there is no packet to read."""
    try:
        packet = main.raw(tags.XMP, at_most=MAX_BYTES)
    except findings.InputRejected:
        return {}
    return parse_xmp(packet)


def parse_xmp(packet: bytes) -> Properties:
    if not (packet := packet.strip(b"\0 \r\n\t")) or len(packet) > MAX_BYTES:
        return {}
    collector = _Collector()
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartDoctypeDeclHandler = _refuse
    parser.EntityDeclHandler = _refuse
    parser.StartElementHandler = collector.start
    parser.EndElementHandler = collector.end
    parser.CharacterDataHandler = collector.text
    try:
        parser.Parse(packet, True)
    except (expat.ExpatError, _RefusedError, ValueError, LookupError):
        return {}
    return {key: tuple(values) for key, values in collector.found.items()}


def _refuse(*_declaration: object) -> None:
    raise _RefusedError


class Xmp:
    def __init__(self, found: Properties) -> None:
        self._found = found

    def text(self, key: str) -> str | None:
        values = self._found.get(key, ("",))
        printable = "".join(letter if letter.isprintable() else " " for letter in values[0])
        return printable.strip()[: limits.MAX_TEXT].strip() or None

    def whole(self, key: str) -> str | None:
        """A text of any length, as it is."""
        return self._found[key][0] if key in self._found else None

    def numbers(self, key: str) -> tuple[float, ...]:
        """All numbers of a property, a list or between commas; one that is none makes all nothing."""
        words = [word for value in self._found.get(key, ()) for word in value.split(",")]
        try:
            numbers = tuple(float(word) for word in words[: _MOST_TERMS + 1])
        except ValueError:
            return ()
        sane = len(numbers) <= _MOST_TERMS and all(abs(number) < _LARGEST for number in numbers)
        return numbers if sane else ()

    def require(self, key: str, count: int | None = None) -> tuple[tuple[float, ...], str]:
        """All numbers of a property, and "" or what is wrong with it; ``count`` : how many there must be."""
        numbers, name = self.numbers(key), key.partition(":")[2]
        if numbers and (count is None or len(numbers) == count):
            return numbers, ""
        if numbers:
            return (), f"{name} has {len(numbers)} numbers, not {count}"
        if key not in self._found:
            return (), f"{name} is missing"
        words = sum(value.count(",") + 1 for value in self._found[key])
        if words > _MOST_TERMS:
            return (), f"{name} has {words} numbers, more than {_MOST_TERMS}"
        return (), f"{name} is not a list of numbers below {_LARGEST:g}"

    def number(self, key: str) -> float | None:
        numbers = self.numbers(key)
        return numbers[0] if len(numbers) == 1 else None

    def first_number(self, *keys: str) -> float | None:
        """Return the number of a property that firmware writes in one of several families."""
        return next((found for key in keys if (found := self.number(key)) is not None), None)

    def index(self, key: str) -> int | None:
        number = self.number(key)
        return int(number) if number is not None and number == int(number) and 0 <= number < 1000 else None


_AXES: Final = ("Yaw", "Pitch", "Roll")
# A Sequoia's own, a MicaSense camera's of its light sensor (once in degrees, once in radians), a DJI's.
_NAMES: Final = (
    *(f"camera:{axis}" for axis in _AXES),
    *(f"camera:Irradiance{axis}" for axis in _AXES),
    *(f"dls:{axis}" for axis in _AXES),
    *(f"drone-dji:{part}{axis}Degree" for part in ("Gimbal", "Flight") for axis in _AXES),
)
_WHOLE_TURN: Final = 360.0


def read_attitude(xmp: Xmp) -> tuple[frame.StatedAngle, ...]:
    """The angles that the file states, under its own names; what is none is left out."""
    found = ((name, xmp.number(name)) for name in _NAMES)
    return tuple(
        frame.StatedAngle(name=name, value=value)
        for name, value in found
        if value is not None and abs(value) <= _WHOLE_TURN
    )


_BELOW_SEA_LEVEL: Final = 1
_HIGHEST_M: Final = 1e5
_FIXES: Final = {"none": range(1), "single": range(16, 17), "float": range(32, 50), "fixed": range(50, 51)}


def read_position(main: tiff.Directory) -> dict[str, float | None]:
    """Read latitude and longitude, and the altitude with them, unless the file does not know them.

    Not known: no hemisphere, a zero denominator, an interrupted fix (status V), and zero degrees both ways,
    which is what a receiver without a fix writes.
    """
    try:
        if (gps := main.directory(tags.GPS)) is None or _letter(gps, tags.GPS_STATUS) == "V":
            return {}
        latitude = _angle(gps, tags.GPS_LATITUDE, tags.GPS_LATITUDE_REF, "NS", 90.0)
        longitude = _angle(gps, tags.GPS_LONGITUDE, tags.GPS_LONGITUDE_REF, "EW", 180.0)
    except findings.InputRejected:
        return {}
    if latitude is None or longitude is None or latitude == longitude == 0.0:
        return {}
    return {"latitude_deg": latitude, "longitude_deg": longitude, "altitude_m": _altitude(gps)}


def read_fix(xmp: Xmp) -> frame.PositionFix | None:
    """How good a DJI aircraft says that its position is, by RtkFlag and its deviations."""
    if (state := xmp.index("drone-dji:RtkFlag")) is None:
        return None
    deviations = [xmp.number(f"drone-dji:RtkStd{axis}") for axis in ("Lat", "Lon", "Hgt")]
    latitude, longitude, height = (each if each and 0.0 < each < _HIGHEST_M else None for each in deviations)
    kind = next((kind for kind, states in _FIXES.items() if state in states), "other")
    return frame.PositionFix(kind=kind, u_latitude_m=latitude, u_longitude_m=longitude, u_height_m=height)


def _angle(gps: tiff.Directory, tag: int, ref: int, letters: str, largest_deg: float) -> float | None:
    """Degrees, minutes and seconds; writers that need no seconds put them into the fraction before."""
    parts = gps.numbers(tag, at_most=3)
    letter = _letter(gps, ref)
    stated = [float(part) for part in parts if part is not None and part >= 0]
    if not parts or len(stated) < len(parts) or not letter or letter not in letters:
        return None
    degrees = math.fsum(part / 60.0**power for power, part in enumerate(stated))
    if degrees > largest_deg:
        return None
    return degrees if letter == letters[0] else -degrees


def _altitude(gps: tiff.Directory) -> float | None:
    try:
        stated = gps.numbers(tags.GPS_ALTITUDE, at_most=1)
        below = gps.numbers(tags.GPS_ALTITUDE_REF, at_most=1) == [_BELOW_SEA_LEVEL]
    except findings.InputRejected:
        return None
    if not stated or stated[0] is None or abs(stated[0]) > _HIGHEST_M:
        return None
    return -stated[0] if below else stated[0]


def _letter(gps: tiff.Directory, tag: int) -> str:
    return gps.raw(tag, at_most=8).split(b"\0", 1)[0].decode("latin-1").strip().upper()


_ASK_ELSEWHERE: Final = 65_535  # EXIF 2.3: the ISO does not fit, another tag has it
_AUTOMATIC: Final = ("program", "aperture_priority", "shutter_priority", "creative", "action")
_PROGRAMS: Final[dict[int | None, str]] = dict(
    enumerate(("manual", *_AUTOMATIC, "portrait", "landscape"), start=1)
)
_MODES: Final[dict[int | None, str]] = {0: "auto", 1: "manual", 2: "bracket"}
# Compiled here, once, rather than by each cell.
_FRACTION: Final = re.compile(r"[0-9]{1,9}")
_OFFSET: Final = re.compile(r"[+-]([01][0-9]|2[0-3]):[0-5][0-9]|Z")
_ISO_TAGS: Final = (
    *(tags.ISO_RATINGS, tags.RECOMMENDED_EXPOSURE_INDEX),
    *(tags.ISO_SPEED, tags.STANDARD_OUTPUT_SENSITIVITY),
)


class _Tags:
    """Tags looked up in EXIF first and then beside the image, where TIFF/EP puts the same ones."""

    def __init__(self, main: tiff.Directory) -> None:
        self._directories = [main]
        try:
            exif = main.directory(tags.EXIF)
        except findings.InputRejected:
            exif = None
        if exif is not None:
            self._directories.insert(0, exif)

    def numbers(self, tag: int) -> list[float]:
        for directory in self._directories:
            try:
                values = directory.numbers(tag, at_most=64)
            except findings.InputRejected:
                continue
            if stated := [float(value) for value in values if value is not None]:
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
                except findings.InputRejected:
                    continue
                if text:
                    return text
        return None


def read_metadata(main: tiff.Directory) -> dict[str, Any]:
    """Return the fields of FrameHeader that tags and packet state: no tag has the sensor's temperature."""
    found, xmp = _Tags(main), Xmp(read_xmp(main))
    exposure_time_s, f_number = found.number(tags.EXPOSURE_TIME), found.number(tags.F_NUMBER)
    # above the take-off point, by the barometer of a DJI aircraft
    height_m = xmp.number("drone-dji:RelativeAltitude")
    orientation = found.code(tags.ORIENTATION)
    # the first that is stated and positive; a zero only when nothing better is there
    isos = [iso for tag in _ISO_TAGS for iso in found.numbers(tag) if iso >= 0 and iso != _ASK_ELSEWHERE]
    return {
        **read_position(main),
        "position_fix": read_fix(xmp),
        "height_above_takeoff_m": height_m if height_m is not None and abs(height_m) <= _HIGHEST_M else None,
        "attitude": read_attitude(xmp),
        "exposure_time_s": exposure_time_s,
        "exposure_time_apex_s": _from_apex(found.numbers(tags.SHUTTER_SPEED_VALUE), -1.0, exposure_time_s),
        "f_number": f_number,
        "f_number_apex": _from_apex(found.numbers(tags.APERTURE_VALUE), 0.5, f_number),
        "iso": next((iso for iso in isos if iso > 0), isos[0] if isos else None),
        "exposure_mode": _MODES.get(found.code(tags.EXPOSURE_MODE)),
        "exposure_program": _PROGRAMS.get(found.code(tags.EXPOSURE_PROGRAM)),
        "make": found.text(tags.MAKE),
        "model": found.text(tags.MODEL, tags.UNIQUE_CAMERA_MODEL),
        "serial": found.text(tags.CAMERA_SERIAL, tags.BODY_SERIAL),
        "lens_make": found.text(tags.LENS_MAKE),
        "lens_model": found.text(tags.LENS_MODEL),
        "lens_serial": found.text(tags.LENS_SERIAL),
        "taken_at": _read_time(found),
        "orientation": orientation if orientation is not None and 1 <= orientation <= 8 else None,
        "software": found.text(tags.SOFTWARE),
    }


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
    """2**(factor * APEX value); none beyond 2**64, nor of the zeros of a writer that knows nothing."""
    if not exponents or abs(exponents[0]) > 64 or (exponents[0] == nominal == 0):
        return None
    return math.exp2(factor * exponents[0])


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
