"""Files of hostile bytes, read by cells for the threads of this process."""

import os
import threading
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self

from radiometry.frame import Frame, FrameHeader
from radiometry.frame.proof import Proof
from store.sandbox.restrictions import Sandbox
from worker.decode.decoder import PREVIEW_SIDE_PX, Decoder, DecoderCrashed, DecoderKilled, Readable, path_of
from worker.decode.nursery import DecoderUnavailable, Nursery
from worker.decode.settings import DecoderLimits

__all__ = [
    "DecoderCrashed",
    "DecoderKilled",
    "DecoderLimits",
    "DecoderPool",
    "DecoderUnavailable",
    "Readable",
    "Sandbox",
]


class DecoderPool:
    """Thread-safe. A caller waits while as many cells are busy as the pool has room for.

    Every method raises InputRejected for a file that cannot be used, BlobDamaged for a stored one that is not
    what was uploaded, FileNotFoundError for one that is not there, DecoderCrashed for one that ended its
    cell, and DecoderKilled where somebody else did so twice.
    """

    def __init__(
        self,
        size: int = 1,
        *,
        memory_bytes: int = DecoderLimits.memory_bytes,
        cpu_seconds: int = DecoderLimits.cpu_seconds,
        wall_seconds: float = DecoderLimits.wall_seconds,
    ) -> None:
        self._size = size
        self._limits = DecoderLimits(
            memory_bytes=memory_bytes, cpu_seconds=cpu_seconds, wall_seconds=wall_seconds
        )
        self._nursery = Nursery(self._limits)
        self._begin()

    def start(self) -> Sandbox:
        """Start the zygote before the first file comes; what holds in its cells."""
        self._look_for_fork()
        return self._nursery.start()

    @contextmanager
    def hold(self, file: Readable) -> Iterator[None]:
        """Keep a file's cells between its reads; without that each read has a cell of its own."""
        self._look_for_fork()
        path = path_of(file)
        with self._lock:
            self._holds[path] += 1
        try:
            yield
        finally:
            with self._lock:
                self._holds[path] -= 1
                left = self._idle.pop(path, []) if self._holds[path] <= 0 else []
                self._holds += Counter()  # forgets those that have come to nothing
            for decoder in left:
                decoder.close()

    def read_header(self, file: Readable) -> FrameHeader:
        with self._borrowed(file) as decoder:
            return decoder.read_header()

    def read_window(self, file: Readable, window: tuple[int, int, int, int]) -> Frame:
        """``window`` : (row0, col0, height, width) in the visible area."""
        with self._borrowed(file) as decoder:
            return decoder.read_window(window)

    def inspect(self, file: Readable, longest_side_px: int = PREVIEW_SIDE_PX) -> tuple[bytes, Proof]:
        """Every row is read: a PNG, and what vouches for the pixels.

        Frame pixels per preview pixel are width_px / the preview's width.
        """
        with self._borrowed(file) as decoder:
            return decoder.inspect(longest_side_px)

    def pids(self) -> list[int]:
        """Return the process ids of the zygote and of the cells that live, as far as they are known."""
        with self._lock:
            idle = [decoder.pid for decoders in self._idle.values() for decoder in decoders]
            found = [self._nursery.pid, *(decoder.pid for decoder in self._busy), *idle]
        return [pid for pid in found if pid is not None]

    def close(self) -> None:
        if os.getpid() == self._owner:
            with self._lock:
                left = [decoder for decoders in self._idle.values() for decoder in decoders]
                self._idle.clear()
            for decoder in left:
                decoder.close()
            self._nursery.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def look_after(self) -> None:
        """Start the zygote again if it has died: what its owner does while forks use it."""
        self._nursery.look_after()

    def _begin(self) -> None:
        self._owner = os.getpid()
        self._lock = threading.Lock()
        self._room = threading.Semaphore(self._size)
        self._holds: Counter[Path] = Counter()
        self._idle: defaultdict[Path, list[Decoder]] = defaultdict(list)
        self._busy: list[Decoder] = []

    def _look_for_fork(self) -> None:
        """After a fork the sockets lead to the parent's cells, whose answers would be mixed up."""
        if os.getpid() != self._owner:
            self._nursery.share()
            for decoder in (*self._busy, *(each for idle in self._idle.values() for each in idle)):
                decoder.abandon()
            self._begin()

    @contextmanager
    def _borrowed(self, file: Readable) -> Iterator[Decoder]:
        self._look_for_fork()
        with self._room:
            decoder = self._take(file)
            try:
                yield decoder
            finally:
                self._give_back(path_of(file), decoder)

    def _take(self, file: Readable) -> Decoder:
        """One that has this very file open already, or a new one."""
        path = path_of(file)
        with self._lock:
            kept = self._idle[path].pop() if self._idle.get(path) else None
        if kept is not None and not kept.has_open(file):
            kept.close()
            kept = None
        decoder = kept or Decoder(self._nursery, self._limits, file)
        with self._lock:
            self._busy.append(decoder)
        return decoder

    def _give_back(self, path: Path, decoder: Decoder) -> None:
        with self._lock:
            self._busy.remove(decoder)
            keep = self._holds[path] > 0 and decoder.pid is not None
            if keep:
                self._idle[path].append(decoder)
        if not keep:
            decoder.close()
