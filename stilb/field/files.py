"""Which files of a folder are frames, and what each is to its campaign."""

import logging
import math
import os
import re
import shlex
import struct
import subprocess
import unicodedata
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO, Final

import exifread

from stilb.client import Client
from stilb.field.template import read_methods
from stilb.upload import FrameDetails

ROLES = tuple(dict.fromkeys(role["name"] for method in read_methods().values() for role in method["roles"]))
RAW_SUFFIXES = frozenset(
    {".dng", ".tif", ".tiff", ".nef", ".cr2", ".cr3", ".arw", ".raf", ".rw2", ".orf", ".pef", ".srw"}
)
_WILD = re.compile(r"(\{scene\}|\*\*/|\*|\?)")
_PARTS = {"{scene}": "(?P<scene>[^/]+)", "**/": "(?:.*/)?", "*": "[^/]*", "?": "[^/]"}


@dataclass(frozen=True, kw_only=True)
class Rule:
    """Role of files by their names: by a pattern, by a range of names, or by both.

    ``pattern``: of the path below the folder where it holds a "/", else of the name; ``*``, ``?``, ``**/``
    and ``{scene}``, which names the scene. Without one: the raw files. ``first`` and ``last`` belong to it.
    """

    role: str
    pattern: str | None = None
    scene: str | None = None
    first: str | None = None
    last: str | None = None
    details: FrameDetails = field(default_factory=FrameDetails)

    def match(self, name: str) -> "dict[str, str] | None":
        """Return what the name states, or None where the rule does not concern it."""
        name = _compose(name)
        own = name.rpartition("/")[2].casefold()
        if not _compose(self.first or "").casefold() <= own:
            return None
        if self.last is not None and own > _compose(self.last).casefold():
            return None
        if self.pattern is None:
            return {} if is_raw(name) else None
        subject = name if "/" in self.pattern else own
        parts = _WILD.split(_compose(self.pattern))
        regular = "".join(_PARTS.get(part) or re.escape(part) for part in parts)
        found = re.fullmatch(regular, subject, re.IGNORECASE)
        return None if found is None else found.groupdict()


# Every raw file, until the service has proposed its role and scene; in a night of measurements a field frame.
ANY_RULES = (Rule(role="light"),)
NIGHT_RULES = (Rule(role="field"),)


@dataclass(frozen=True, kw_only=True)
class FieldFile:
    """One file to send: ``name`` is its path below the folder, with "/"."""

    path: Path
    name: str
    role: str
    scene: str | None = None
    details: FrameDetails = field(default_factory=FrameDetails)


def sort_files(
    folder: Path, rules: Sequence[Rule], *, raw_only: bool = False
) -> tuple[list[FieldFile], list[str]]:
    """The frames of a folder by name, the first rule that fits decides; and the raw files that none fits."""
    found, left_out = list[FieldFile](), list[str]()
    for path in _files(folder):
        name = path.relative_to(folder).as_posix()
        if raw_only and not is_raw(name):
            continue
        if (file := _judge(path, name, rules)) is not None:
            found.append(file)
        elif is_raw(name):
            left_out.append(name)
    return found, left_out


def is_raw(name: str) -> bool:
    return Path(name).suffix.lower() in RAW_SUFFIXES


def _files(folder: Path) -> Iterator[Path]:
    """Every file but the hidden ones: cards carry half copies of frames under such names."""
    for path in sorted(folder.rglob("*")):
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if not hidden and path.is_file():
            yield path


def _judge(path: Path, name: str, rules: Sequence[Rule]) -> FieldFile | None:
    for rule in rules:
        if (said := rule.match(name)) is not None:
            scene = rule.scene or said.get("scene")
            return FieldFile(path=path, name=name, role=rule.role, scene=scene, details=rule.details)
    return None


def _compose(name: str) -> str:
    """Return a name as keyboards write it: macOS writes an accent apart from its letter."""
    return unicodedata.normalize("NFC", name)


