"""A few decoding processes shared by the threads of this process.

Each is started with exec when it is first needed: rawpy deadlocks in processes that were only forked.
"""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self

from radiometry.frame import Frame, FrameHeader
from radiometry.proof import Proof
from worker.decode.decoder import (
    PREVIEW_SIDE_PX,
    Decoder,
    DecoderCrashed,
    DecoderUnavailable,
    Readable,
    path_of,
)
from worker.decode.settings import DecoderLimits

__all__ = ["Decoder", "DecoderCrashed", "DecoderLimits", "DecoderPool", "DecoderUnavailable", "Readable"]


class DecoderPool:
    """Thread-safe. A caller waits while all processes are busy.

    Every method raises InputRejected for a file that cannot be used, BlobDamaged for a stored one that is not
    what was uploaded, FileNotFoundError for one that is not there, and DecoderCrashed for one that ended its
    process; the next call gets a new process.
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
        self._make_decoders()

    def read_header(self, file: Readable) -> FrameHeader:
        with self._borrowed(file) as decoder:
            return decoder.read_header(file)

    def read_window(self, file: Readable, window: tuple[int, int, int, int]) -> Frame:
        """``window`` : (row0, col0, height, width) in the visible area."""
        with self._borrowed(file) as decoder:
            return decoder.read_window(file, window)

    def inspect(self, file: Readable, longest_side_px: int = PREVIEW_SIDE_PX) -> tuple[bytes, Proof]:
        """Every row is read: a PNG, and what vouches for the pixels.

        Frame pixels per preview pixel are width_px / the preview's width.
        """
        with self._borrowed(file) as decoder:
            return decoder.inspect(file, longest_side_px)

    def pids(self) -> list[int]:
        """Of the processes that have been started."""
        return [decoder.pid for decoder in self._decoders if decoder.pid is not None]

    def close(self) -> None:
        if os.getpid() == self._owner:
            for decoder in self._decoders:
                decoder.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _make_decoders(self) -> None:
        self._owner = os.getpid()
        self._decoders = [Decoder(self._limits) for _ in range(self._size)]
        self._idle = list(self._decoders)
        self._returned = threading.Condition()

    @contextmanager
    def _borrowed(self, file: Readable) -> Iterator[Decoder]:
        if os.getpid() != self._owner:
            # After a fork the pipes lead to the parent's processes, whose answers would be mixed up.
            for decoder in self._decoders:
                decoder.abandon()
            self._make_decoders()
        with self._returned:
            self._returned.wait_for(lambda: self._idle)
            decoder = self._choose(file)
        try:
            yield decoder
        finally:
            with self._returned:
                self._idle.append(decoder)
                self._returned.notify()

    def _choose(self, file: Readable) -> Decoder:
        """The process that read this file last has it open; one that runs is better than a new one."""
        best = max(self._idle, key=lambda each: (each.last_path == path_of(file), each.pid is not None))
        self._idle.remove(best)
        return best
