"""A copy of a DNG with more opcodes, which raw converters apply; the raw numbers stay as they are."""

import shutil
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from stilb.problem import Unclear

_SUBFILE_TYPE, _PHOTOMETRIC, _SUB_IFDS, _DNG_VERSION = 254, 262, 330, 50706
_WIDTH, _HEIGHT, _ACTIVE_AREA = 256, 257, 50829
_LISTS: Final = (51008, 51009, 51022)
_RAW: Final = (32803, 34892)  # of a mosaic, and linear
_BYTE, _SHORT, _UNDEFINED = 1, 3, 7
_INTEGERS: Final = {_SHORT: "H", 4: "I"}
_FALLOFF: Final = {3: "FixVignetteRadial", 9: "GainMap"}
_OPCODES_SINCE: Final = bytes((1, 3, 0, 0))


@dataclass(frozen=True)
class _Directory:
    """``pointer`` : where the file has the number that leads here; entries by tag: type, count, value."""

    pointer: int
    entries: dict[int, tuple[int, int, bytes]]
    next: bytes


def copy_with_opcodes(
    source: Path, target: Path, opcode_list: bytes, *, stage: int, size_px: tuple[int, int]
) -> None:
    """Copy a DNG, and add the opcodes of a list to its own of a stage, 1 to 3.

    ``size_px`` : width and height of the frames that they are for.

    Raises
    ------
    Unclear
        It is no DNG, of another size, or contains an opcode that corrects the falloff already.
    """
    if target.exists() and target.samefile(source):
        raise Unclear(f"{target} is the file itself: name another folder")
    shutil.copyfile(source, target)
    try:
        with target.open("r+b") as file:
            _add(file, opcode_list, _LISTS[stage - 1], size_px)
    except (Unclear, struct.error, ValueError) as error:
        target.unlink()
        detail = error if isinstance(error, Unclear) else "its directories cannot be read"
        raise Unclear(f"{source}: {detail}") from error


def _add(file: BinaryIO, opcode_list: bytes, into: int, size_px: tuple[int, int]) -> None:
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(file.read(4))
    if order is None:
        raise Unclear("no TIFF of 32-bit offsets, which a DNG is")
    main = _read(file, order, 4)
    if _DNG_VERSION not in main.entries:
        raise Unclear("no DNG: it lacks DNGVersion")
    found = next((each for each in [main, *_list_subs(file, order, main)] if _is_raw(each, order)), None)
    if found is None:
        raise Unclear("it has no raw image")
    size = _find_size(file, order, found)
    if size != size_px:
        stated = "frames of {} x {} px".format
        raise Unclear(f"the version is for {stated(*size_px)}, not for {stated(*size)}")
    held: dict[int, bytes] = {
        tag: _value(file, order, found.entries[tag]) for tag in _LISTS if tag in found.entries
    }
    for number in (number for opcodes in held.values() for number in _list_numbers(opcodes)):
        if number in _FALLOFF:
            raise Unclear(f"its {_FALLOFF[number]} corrects the falloff already")
    old = held.get(into, b"")
    count = int.from_bytes(old[:4], "big") + int.from_bytes(opcode_list[:4], "big")
    opcodes = count.to_bytes(4, "big") + old[4:] + opcode_list[4:]
    if main.entries[_DNG_VERSION][2] < _OPCODES_SINCE:
        main.entries[_DNG_VERSION] = (_BYTE, 4, _OPCODES_SINCE)
        file.seek(_find_entry(file, order, main, _DNG_VERSION))
        file.write(_OPCODES_SINCE)
    where = _at_end(file)
    file.write(opcodes)
    found.entries[into] = (_UNDEFINED, len(opcodes), struct.pack(f"{order}I", where))
    _append(file, order, found)


def _read(file: BinaryIO, order: str, pointer: int) -> _Directory:
    file.seek(pointer)
    file.seek(struct.unpack(f"{order}I", file.read(4))[0])
    (count,) = struct.unpack(f"{order}H", file.read(2))
    entries = {}
    for _ in range(count):
        tag, kind, number, value = struct.unpack(f"{order}HHI4s", file.read(12))
        entries[tag] = (kind, number, value)
    return _Directory(pointer, entries, file.read(4))


def _list_subs(file: BinaryIO, order: str, main: _Directory) -> list[_Directory]:
    _, count, value = main.entries.get(_SUB_IFDS, (0, 0, b""))
    if count == 1:
        return [_read(file, order, _find_entry(file, order, main, _SUB_IFDS))]
    start = struct.unpack(f"{order}I", value)[0] if count else 0
    return [_read(file, order, start + 4 * each) for each in range(count)]


def _find_entry(file: BinaryIO, order: str, directory: _Directory, tag: int) -> int:
    """Return the position of the four bytes of an entry's value."""
    file.seek(directory.pointer)
    first: int = struct.unpack(f"{order}I", file.read(4))[0]
    return first + 2 + 12 * list(directory.entries).index(tag) + 8


def _is_raw(directory: _Directory, order: str) -> bool:
    kind, _, photometric = directory.entries.get(_PHOTOMETRIC, (0, 0, bytes(4)))
    reduced = any(directory.entries.get(_SUBFILE_TYPE, (0, 0, bytes(4)))[2])
    return kind == _SHORT and not reduced and struct.unpack(f"{order}H2x", photometric)[0] in _RAW


def _value(file: BinaryIO, order: str, entry: tuple[int, int, bytes]) -> bytes:
    """Return a value of single bytes."""
    _, count, value = entry
    if count > len(value):
        file.seek(struct.unpack(f"{order}I", value)[0])
        value = file.read(count)
    return value[:count]


def _find_size(file: BinaryIO, order: str, raw: _Directory) -> tuple[int, int]:
    """Return width and height of the active area, or of the image if none is stated."""

    def read(tag: int) -> list[int]:
        kind, count, value = raw.entries.get(tag, (_SHORT, 0, b""))
        letter = _INTEGERS.get(kind, "I")
        size = count * struct.calcsize(letter)
        held = _value(file, order, (kind, size, value))
        return list(struct.unpack(f"{order}{count}{letter}", held))

    area = read(_ACTIVE_AREA)
    if area:
        top, left, bottom, right = area
        return right - left, bottom - top
    (width,), (height,) = read(_WIDTH), read(_HEIGHT)
    return width, height


def _list_numbers(opcodes: bytes) -> list[int]:
    numbers, at = [], 4
    while at < len(opcodes):
        number, _, _, size = struct.unpack_from(">4I", opcodes, at)
        numbers.append(number)
        at += 16 + size
    return numbers


def _at_end(file: BinaryIO) -> int:
    """Go to the end of the file, where a word may begin."""
    at = file.seek(0, 2)
    return at + file.write(b"\0" * (at % 2))


def _append(file: BinaryIO, order: str, directory: _Directory) -> None:
    """Write a directory to the end of the file, and have its pointer lead there."""
    at = _at_end(file)
    file.write(struct.pack(f"{order}H", len(directory.entries)))
    file.writelines(
        struct.pack(f"{order}HHI4s", tag, *entry) for tag, entry in sorted(directory.entries.items())
    )
    file.write(directory.next)
    file.seek(directory.pointer)
    file.write(struct.pack(f"{order}I", at))
