"""Following a folder that files are being copied into."""

from collections.abc import Callable
from pathlib import Path

from stilb.field.files import FieldFile

Stamp = tuple[int, int]


class Watch:
    """Files of a folder, each once: when two scans in a row have found it with the same size and time.

    Asking again and again needs nothing of the system, and works on cards, sticks and network folders alike.
    """

    def __init__(self, list_files: Callable[[], list[FieldFile]]) -> None:
        self._list_files = list_files
        self._seen: dict[Path, Stamp] = {}
        self._given: dict[Path, Stamp] = {}

    def look(self) -> list[FieldFile]:
        """The files that have settled since; a file that changes later is given again."""
        now = {file.path: (file, _stamp(file.path)) for file in self._list_files()}
        settled = [
            file
            for path, (file, stamp) in now.items()
            if stamp is not None and self._seen.get(path) == stamp and self._given.get(path) != stamp
        ]
        self._seen = {path: stamp for path, (_, stamp) in now.items() if stamp is not None}
        self._given |= {file.path: self._seen[file.path] for file in settled}
        return settled

    def take_back(self, files: list[FieldFile]) -> None:
        """Return these files to the queue, because they could not be sent."""
        for file in files:
            self._given.pop(file.path, None)


def _stamp(path: Path) -> Stamp | None:
    """None where the card has just been pulled out."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_size, found.st_mtime_ns
