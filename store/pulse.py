"""The pulse of a process: a file whose time of change is the last beat, on the machine's steady clock.

`python -m store.pulse` checks it. It imports next to nothing, since a health check starts it again and again.
"""

import fcntl
import os
import signal
import struct
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

DATABASE_TIMEOUT_S: Final = 30.0
SILENCES: Final = 2  # a process hangs without progress for so many times what it may wait for the database
_PULSE: Final = "STILB_PULSE"
UNHEALTHY_EXIT = 1
_ANSWER_WITHIN_S = 4.0
_LOOK_AGAIN_S = 6.0  # longer than any part takes from one beat to the next


class Pulse:
    """Beats into a file that whoever watches names, or nowhere; never fails: that must end nobody."""

    def __init__(self, path: str | None = None) -> None:
        self._path = path = os.environ.get(_PULSE, "") if path is None else path
        if path:
            with suppress(OSError):
                Path(path).write_text(f"{os.getpid()}\n", encoding="ascii")
        self.beat()

    def beat(self) -> None:
        """Note that the work goes on; call it from the loop that does the work."""
        if self._path:
            now_ns = time.monotonic_ns()
            with suppress(OSError):
                os.utime(self._path, ns=(now_ns, now_ns))


def read_beat(path: Path) -> int | None:
    """Return when the pulse last beat, on the machine's steady clock [ns]; None where there is no file."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return None


def is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def find_silence_s() -> float:
    """Return for how long the pulse of this process has not beaten; 0 where nobody watches it."""
    beat_ns = read_beat(Path(pulse)) if (pulse := os.environ.get(_PULSE)) else None
    return (time.monotonic_ns() - beat_ns) / 1e9 if beat_ns else 0.0


def end_hung(path: Path, *, hang_s: float, look_again_s: float = _LOOK_AGAIN_S) -> bool:
    """Kill the process behind a pulse that has not beaten for too long; whether it was so."""
    if (before := read_beat(path)) is None or (time.monotonic_ns() - before) / 1e9 <= hang_s:
        return False
    time.sleep(look_again_s)
    if read_beat(path) != before:
        return False
    with suppress(OSError, ValueError):
        os.kill(int(path.read_text(encoding="ascii")), signal.SIGKILL)
    return True


def _read(name: str) -> str:
    """Return a setting, also where a file states it; `store.settings` takes longer than all the rest."""
    path = os.environ.get(f"{name}_FILE")
    return Path(path).read_text(encoding="utf-8").strip() if path else os.environ.get(name, "")


def main() -> int:
    """Check the process behind STILB_PULSE, and the address if one is given; one that hangs is killed."""
    pulse = os.environ.get(_PULSE)
    hang_s = SILENCES * float(_read("STILB_DATABASE_TIMEOUT_S") or DATABASE_TIMEOUT_S)
    if not pulse or end_hung(Path(pulse), hang_s=hang_s):
        return UNHEALTHY_EXIT
    if sys.argv[1:]:
        from urllib.request import urlopen  # noqa: PLC0415  it takes longer than all the rest

        try:
            with urlopen(sys.argv[1], timeout=_ANSWER_WITHIN_S):  # noqa: S310  our own address
                pass
        except OSError:
            return UNHEALTHY_EXIT
    return 0


_LOCK: Final = "hhqqi4x"  # Linux's `struct flock`: type, whence, start, length, process
_WRITE_LOCK: Final = 120  # its byte in the file of shared memory, as the format of the write-ahead log says

_STOPPED: Final = ("T", "t")


def find_stopped_writer(url: str) -> int | None:
    """Return the process that was stopped amid a write, to one that never opens the database."""
    scheme, _, path = url.partition("?")[0].partition(":///")
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


if __name__ == "__main__":
    sys.exit(main())
