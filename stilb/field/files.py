"""Which files of a folder are frames, and what each is to its campaign."""

import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from stilb.upload import FrameDetails

ROLES = ("light", "dark", "flat", "panel", "chart", "field")
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
        found = re.fullmatch(_regular(_compose(self.pattern)), subject, re.IGNORECASE)
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
        file = _judge(path, name, rules)
        if file is not None:
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
        said = rule.match(name)
        if said is not None:
            scene = rule.scene or said.get("scene")
            return FieldFile(path=path, name=name, role=rule.role, scene=scene, details=rule.details)
    return None


def _compose(name: str) -> str:
    """Return a name as keyboards write it: macOS writes an accent apart from its letter."""
    return unicodedata.normalize("NFC", name)


def _regular(pattern: str) -> str:
    return "".join(_PARTS.get(part) or re.escape(part) for part in _WILD.split(pattern))
