"""Outliers: what they cost by least squares and in a robust fit."""

import dataclasses

import numpy as np
import pytest

from radiometry.luminance import codes
from radiometry.luminance.rows import Params
from tests.radiometry.campaigns import TRUE_K, draw
from tests.radiometry.luminance.exact import fit, raised

PLAIN = Params(f_number_u_rel=0.015)
ROBUST = dataclasses.replace(PLAIN, estimator="robust")


def spoil(drawn, count, factor):
    """Return the rows, the signal of some light frames wrong by a factor."""
    light = [row for row in drawn.rows if row.role == "light"]
    chosen = {light[index].frame for index in range(2, len(light), len(light) // count)[:count]}
    rows = [
        dataclasses.replace(
            row,
            statistics=tuple(
                dataclasses.replace(s, mean_dn=256 + (s.mean_dn - 256) * factor) for s in row.statistics
            ),
        )
        if row.frame in chosen
        else row
        for row in drawn.rows
    ]
    return rows, chosen


@pytest.mark.parametrize(("count", "factor"), [(1, 0.5), (3, 0.5), (3, 1.3)])
def test_outliers_cost_least_squares_much_and_the_robust_fit_little(count, factor):
    drawn = draw(3)
    rows, chosen = spoil(drawn, count, factor)
    clean = fit(drawn.rows, drawn.readings, ROBUST).iso_fits[0].coefficient
    plain, robust = (fit(rows, drawn.readings, params) for params in (PLAIN, ROBUST))
    wide, narrow = (result.iso_fits[0].coefficient for result in (plain, robust))
    assert wide.expanded_uncertainty > 1.2 * clean.expanded_uncertainty
    assert narrow.expanded_uncertainty < 1.2 * clean.expanded_uncertainty
    assert narrow.luminance_k == pytest.approx(clean.luminance_k, rel=0.004)
    assert abs(narrow.luminance_k - TRUE_K) < narrow.expanded_uncertainty
    assert {p.frame for p in robust.points if p.robust_weight is not None and p.robust_weight < 0.1} == chosen
    assert raised(robust, codes.OUTLIERS_DISCOUNTED) == ["iso 3200"]
    assert raised(plain, codes.OUTLIERS_DISCOUNTED) == []


def test_without_outliers_nothing_is_lost():
    drawn = draw(3)
    plain, robust = (fit(drawn.rows, drawn.readings, params) for params in (PLAIN, ROBUST))
    assert robust.iso_fits == plain.iso_fits
    assert raised(robust, codes.OUTLIERS_DISCOUNTED) == []


def test_one_frame_per_scene():
    """Readings and frames cannot be told apart: the robust fit counts their scatter as the frames'."""
    random = np.random.default_rng(2)
    drawn = draw(3)
    first = {}
    for row in drawn.rows:
        if row.role == "light":
            first.setdefault(row.scene, row)
    scenes = [
        (dataclasses.replace(row, frame=f"{scene}-{n}", scene=f"{scene}-{n}"), scene)
        for scene, row in first.items()
        for n in range(4)
    ]
    readings = [
        dataclasses.replace(r, scene=row.scene, value=r.value * random.normal(1.0, 0.01))
        for row, scene in scenes
        for r in drawn.readings
        if r.scene == scene
    ]
    readings[7] = dataclasses.replace(readings[7], value=2.0 * readings[7].value)
    rows = [*(row for row, _ in scenes), *(row for row in drawn.rows if row.role == "dark")]
    plain, robust = (
        fit(rows, readings, dataclasses.replace(p, f_number_u_rel=0.0)).iso_fits[0].coefficient
        for p in (PLAIN, ROBUST)
    )
    assert robust.expanded_uncertainty < 0.6 * plain.expanded_uncertainty
