"""The data folder belongs to one launcher at a time; why the launcher does not start, or ends."""

import errno
import fcntl
import os
import stat
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from enum import IntEnum
from pathlib import Path

from store.pulse import is_running


class Exit(IntEnum):
    STOPPED = 0
    GAVE_UP = 1  # a part does not stay alive
    CANNOT_START = 2  # a setting, the data folder or the port is in the way
    NEWER_SCHEMA = 3  # the database was written by a newer stilb; the number that `store.migrate` answers
    ALREADY_RUNS = 4  # another launcher serves the same data folder


class Refusal(Exception):  # noqa: N818 (it says what was found)
    def __init__(self, message: str, code: Exit = Exit.CANNOT_START) -> None:
        super().__init__(message)
        self.code = code


def report(line: str) -> None:
    """Print one line for the terminal, or for the log of a container."""
    print(f"stilb: {line}", file=sys.stderr, flush=True)  # noqa: T201 (speaks to the terminal)


_FULL = {errno.ENOSPC, errno.EDQUOT}
_ROOM_BYTES = 1 << 20


def has_room(folder: Path) -> bool:
    """Return whether a megabyte can be written here, which a disk's own figures do not tell of a quota."""
    probe = folder / "room"
    try:
        fd = os.open(probe, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        try:
            written = os.write(fd, bytes(_ROOM_BYTES))
            os.fsync(fd)
        finally:
            os.close(fd)
    except OSError as error:
        return error.errno not in _FULL
    else:
        return written == _ROOM_BYTES
    finally:
        with suppress(OSError):
            probe.unlink()


REMAINS_S = 10.0  # how long the children of a killed launcher may take to go; the kernel kills them at once


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
    """Lock the folder; yield the lock, which every child inherits: it is free when none of them is left."""
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
            # no number yet: the holder is about to write it
            if (holder.isdecimal() and is_running(int(holder))) or time.monotonic() > deadline:
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
