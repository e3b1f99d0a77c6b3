"""Limits of a file, in proportion to what it holds and claims; the settings are the bounds above."""

import math
import resource
from collections.abc import Callable
from pathlib import Path
from typing import Final

from worker.decode.settings import DecoderLimits

Allow = Callable[[int], None]
"""Is told the number of samples of a frame before anything of their size is allocated."""

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
        """Widen the limits to what a frame of so many samples needs."""
        most = self._bounds.memory_bytes
        memory = min(most, self._base + _BYTES_PER_SAMPLE * samples)
        resource.setrlimit(resource.RLIMIT_AS, (memory, most))
        self._cpu_s = _HEADER_CPU_S + math.ceil(samples / 1e6 * _CPU_S_PER_MEGASAMPLE)
        self.begin_request()

    def begin_request(self) -> None:
        """Count the processor's time from now on."""
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
