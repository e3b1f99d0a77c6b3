"""Start and rest of all that `make up` runs."""

import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bench import harness
from bench.harness import Scale, judge, say
from tests.support.processes import family


def run(scale: Scale) -> list[bool]:
    """Measure starts on data that exist, and the last of them at rest, shared pages counted once."""
    say("\nthe whole service at its start and at rest")
    seconds = []
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name:
        for number in range(scale.starts + 1):
            began = time.perf_counter()
            with up(Path(name)) as pid:
                seconds.append(time.perf_counter() - began)
                if number == scale.starts:
                    time.sleep(min(8.0, scale.rests_s))
                    tree = family(pid)
                    before_s = harness.read_cpu_s(*tree)
                    time.sleep(scale.rests_s)
                    percent = 100 * (harness.read_cpu_s(*tree) - before_s) / scale.rests_s
                    memory_mb = sum(map(harness.read_shared_mb, tree))
    start_s = sorted(seconds[1:])[scale.starts // 2]  # the first makes the database
    return [
        judge("`make up` on existing data, until ready [s]", start_s, at_most=2.5),
        judge("CPU at rest, % of a core", percent, at_most=0.5),
        judge("memory at rest, MB", memory_mb, at_most=320.0),
    ]


@contextmanager
def up(data: Path) -> Iterator[int]:
    environment = harness.make_environment(data) | {"STILB_PORT": "0"}
    with harness.running(["-m", "service.up"], environment, subprocess.PIPE) as launcher:
        if not (launcher.stdout and launcher.stdout.readline().startswith(b"ready")):
            raise RuntimeError("the service did not start")
        yield launcher.pid
