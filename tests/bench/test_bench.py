"""The arithmetic of the benchmarks is right at any size."""

import pytest

from bench import harness
from bench.frames import ROI_SHARE, draw_roi
from bench.harness import Scale, judge, summarise
from radiometry.frame.roi import bounding_window, mask


def test_the_region_is_a_twentieth_of_the_frame():
    scale = Scale()
    polygon = draw_roi(scale)
    window = bounding_window(polygon, height_px=scale.rows, width_px=scale.cols)
    share = mask(polygon, window).sum() / (scale.rows * scale.cols)
    assert share == pytest.approx(ROI_SHARE, rel=0.01)


def test_ways_take_turns_and_only_they_are_timed(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(harness.time, "perf_counter", lambda: clock[0])
    order = []

    def way(name, lasts_s):
        def run():
            order.append(name)
            clock[0] += lasts_s

        return run

    def prepare():
        clock[0] += 100.0

    ways = {"a": way("a", 2.0), "b": way("b", 1.0)}
    seconds = harness.take_turns(ways, rounds=3, warm_up=1, prepare=prepare)
    assert seconds == {"a": [2.0] * 3, "b": [1.0] * 3}
    assert "".join(order) == "ab" + "ab" + "ba" + "ab"
    assert harness.compare(seconds["a"], seconds["b"]).median == 2.0


def test_a_missed_target_is_named(capsys):
    ratio = harness.compare([3.0, 3.0], [1.0, 1.0])
    verdicts = [
        judge("x", ratio, at_least=4.0),
        judge("y", ratio, at_most=4.0),
        judge("z", ratio, at_least=3.0),
        judge("t", 1.0, at_most=1.0),
        judge("u", 1.1, at_most=1.0),
    ]
    assert verdicts == [False, True, True, True, False]
    assert capsys.readouterr().out.count("MISSED") == 2
    assert summarise(verdicts) == "5 targets, 2 MISSED"
