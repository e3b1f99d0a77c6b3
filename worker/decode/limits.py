"""Limits of what one file may cost, by what it states and by the process that reads it."""

import math
import resource
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from radiometry.findings import files

MAX_SIDE_PX = 65_535
MAX_FRAME_PX = 250_000_000
MIN_SIDE_PX = 16
MAX_TAGS = 2_000  # in one directory
MAX_DIRECTORIES = 32
MAX_DIRECTORY_DEPTH = 3
MAX_SEGMENTS = 1 << 20
MAX_OPCODES = 256
MAX_TEXT = 200


def check_frame_size(rows: int, cols: int) -> None:
    if rows < MIN_SIDE_PX or cols < MIN_SIDE_PX:
        raise files.FRAME_TOO_SMALL.refuse(f"The image has only {cols} x {rows} pixels.")
    if max(rows, cols) > MAX_SIDE_PX or rows * cols > MAX_FRAME_PX:
        limit = MAX_FRAME_PX // 1_000_000
        message = f"The file claims {cols} x {rows} pixels, above the limit of {limit} megapixels."
        raise files.FRAME_TOO_LARGE.refuse(message)


def check_backed(claimed: float, held: float) -> None:
    """Refuse a claim that what the file holds cannot back, however well it was compressed."""
    if claimed > held:
        raise files.SIZE_MISMATCH.refuse("The file claims an image far larger than its data can hold.")


def check_segment_count(count: int) -> None:
    if count > MAX_SEGMENTS:
        raise files.FRAME_TOO_LARGE.refuse(f"The file cuts its image into {count} pieces.")


# How a cell ends that is less shut in than the first one of its zygote was.
NOT_SHUT_IN: Final = 90

_WALL_S: Final = 20.0
_WALL_S_PER_MIB: Final = 1.0


@dataclass(frozen=True, kw_only=True)
class DecoderLimits:
    """Beyond these the process is ended, and only the file that it was reading is blamed."""

    memory_bytes: int = 3 << 30  # of address space, the libraries' own included
    cpu_seconds: int = 60  # for one request
    wall_seconds: float = 120.0  # for one request

    def wall_seconds_of(self, file_bytes: int) -> float:
        """For one request: waiting for the processor counts, so it is wide, and grows with the file."""
        return min(self.wall_seconds, _WALL_S + _WALL_S_PER_MIB * file_bytes / (1 << 20))


Allow = Callable[[int], None]  # is told a frame's samples before anything of their size is allocated

_MIB: Final = 1 << 20
# The file is mapped, copied for a decoder that wants it in one piece, and copied once more by that.
_BYTES_PER_FILE_BYTE: Final = 3
_HEADER_BYTES: Final = 128 * _MIB
# Lossless JPEG in one strip takes most: its samples are counted back into bits in arrays of 8 bytes each.
_BYTES_PER_SAMPLE: Final = 32
_HEADER_CPU_S: Final = 5
_CPU_S_PER_MEGASAMPLE: Final = 0.5


class Budget:
    """Limits that a cell sets on itself; the hard ones of memory are the settings' own."""

    def __init__(self, bounds: DecoderLimits, *, before: int, file_bytes: int) -> None:
        """Start with what a header takes. ``before`` : the address space of a cell without a file."""
        self._bounds = bounds
        self._base = before + _HEADER_BYTES + _BYTES_PER_FILE_BYTE * file_bytes
        self._cpu_s = _HEADER_CPU_S
        self.allow(0)

    def allow(self, samples: int) -> None:
        most = self._bounds.memory_bytes
        memory = min(most, self._base + _BYTES_PER_SAMPLE * samples)
        resource.setrlimit(resource.RLIMIT_AS, (memory, most))
        self._cpu_s = _HEADER_CPU_S + math.ceil(samples / 1e6 * _CPU_S_PER_MEGASAMPLE)
        self.begin_request()

    def begin_request(self) -> None:
        used = resource.getrusage(resource.RUSAGE_SELF)
        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        allowed = int(used.ru_utime + used.ru_stime) + 1 + min(self._cpu_s, self._bounds.cpu_seconds)
        resource.setrlimit(resource.RLIMIT_CPU, (allowed, hard))


def allow_all(_samples: int) -> None:
    """For who reads a file in its own process, without limits."""


def read_address_space() -> int:
    """Return the address space of this process now: the libraries are most of it."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    return pages * resource.getpagesize()
