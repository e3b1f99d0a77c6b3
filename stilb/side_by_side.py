"""Files sent side by side: how many at once, and the progress of all."""

import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

WHOLE_BYTES = 1 << 20
"""A smaller file goes in one request; only if that is cut it is sent as what can go on."""
_AT_ONCE = 2
_MOST_AT_ONCE = 16
"""Small files; more gain nothing, and a service takes what arrives together in one transaction anyway."""
_MOST_BYTES = 4 << 20
"""Of small files under way, beyond the first two."""
_QUICK_S = 1.0

Sent = TypeVar("Sent")


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a ``push`` is. Bytes go back to what has arrived when a connection is lost."""

    filename: str
    files_done: int
    files_total: int
    bytes_sent: int
    bytes_total: int


OnProgress = Callable[[Progress], None]


class Width:
    """How many files may be under way: two, and of small ones as many as a line carries in about a second.

    Each that was answered within a second makes room for one more, and each that took longer for one less: a
    line that breaks loses what was on its way. A caller's own number holds for all files.
    """

    def __init__(self, own: int | None) -> None:
        self._least = self._now = own or _AT_ONCE
        self._most = own or _MOST_AT_ONCE
        self._sizes: list[int] = []

    def has_room(self, size_bytes: int) -> bool:
        under_way = len(self._sizes)
        small = sum(self._sizes) + size_bytes <= _MOST_BYTES and size_bytes < WHOLE_BYTES
        return under_way < self._least or (small and under_way < self._now)

    def begin(self, size_bytes: int) -> None:
        self._sizes.append(size_bytes)

    def end(self, size_bytes: int, took_s: float) -> None:
        self._sizes.remove(size_bytes)
        more = 1 if took_s < _QUICK_S else -1
        self._now = max(self._least, min(self._most, self._now + more))


class Tally:
    """Counts over all threads of one push, and reports to one listener, one report at a time."""

    def __init__(self, paths: Sequence[Path], on_progress: OnProgress | None) -> None:
        self._lock = threading.Lock()
        self._on_progress = on_progress
        self._paths = paths
        # A file that has gone is the matter of whoever opens it.
        self.sizes = [path.stat().st_size if path.exists() else 0 for path in paths]
        self._bytes_total = sum(self.sizes)
        self._sent = [0] * len(paths)
        self._bytes_sent = 0
        self._files_done = 0

    def file(self, index: int) -> "FileCount":
        return FileCount(self, index)

    def set_sent(self, index: int, count: int) -> None:
        with self._lock:
            self._bytes_sent += count - self._sent[index]
            self._sent[index] = count
            self._report(index)

    def finish(self, index: int) -> None:
        with self._lock:
            self._files_done += 1
            self._report(index)

    def _report(self, index: int) -> None:
        if self._on_progress is None:
            return
        self._on_progress(
            Progress(
                filename=self._paths[index].name,
                files_done=self._files_done,
                files_total=len(self._paths),
                bytes_sent=self._bytes_sent,
                bytes_total=self._bytes_total,
            )
        )


class FileCount:
    """One file's part of the tally; one thread at a time works on it."""

    def __init__(self, tally: Tally, index: int) -> None:
        self._tally = tally
        self._index = index
        self._sent = 0

    def restart(self, offset: int) -> None:
        self._sent = offset

    def advance(self, count: int) -> None:
        self._sent += count
        self._tally.set_sent(self._index, self._sent)

    def finish(self) -> None:
        self._tally.finish(self._index)


def send_side_by_side(
    tally: Tally, send: Callable[[int], Sent], *, at_once: int | None, stop: Callable[[], None]
) -> list[Sent]:
    """Send each file of a tally by its number, in their order.

    The first failure is raised, and no further file begun. ``stop`` is called if somebody wants to stop at
    once, not after the files that are on their way.
    """
    width, under_way = Width(at_once), dict[Future[Sent], tuple[int, float]]()
    futures = list[Future[Sent]]()
    with ThreadPoolExecutor(at_once or _MOST_AT_ONCE, thread_name_prefix="stilb-push") as pool:
        try:
            for index, size_bytes in enumerate(tally.sizes):
                while not width.has_room(size_bytes):
                    _take_ended(under_way, width)
                width.begin(size_bytes)
                futures.append(pool.submit(send, index))
                under_way[futures[-1]] = size_bytes, time.monotonic()
            while under_way:
                _take_ended(under_way, width)
        except (KeyboardInterrupt, SystemExit):
            stop()
            raise
    return [future.result() for future in futures]


def _take_ended(under_way: dict[Future[Sent], tuple[int, float]], width: Width) -> None:
    """Wait for files that are answered, and raise the error of one that failed."""
    for future in wait(under_way, return_when=FIRST_COMPLETED).done:
        size_bytes, begun_at = under_way.pop(future)
        width.end(size_bytes, time.monotonic() - begun_at)
        future.result()
