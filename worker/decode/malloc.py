"""How glibc's malloc keeps memory; elsewhere nothing happens, and nothing but speed depends on it."""

import ctypes
from typing import Final

_TRIM_THRESHOLD: Final = -1
_MMAP_THRESHOLD: Final = -3
_ARENA_MAX: Final = -8
# The most that glibc takes. Above it memory comes from the kernel, page by page, and goes back at once.
_LARGEST_KEPT: Final = 32 << 20


def share_one_arena() -> None:
    """Serve all threads with memory of one place; a second one reserves address space, and keeps its own."""
    _set(_ARENA_MAX, 1)


def keep_memory(block_bytes: int = _LARGEST_KEPT) -> None:
    """Keep freed blocks up to this size, and twice as much, for the next ones: no page of them is new."""
    _set(_MMAP_THRESHOLD, block_bytes)
    _set(_TRIM_THRESHOLD, 2 * block_bytes)


def _set(option: int, value: int) -> None:
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(option, value)
