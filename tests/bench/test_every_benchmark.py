"""The benchmarks run, at a size where their figures mean nothing."""

import os
import sys
import tempfile
from contextlib import nullcontext
from pathlib import Path

import pytest

from bench import workers
from bench.__main__ import main
from bench.harness import Scale
from tests.support.processes import alive, family

TINY = Scale(
    rows=480,
    cols=640,
    rounds=2,
    uploads=2,
    grown=20,
    jobs=200,
    coefficients=(100, 200),
    lookups=20,
    starts=1,
    rests_s=0.1,
    workers=2,
    job_s=0.01,
    card=20,
    restarts=1,
)


@pytest.fixture
def short_folder():
    """Return a folder whose sockets have short paths (107 bytes), and that a server's own user may enter."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o711)
        yield Path(folder)


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_every_benchmark_runs_and_leaves_nothing_behind(short_folder, monkeypatch, capfd):
    monkeypatch.setattr(tempfile, "tempdir", str(short_folder))
    # whole services start in other tests
    monkeypatch.setattr(workers, "up", lambda _: nullcontext(os.getpid()))
    before = family(1)
    assert main(TINY) == 0
    told = capfd.readouterr().out
    targets = 40
    assert told.count("target:") == targets
    assert f"{targets} targets, " in told
    assert list(short_folder.iterdir()) == []
    assert [pid for pid in alive(family(1)) - before if "stilb_bench" in _environment(pid)] == []


def _environment(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/environ").read_text(errors="replace")
    except OSError:
        return ""
