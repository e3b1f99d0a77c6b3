"""Copies of remote blobs on the local disk, of bounded size, for readers that need a real file."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


class Cache:
    """A folder of files named by their hash; a file in use is never evicted, whichever process uses it."""

    def __init__(self, folder: Path, limit_bytes: int) -> None:
        self._folder = folder
        self._limit_bytes = limit_bytes

    @contextmanager
    def held(self, name: str) -> Iterator[Path | None]:
        """Return the file and keep it from eviction while the context lasts; None if it is not here."""
        path = self._folder / name
        try:
            fd = os.open(path, os.O_RDONLY)
        except FileNotFoundError:
            yield None
            return
        try:
            # A lock, unlike a counter, goes away with a killed process.
            fcntl.flock(fd, fcntl.LOCK_SH)
            evicted = os.fstat(fd).st_nlink == 0
            if not evicted:
                os.utime(path)
            yield None if evicted else path
        finally:
            os.close(fd)

    def add(self, name: str, file: Path) -> None:
        """Take over a finished file of the same filesystem."""
        self._folder.mkdir(parents=True, exist_ok=True)
        file.replace(self._folder / name)

    def evict(self) -> None:
        """Remove the files that were not used for longest until the rest fits, leaving those in use."""
        entries = []
        for entry in os.scandir(self._folder):
            with suppress(FileNotFoundError):
                if entry.is_file():
                    entries.append((entry.stat().st_mtime, entry.stat().st_size, entry.path))
        total = sum(size for _, size, _ in entries)
        for _, size, path in sorted(entries):
            if total <= self._limit_bytes:
                return
            if _removed_unless_held(path):
                total -= size


def _removed_unless_held(path: str) -> bool:
    try:
        fd = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return True
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.unlink(path)  # noqa: PTH108 (a path from scandir)
    except BlockingIOError:
        return False
    except FileNotFoundError:
        return True
    finally:
        os.close(fd)
    return True
