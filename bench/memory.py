"""How much memory a way takes: it is alone in a fresh process, and the kernel keeps each process's peak."""

import multiprocessing
import os
import re
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

Opened = AbstractContextManager[tuple[Callable[[], object], Sequence[int]]]
"""A way made ready, and the processes beside this one that work for it."""


@dataclass(frozen=True, kw_only=True)
class Growth:
    """Memory of all its processes: before the work, and at most more during it [MB]."""

    before_mb: float
    more_mb: float

    def __str__(self) -> str:
        return f"{self.before_mb:.0f} MB before, at most {self.more_mb:.1f} MB more"


def measure_growth(open_way: Callable[[], Opened]) -> Growth:
    """``open_way`` can be pickled."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn) as alone:
        return alone.submit(_work_and_look, open_way).result()


def _work_and_look(open_way: Callable[[], Opened]) -> Growth:
    with open_way() as (work, others):
        pids = [os.getpid(), *others]
        before_mb = sum(read_memory_mb(pid, "VmRSS") for pid in pids)
        for pid in pids:
            forget_peak(pid)
        work()
        most_mb = sum(read_memory_mb(pid, "VmHWM") for pid in pids)
    return Growth(before_mb=before_mb, more_mb=most_mb - before_mb)


def read_memory_mb(pid: int, name: str) -> float:
    """`VmRSS`: now; `VmHWM`: at most since it was last reset."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    found = re.search(rf"^{name}:\s+(\d+) kB", status, re.MULTILINE)
    return int(found[1]) * 1024 / 1e6 if found else float("nan")


def read_shared_mb(pid: int) -> float:
    """Return the memory of a process; a page that n processes share counts as 1 / n."""
    rolled = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii")
    found = re.search(r"^Pss:\s+(\d+) kB", rolled, re.MULTILINE)
    return int(found[1]) * 1024 / 1e6 if found else float("nan")


def list_tree(pid: int) -> list[int]:
    """Return a process and all that descend from it."""
    found = [pid]
    for each in found:
        for children in Path(f"/proc/{each}/task").glob("*/children"):
            found += map(int, children.read_text(encoding="ascii").split())
    return found


def read_cpu_s(pid: int) -> float:
    """Return the CPU time that a process has used; /proc counts it in hundredths of a second."""
    scheduled = 2
    return time.clock_gettime(~pid << 3 | scheduled)


def forget_peak(pid: int) -> None:
    """Reset the peak to what is used now."""
    Path(f"/proc/{pid}/clear_refs").write_text("5", encoding="ascii")
