"""The benchmarks run, at a size where their figures mean nothing; the arithmetic is right at any."""

import os
import sys
import tempfile
from contextlib import nullcontext
from pathlib import Path

import pytest

from bench import imagej, pages, scrolling, start, timing
from bench.__main__ import main
from bench.report import judge, judge_seconds, summarise
from bench.subject import ROI_SHARE, Scale, draw_roi
from radiometry.frame.roi import bounding_window, mask
from tests.support.processes import alive, family

TINY = Scale(
    rows=480,
    cols=640,
    rounds=2,
    uploads=2,
    frames=30,
    grown=20,
    certificates=1,
    coefficients=200,
    measurements=20,
    lookups=20,
    starts=1,
    rests_s=0.1,
    workers=2,
    rounds_of_jobs=2,
    jobs_each=1,
    job_s=0.01,
    jobs=200,
    waiting_jobs=100,
    waits_s=0.2,
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
    monkeypatch.setattr(imagej, "find_imagej", lambda: None)
    # a page of a large campaign is opened by another; this one scrolls for seconds, over a slow line too
    monkeypatch.setattr(scrolling, "run", lambda *_: [])
    # whole services start in other tests
    monkeypatch.setattr(start, "_up", lambda _: nullcontext(os.getpid()))
    before = family(1)
    assert main(TINY) == 0
    told = capfd.readouterr().out
    targets = (15 if pages.find_chromium() is None else 16) + 37
    assert told.count("target:") == targets
    assert f"{targets} targets, " in told
    assert "MB more over" in told
    assert told.count("MB before, at most") == 3
    assert list(short_folder.iterdir()) == []
    assert [pid for pid in alive(family(1)) - before if "stilb_bench" in _environment(pid)] == []


def _environment(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/environ").read_text(errors="replace")
    except OSError:
        return ""


def test_the_region_is_a_twentieth_of_the_frame():
    scale = Scale()
    polygon = draw_roi(scale)
    window = bounding_window(polygon, height_px=scale.rows, width_px=scale.cols)
    share = mask(polygon, window).sum() / (scale.rows * scale.cols)
    assert share == pytest.approx(ROI_SHARE, rel=0.01)


def test_ways_take_turns_and_only_they_are_timed(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(timing.time, "perf_counter", lambda: clock[0])
    order = []

    def way(name, lasts_s):
        def run():
            order.append(name)
            clock[0] += lasts_s

        return run

    def prepare():
        clock[0] += 100.0

    ways = {"a": way("a", 2.0), "b": way("b", 1.0)}
    seconds = timing.take_turns(ways, rounds=3, warm_up=1, prepare=prepare)
    assert seconds == {"a": [2.0] * 3, "b": [1.0] * 3}
    assert "".join(order) == "ab" + "ab" + "ba" + "ab"
    assert timing.compare(seconds["a"], seconds["b"]).median == 2.0


def test_a_missed_target_is_named(capsys):
    ratio = timing.compare([3.0, 3.0], [1.0, 1.0])
    verdicts = [
        judge("x", ratio, at_least=4.0),
        judge("y", ratio, at_most=4.0),
        judge("z", ratio, at_least=3.0),
        judge_seconds("t", [9.0, 1.0, 1.0], at_most_s=1.0),
        judge_seconds("u", [0.1, 1.1, 1.1], at_most_s=1.0),
    ]
    assert verdicts == [False, True, True, True, False]
    assert capsys.readouterr().out.count("MISSED") == 2
    assert summarise(verdicts) == "5 targets, 2 MISSED"