_CAMERA: Final = {
    "make": ("Image Make",),
    "model": ("Image Model",),
    "serial": ("Image Tag 0xC62F", "EXIF BodySerialNumber"),
}
_ISO = ("ISOSpeedRatings", "StandardOutputSensitivity", "RecommendedExposureIndex", "ISOSpeed")
_EXPOSURE: Final = {
    "exposure_time_s": ("EXIF ExposureTime", "Image ExposureTime"),
    "f_number": ("EXIF FNumber", "Image FNumber"),
    "iso": tuple(f"EXIF {name}" for name in _ISO),
}
_WHITE_LEVEL: Final = "Tag 0xC61D"
_MOSAIC, _GREY, _UNCOMPRESSED, _WORD_BITS = 32803, 1, 1, 16
_ROWS: Final = 8
_XMP: Final = {"serial": b"CameraSerialNumber", "band": b"BandName"}
_MOST_XMP_BYTES: Final = 1 << 16

logging.getLogger("exifread").setLevel(logging.CRITICAL)  # what a file lacks is no message to a person


def read_header(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            tags = exifread.process_file(file, extract_thumbnail=False)
            found: dict[str, Any] = {name: _read_text(tags, *keys) for name, keys in _CAMERA.items()}
            found |= {name: _read_number(tags, *keys) for name, keys in _EXPOSURE.items()}
            found |= {name: found.get(name) or text for name, text in _read_packet(file, tags).items()}
            found |= {"taken_s": _read_time(tags), "signal_share": _measure_centre(file, tags)}
    except Exception:  # noqa: BLE001  whatever damaged or hostile bytes make the library raise
        return {}
    return {name: value for name, value in found.items() if value is not None}


def read_camera(folder: Path) -> dict[str, str]:
    """Return make, model and serial of the camera that most raw files of a folder are from."""
    found: Counter[tuple[str, ...]] = Counter()
    for file in sort_files(folder, ANY_RULES, raw_only=True)[0]:
        header = read_header(file.path)
        found[tuple(header.get(name, "") for name in _CAMERA)] += bool(header)
    return dict(zip(_CAMERA, found.most_common(1)[0][0], strict=True)) if found else {}


def place_files(
    client: Client, folder: Path, files: Sequence[FieldFile], **about: str
) -> tuple[list[FieldFile], list[str]]:
    """Return the files as `Client.propose` places them, and those without a header."""
    asked, known = _describe_headers(folder, files)
    placed = client.propose(asked, **about)["frames"] if asked else []
    pairs = zip(known, placed, strict=True)
    found = [replace(file, role=each["role"], scene=each.get("scene")) for file, each in pairs]
    placed_names = {file.name for file in known}
    return found, [file.name for file in files if file.name not in placed_names]


def find_method(client: Client, folder: Path, files: Sequence[FieldFile], **about: str) -> str | None:
    """Return the method that the files suit by their headers; None if none has one."""
    asked, _ = _describe_headers(folder, files)
    return client.propose(asked, **about)["method"] if asked else None


def _describe_headers(
    folder: Path, files: Sequence[FieldFile]
) -> tuple[list[dict[str, Any]], list[FieldFile]]:
    headers = {file.name: header for file in files if (header := read_header(file.path))}
    asked = [
        {"name": f"{folder.resolve().name}/{name}".encode(errors="replace").decode()[-1000:]}
        | {key: value for key, value in header.items() if key not in _CAMERA}
        for name, header in headers.items()
    ]
    return asked, [file for file in files if file.name in headers]


def _read_text(tags: Mapping[str, Any], *keys: str) -> str | None:
    texts = (str(tags[key].printable).strip("\0 ") for key in keys if key in tags)
    return next(filter(None, texts), None)


def _read_number(tags: Mapping[str, Any], *keys: str) -> float | None:
    for key in keys:
        values = tags[key].values if key in tags else ()
        if values and 0 < (value := float(values[0])) < 1e9:
            return value
    return None


def _read_time(tags: Mapping[str, Any]) -> float | None:
    """Return seconds since 1970; a local time counts as UTC."""
    stated = _read_text(tags, "EXIF DateTimeOriginal")
    offset = _read_text(tags, "EXIF OffsetTimeOriginal")
    if stated is None:
        return None
    taken = datetime.strptime(stated[:19], "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC)
    if offset and re.fullmatch(r"[+-]\d\d:\d\d", offset):
        taken = datetime.fromisoformat(f"{taken:%Y-%m-%dT%H:%M:%S}{offset}")
    fraction = _read_text(tags, "EXIF SubSecTimeOriginal") or "0"
    return taken.timestamp() + (float(f"0.{fraction}") if fraction.isdigit() else 0.0)


def _read_packet(file: BinaryIO, tags: Mapping[str, Any]) -> dict[str, str]:
    """Return texts of the XMP packet, each as an attribute, an element or the first item of a list."""
    if (packet := tags.get("Image ApplicationNotes")) is None:
        return {}
    file.seek(packet.field_offset)
    text = file.read(min(packet.field_length, _MOST_XMP_BYTES))
    found = {}
    for name, tag in _XMP.items():
        item = rb":%s(?:=\"|>\s*(?:<rdf:(?:Seq|Bag|Alt)>\s*<rdf:li[^>]*>)?)([^\"<]+)" % tag
        if match := re.search(item, text):
            found[name] = match[1].decode(errors="replace").strip()
    return found


def _measure_centre(file: BinaryIO, tags: Mapping[str, Any]) -> float | None:
    """Return the mean of the middle ninth from black to white; None if it is compressed or packed."""
    for part in ("Image", *sorted({key.rpartition(" ")[0] for key in tags if key.startswith("EXIF SubIFD")})):

        def read(name: str, usual: int | None = None, part: str = part) -> list[int]:
            tag = tags.get(f"{part} {name}")
            return [int(value) for value in tag.values] if tag else [] if usual is None else [usual]

        (kind, *_), (bits, *_) = read("PhotometricInterpretation", -1), read("BitsPerSample", 1)
        strips, (width, *_) = read("StripOffsets"), read("ImageWidth", 0)
        (height, *_) = read("ImageLength", 0)
        plain = read("Compression", 1)[0] == _UNCOMPRESSED and read("SamplesPerPixel", 1)[0] == 1
        if not (plain and bits == _WORD_BITS and kind in {_MOSAIC, _GREY} and strips and width and height):
            continue
        (black, *_), (white, *_) = read("BlackLevel", 0), read(_WHITE_LEVEL, 65535)
        (rows, *_) = read("RowsPerStrip", height)
        first, count = width // 3, math.ceil(2 * width / 3) - width // 3
        file.seek(0)
        order = ">" if file.read(2) == b"MM" else "<"
        values: list[int] = []
        for step in range(_ROWS):
            row = height // 3 + height * step // (3 * _ROWS)
            file.seek(strips[row // rows] + 2 * ((row % rows) * width + first))
            values += struct.unpack(f"{order}{count}H", file.read(2 * count))
        return (sum(values) / len(values) - black) / (white - black) if white > black else None
    return None


_FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f\x7f]')
# Devices of Windows, with any extension.
_RESERVED = re.compile(r"(con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])( *\..*)?", re.IGNORECASE)
# Of the 255 that a name may have, the rest is for what is added to it.
_MOST_BYTES = 180


def quote(path: Path) -> str:
    return (subprocess.list2cmdline if os.name == "nt" else shlex.join)([str(path)])


def plain_stem(filename: str) -> str:
    """Return the name of a file without its extension, in characters that Windows takes as well."""
    name = _FORBIDDEN.sub("_", filename)
    before, dot, _ = name.rpartition(".")
    cut = (before if dot and before else name).encode("utf-8", "replace")[:_MOST_BYTES]
    stem = cut.decode("utf-8", "ignore").strip(". ")
    return f"_{stem}" if not stem or _RESERVED.fullmatch(stem) else stem
