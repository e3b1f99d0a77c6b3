"""DNG opcode lists: which opcodes a file carries, never what they would do."""

import hashlib
import struct
from typing import Final

from radiometry.frame import Opcode
from worker.decode import limits, tags
from worker.decode.tiff import Directory

_NAMES: Final = {
    1: "WarpRectilinear",
    2: "WarpFisheye",
    3: "FixVignetteRadial",
    4: "FixBadPixelsConstant",
    5: "FixBadPixelsList",
    6: "TrimBounds",
    7: "MapTable",
    8: "MapPolynomial",
    9: "GainMap",
    10: "DeltaPerRow",
    11: "DeltaPerColumn",
    12: "ScalePerRow",
    13: "ScalePerColumn",
    14: "WarpRectilinear2",
}
_MAX_LIST_BYTES: Final = 64 << 20
_HEAD: Final = struct.Struct(">IIII")  # big endian whatever the file's order


def read_opcodes(directory: Directory) -> tuple[Opcode, ...]:
    found: list[Opcode] = []
    for stage, tag in enumerate(tags.OPCODE_LISTS, start=1):
        found.extend(_parse(directory.raw(tag, at_most=_MAX_LIST_BYTES), stage))
    return tuple(found)


def _parse(data: bytes, stage: int) -> list[Opcode]:
    """Parse a list; one that cannot be parsed to its end ends in "unreadable", with the hash of the rest."""
    found: list[Opcode] = []
    count, position = int.from_bytes(data[:4], "big"), 4
    for _ in range(min(count, limits.MAX_OPCODES)):
        if position + _HEAD.size > len(data):
            break
        number, _version, _flags, size = _HEAD.unpack_from(data, position)
        start = position + _HEAD.size
        if start + size > len(data):
            break
        name = _NAMES.get(number, f"opcode-{number}")
        found.append(
            Opcode(stage=stage, name=name, sha256=hashlib.sha256(data[start : start + size]).hexdigest())
        )
        position = start + size
    if len(found) < count:
        rest = hashlib.sha256(data[position:]).hexdigest()
        found.append(Opcode(stage=stage, name="unreadable", sha256=rest))
    return found
