"""Start and rest of the whole tree that `make up` runs."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bench.memory import list_tree, read_cpu_s, read_shared_mb
from bench.report import judge, judge_seconds, say
from bench.subject import Scale
from bench.timing import Ratio

_SETTLES_S = 8.0


def run(scale: Scale) -> list[bool]:
    """Measure starts on data that exist, and the last of them at rest."""
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name:
        say("\nthe whole service at its start and at rest")
        seconds = []
        for number in range(scale.starts + 1):
            began = time.perf_counter()
            with _up(Path(name)) as pid:
                if number:
                    # the first makes the database
                    seconds.append(time.perf_counter() - began)
                if number == scale.starts:
                    percent, memory_mb = _rest(pid, scale)
    return [
        judge_seconds("`make up` on existing data, until ready", seconds, at_most_s=2.5),
        judge("CPU at rest, % of a core", Ratio(percent, percent, percent), at_most=0.5),
        judge("memory at rest, MB", Ratio(memory_mb, memory_mb, memory_mb), at_most=300.0),
    ]


def _rest(pid: int, scale: Scale) -> tuple[float, float]:
    """Return the CPU of all processes [%], and their memory with shared pages counted once [MB]."""
    time.sleep(min(_SETTLES_S, scale.rests_s))
    tree = list_tree(pid)
    before_s = sum(map(read_cpu_s, tree))
    time.sleep(scale.rests_s)
    percent = 100 * (sum(map(read_cpu_s, tree)) - before_s) / scale.rests_s
    return percent, sum(map(read_shared_mb, tree))


@contextmanager
def _up(data: Path) -> Iterator[int]:
    given = {name: value for name, value in os.environ.items() if not name.startswith("STILB_")}
    environment = given | {"STILB_DATA": str(data), "STILB_PORT": "0"}
    command = [sys.executable, "-m", "service.up"]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as launcher:
        try:
            if not (launcher.stdout and launcher.stdout.readline().startswith("ready")):
                raise RuntimeError("the service did not start")
            yield launcher.pid
        finally:
            launcher.terminate()
