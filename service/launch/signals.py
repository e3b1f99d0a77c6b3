"""Sleep that a signal ends: the launcher's main thread rests here, and a dying child or Ctrl-C wakes it."""

import select
import signal
import socket
from contextlib import suppress
from types import FrameType, TracebackType
from typing import Self

_STOP = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Signals:
    """Counts the requests to stop; use as a context manager, in the main thread."""

    def __init__(self) -> None:
        self.stops = 0

    def __enter__(self) -> Self:
        # The handlers themselves only count: they may interrupt any line, so they must take no lock.
        self._ear, self._mouth = socket.socketpair()
        self._ear.setblocking(False)
        self._mouth.setblocking(False)
        self._before_fd = signal.set_wakeup_fd(self._mouth.fileno(), warn_on_full_buffer=False)
        self._before = {number: signal.signal(number, self._count) for number in _STOP if _wanted(number)}
        self._before[signal.SIGCHLD] = signal.signal(signal.SIGCHLD, _only_wake)
        return self

    def wait(self, timeout_s: float) -> None:
        """Sleep for so long, or until the next signal."""
        select.select([self._ear], [], [], max(timeout_s, 0.0))
        with suppress(BlockingIOError):
            self._ear.recv(4096)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._before_fd)
        self._ear.close()
        self._mouth.close()

    def _count(self, _number: int, _frame: FrameType | None) -> None:
        self.stops += 1


def _wanted(number: signal.Signals) -> bool:
    # Whoever runs this under nohup wants it to outlive the terminal.
    return not (number == signal.SIGHUP and signal.getsignal(number) == signal.SIG_IGN)


def _only_wake(_number: int, _frame: FrameType | None) -> None:
    pass
