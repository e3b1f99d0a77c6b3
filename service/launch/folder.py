"""The data folder belongs to one launcher and its children at a time."""

import fcntl
import os
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from service.launch.refusal import Exit, Refusal

REMAINS_S = 10.0
"""How long the children of a killed launcher may take to go; the kernel kills them at once."""


_OURS = ("lock", "session-secret", "stilb.sqlite")


def close_to_others(data: Path, report: Callable[[str], None]) -> None:
    """Make the data folder, or take everybody else's rights away: it holds keys and customers' files."""
    data.mkdir(parents=True, mode=0o700, exist_ok=True)
    mode = stat.S_IMODE(data.stat().st_mode)
    if not mode & 0o077:
        return
    # somebody may have named a folder that holds other things, which others may need
    is_ours = not any(data.iterdir()) or any((data / name).exists() for name in _OURS)
    if is_ours and data.stat().st_uid == os.geteuid() and not mode & stat.S_ISVTX:
        data.chmod(0o700)
        report(f"the data folder {data} was open to other users (mode {mode:o}); it is now 700")
    else:
        advice = "name a folder of its own, or chmod 700"
        report(f"the data folder {data} is open to other users (mode {mode:o}): {advice}")


@contextmanager
def claimed(data: Path, report: Callable[[str], None]) -> Iterator[int]:
    """Lock the folder; yield the lock's descriptor, which every child inherits.

    With the children holding it too, the lock is free only when nothing of an earlier run is left that could
    still write here.
    """
    try:
        close_to_others(data, report)
        lock = os.open(data / "lock", os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise Refusal(f"the data folder {data} cannot be written: {error.strerror}") from error
    try:
        _take(lock, data)
        _write_pid(lock, data)
        yield lock
    finally:
        os.close(lock)


def _take(lock: int, data: Path) -> None:
    deadline = time.monotonic() + REMAINS_S
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(lock, 20, 0).decode("ascii", "replace").strip()
            # A holder that is gone was killed, and its children are just going.
            if _lives(holder) or time.monotonic() > deadline:
                message = f"stilb already runs on {data}, as process {holder or 'unknown'}"
                raise Refusal(message, Exit.ALREADY_RUNS) from None
            time.sleep(0.05)
        else:
            return


def _write_pid(lock: int, data: Path) -> None:
    try:
        os.ftruncate(lock, 0)
        os.pwrite(lock, f"{os.getpid()}\n".encode(), 0)
    except OSError as error:
        raise Refusal(f"the data folder {data} cannot be written: {error.strerror}") from error


def _lives(pid: str) -> bool:
    if not pid.isdecimal():
        # The holder is about to write its number.
        return False
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
