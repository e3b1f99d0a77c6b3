"""Record of what this machine has read of a folder: a push that continues need not read a whole card again.

What has arrived is never taken from here: the service is asked. A line a file, appended as soon as it is
known; a line that a crash cut off is left out.
"""

import hashlib
import json
import os
from pathlib import Path


class Journal:
    """The hashes of a folder's files, each as long as size and time of the file stay."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[str, tuple[int, int, str]] = {}
        if path.exists():
            for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
                self._take(line)

    @classmethod
    def of(cls, folder: Path, journals: Path) -> "Journal":
        """The journal of a folder, kept among this user's own: a card may be write-protected."""
        name = hashlib.sha256(os.fsencode(folder.resolve())).hexdigest()[:16]
        return cls(journals / f"{name}.jsonl")

    def hash_of(self, path: Path) -> str:
        """The file's SHA-256. ``OSError`` where it cannot be read, or changes while it is."""
        before = _stamp(path)
        known = self._known.get(str(path))
        if known is not None and known[:2] == before:
            return known[2]
        with path.open("rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        if _stamp(path) != before:
            raise OSError(f"{path} is still being written: push again when it is complete")
        self._append(path, (*before, sha256))
        return sha256

    def _append(self, path: Path, entry: tuple[int, int, str]) -> None:
        self._known[str(path)] = entry
        self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with self._path.open("a", encoding="utf-8") as file:
            # The line break goes first: a line that a crash cut off then spoils no other.
            file.write("\n" + json.dumps([os.fsencode(path).hex(), *entry]))

    def _take(self, line: str) -> None:
        try:
            path, size, modified, sha256 = json.loads(line)
            self._known[str(Path(os.fsdecode(bytes.fromhex(path))))] = (int(size), int(modified), str(sha256))
        except (ValueError, TypeError):
            return


def _stamp(path: Path) -> tuple[int, int]:
    found = path.stat()
    return found.st_size, found.st_mtime_ns
