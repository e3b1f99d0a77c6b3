"""Compressed pieces of an image, decoded on two threads in a cell."""

import contextlib
import ctypes
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Final, TypeVar

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
    if (mallopt := getattr(ctypes.CDLL(None), "mallopt", None)) is not None:
        mallopt(option, value)


_T = TypeVar("_T")


class _SecondThread:
    def __init__(self) -> None:
        """Start it, and wait until it runs."""
        share_one_arena()
        self._find_own_cpu = ctypes.CDLL(None).sched_getcpu
        self._cpus = os.sched_getaffinity(0)
        self._executor = ThreadPoolExecutor(max_workers=1)
        self._executor.submit(int).result()

    def decode_every_other(
        self, decode: Callable[[_T], None], pieces: Sequence[_T]
    ) -> tuple[int, Exception] | None:
        """Decode pieces 0, 2, 4 ... here and the others there; the failure of the earliest piece, if any."""
        other = self._executor.submit(self._decode_elsewhere, self._find_own_cpu(), decode, pieces)
        failures = (_decode(decode, pieces, 0), other.result())
        return min((each for each in failures if each), default=None, key=lambda failure: failure[0])

    def _decode_elsewhere(
        self, cpu: int, decode: Callable[[_T], None], pieces: Sequence[_T]
    ) -> tuple[int, Exception] | None:
        # A guest's kernel takes an idle virtual processor for a busy one and puts both threads on one.
        # A container's processors may be changed while it runs: a failure costs speed only.
        with contextlib.suppress(OSError):
            os.sched_setaffinity(0, self._cpus - {cpu})
        return _decode(decode, pieces, 1)


_second: list[_SecondThread] = []


def start_second_thread() -> None:
    """Start another thread that decodes every other piece, where there are two processors and Linux."""
    if hasattr(os, "sched_getaffinity") and len(os.sched_getaffinity(0)) > 1:
        with contextlib.suppress(RuntimeError):  # no more threads are allowed here: one does as well
            _second.append(_SecondThread())


def decode_all(decode: Callable[[_T], None], pieces: Sequence[_T]) -> None:
    """Call ``decode`` with every piece; of several failures that of the earliest piece is raised."""
    if len(pieces) > 1 and _second:
        if (failure := _second[0].decode_every_other(decode, pieces)) is not None:
            raise failure[1]
    else:
        for piece in pieces:
            decode(piece)


def _decode(decode: Callable[[_T], None], pieces: Sequence[_T], first: int) -> tuple[int, Exception] | None:
    for index in range(first, len(pieces), 2):
        try:
            decode(pieces[index])
        except Exception as error:  # noqa: BLE001  raised again once both threads have ended
            return index, error
    return None
