"""Looking at other processes through /proc."""

import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

from tests.support.waiting import wait_for


def alive(pids: Iterable[int]) -> set[int]:
    """Those that still run; one that ended and waits to be reaped does not."""
    return {pid for pid in pids if _state(pid) not in {"", "Z", "X"}}


def family(pid: int) -> set[int]:
    """A process and all who descend from it."""
    parents = {int(path.name): _parent(int(path.name)) for path in Path("/proc").glob("[0-9]*")}
    found = {pid}
    while more := {child for child, parent in parents.items() if parent in found} - found:
        found |= more
    return found


def children(pid: int) -> set[int]:
    """Those that a process has started itself and that still run."""
    return alive(int(path.name) for path in Path("/proc").glob("[0-9]*") if _parent(int(path.name)) == pid)


def command(pid: int) -> list[str]:
    """The words of a process's command; none where it is gone."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_text().split("\0")[:-1]
    except OSError:
        return []


def marked(entry: str) -> set[int]:
    """Every living process with this `NAME=value` in the environment that it was started with."""
    found = set()
    for path in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if entry.encode() in (path / "environ").read_bytes().split(b"\0"):
                found.add(int(path.name))
    return alive(found - {os.getpid()})


def wait_until(condition: Callable[[], object], what: str = "", *, timeout_s: float = 15.0) -> None:
    """Wait for something that takes no more than a moment."""
    wait_for(condition, what, timeout_s=timeout_s)


def _stat(pid: int) -> list[str]:
    try:
        # The name, in brackets, may itself hold blanks and brackets.
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def _state(pid: int) -> str:
    return (_stat(pid) or [""])[0]


def _parent(pid: int) -> int:
    return int((_stat(pid) or ["", "0"])[1])
