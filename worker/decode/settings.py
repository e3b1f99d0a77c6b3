"""What a decoding process may use up."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class DecoderLimits:
    """Beyond these the process is ended, and only the file that it was reading is blamed."""

    memory_bytes: int = 2 << 30  # of address space, the libraries' own included
    cpu_seconds: int = 20  # for one request
    wall_seconds: float = 30.0  # for one request
