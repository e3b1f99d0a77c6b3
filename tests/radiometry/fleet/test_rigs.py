"""Sets of a rig's versions, and the stability of its orientation over them."""

from datetime import timedelta

import numpy as np
import pytest

from radiometry.fitting.evidence import Quantity
from radiometry.fleet.drift import RigVersion, compare_sets, group_sets
from tests.radiometry.fleet.fleets import START

DAYS = (0, 30, 60, 90)


def yaw(value):
    return {("R1", "yaw"): Quantity(value=value, standard_uncertainty=0.01, unit="deg")}


def compare(values, limits):
    sets = [(START + timedelta(days=day), yaw(value)) for day, value in zip(DAYS, values, strict=False)]
    (found,) = compare_sets(sets[::-1], limits=limits)
    return found


def test_repeatability_and_trend_by_hand():
    found = compare([11.00, 11.02, 10.99, 11.01], {"deg": 0.1})
    assert (found.camera, found.name, found.sets, found.verdict) == ("R1", "yaw", 4, "stable")
    assert found.mean.value == pytest.approx(11.005)
    spread = np.std([11.00, 11.02, 10.99, 11.01], ddof=1)
    assert found.repeatability.value == pytest.approx(spread)
    assert found.mean.standard_uncertainty == pytest.approx(spread / 2)
    slope = np.polyfit(DAYS, [11.00, 11.02, 10.99, 11.01], 1)[0]
    assert found.slope.value == pytest.approx(365.25 * slope)
    assert found.change.value == pytest.approx(90 * slope)
    assert (found.slope.unit, found.change.unit) == ("deg/a", "deg")


def test_a_mount_that_gives_way_drifts():
    found = compare([11.0, 11.2, 11.41, 11.6], {"deg": 0.1})
    assert found.verdict == "drifts"
    assert compare([11.0, 11.2], {"deg": 0.1}).verdict == "cannot_tell"
    one = compare([11.0], {})
    assert (one.repeatability, one.slope, one.change) == (None, None, None)


def test_versions_are_grouped_by_their_triggers_and_then_by_time():
    def version(name, day, triggers):
        return RigVersion(version=name, at=START + timedelta(days=day), member=frozenset(triggers))

    def count(first, second):
        return len(first & second)

    reference = [version("a1", 0, {1, 2, 3}), version("a2", 30, {1, 2, 3}), version("a3", 60, {9})]
    other = [version("b2", 31, {1, 2, 3}), version("b1", 1, {1, 2, 3}), version("b3", 2, {7})]
    sets, left_out = group_sets([reference, other], count)
    assert [[each.version for each in members] for members in sets] == [["a1", "b1"], ["a2", "b2"]]
    assert {each.version for each in left_out} == {"a3", "b3"}
