"""Limits of a decoding process."""

from dataclasses import dataclass
from typing import Final

# How a cell ends that is less shut in than the first one of its zygote was.
NOT_SHUT_IN: Final = 90

_WALL_S: Final = 20.0
_WALL_S_PER_MIB: Final = 1.0


@dataclass(frozen=True, kw_only=True)
class DecoderLimits:
    """Beyond these the process is ended, and only the file that it was reading is blamed.

    They are bounds: what a file is given follows from its size and from the frame that it claims.
    """

    memory_bytes: int = 2 << 30  # of address space, the libraries' own included
    cpu_seconds: int = 20  # for one request
    wall_seconds: float = 30.0  # for one request

    def wall_seconds_of(self, file_bytes: int) -> float:
        """For one request: waiting for the processor counts, so it is wide, and grows with the file."""
        return min(self.wall_seconds, _WALL_S + _WALL_S_PER_MIB * file_bytes / (1 << 20))
