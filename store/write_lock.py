"""SQLite's write lock as a watch sees it: which process holds it, without asking the database."""

import fcntl
import os
import struct
import sys
from pathlib import Path
from typing import Final

_LOCK: Final = "hhqqi4x"
"""Linux's `struct flock`: type, whence, start, length, process."""
_WRITE_LOCK: Final = 120
"""Its byte in the file of shared memory, as the format of the write-ahead log says."""

_STOPPED: Final = ("T", "t")


def find_stopped_writer(url: str) -> int | None:
    """Return the process that was stopped amid a writing transaction; None for none or unknown.

    Only for a process that never opens the database: as it closes the file, its own locks on it would go.
    """
    scheme, _, path = url.partition(":///")
    if scheme != "sqlite" or sys.platform != "linux":
        return None
    try:
        with Path(f"{path}-shm").open("rb") as shared:
            asked = struct.pack(_LOCK, fcntl.F_WRLCK, os.SEEK_SET, _WRITE_LOCK, 1, 0)
            kind, _, _, _, pid = struct.unpack(_LOCK, fcntl.fcntl(shared, fcntl.F_GETLK, asked))
        if kind == fcntl.F_UNLCK:
            return None
        state = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0]
    except OSError:
        return None
    return int(pid) if state in _STOPPED else None
