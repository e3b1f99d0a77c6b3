"""The dark signal against exposure time: from dark frames, from light frames, and as a doubt."""

import dataclasses
import math

import pytest

from radiometry.frame.exposure import Exposure
from radiometry.frame.statistics import Signal
from radiometry.luminance import codes, maps
from radiometry.luminance import method as luminance
from radiometry.luminance.points import estimate_dark
from radiometry.luminance.rows import Params
from simulation.camera import change
from simulation.luminance import X5S
from tests.radiometry.campaigns import TRUE_K, draw
from tests.radiometry.coefficients import apply_coefficient
from tests.radiometry.luminance.exact import (
    DARK,
    LIGHTS,
    PARAMS,
    ROWS,
    SCENES,
    dark,
    fit,
    light,
    raised,
    statistics,
)

TIMES = (0.01, 0.01, 0.01, 0.1, 0.1, 0.1)


def signals(*values):
    return [
        Signal(
            value_dn=v,
            standard_uncertainty_dn=0.1,
            saturated_share=0.0,
            black_level_dn=250,
            white_level_dn=4346,
        )
        for v in values
    ]


def test_line_by_hand():
    found = estimate_dark(signals(257, 256, 258, 266, 267, 265), [], times_s=TIMES)
    assert found.rate_measured
    assert found.rate_dn_per_s == pytest.approx(100.0)
    assert (found.time_s, found.signal_dn) == pytest.approx((0.055, 261.5))
    # residuals -1, 0, 1 twice, two parameters
    u = math.sqrt(math.pi / 2 * (4 / 4) / 6)
    assert (found.standard_uncertainty_dn, found.dof) == (pytest.approx(u), 4)
    assert found.rate_u_dn_per_s == pytest.approx(u / 0.045)
    later = found.at(0.1)
    assert later.signal_dn == pytest.approx(266.0)
    assert later.standard_uncertainty_dn == pytest.approx(math.hypot(u, u))


def test_one_lit_frame_does_not_move_the_line():
    found = estimate_dark(signals(257, 256, 258, 266, 999, 265), [], times_s=TIMES)
    assert found.rate_dn_per_s == pytest.approx(100.0)
    assert found.at(0.01).signal_dn == pytest.approx(257.0)


def test_one_time_leaves_the_rate_to_its_plausible_size():
    for times in (TIMES[:3], (0.1, 0.1, 0.101)):
        found = estimate_dark(signals(257, 256, 258), [], times_s=times, plausible_rate_dn_per_s=50.0)
        assert (found.rate_dn_per_s, found.rate_u_dn_per_s, found.rate_measured) == (0.0, 50.0, False)
        # whether a signal is seen does not depend on what was assumed
        assert found.at(1.0).standard_uncertainty_dn == found.standard_uncertainty_dn


def test_growth_is_subtracted_at_the_time_of_each_frame():
    """Light at 0.01, 0.1 and 1 s above a dark signal that grows by 200 DN/s; so does a field frame's."""
    grown = [
        dataclasses.replace(
            row, statistics=statistics(row.statistics[0].mean_dn + 200 * row.exposure.exposure_time_s)
        )
        for row in ROWS
    ]
    result = fit(grown)
    coefficient = result.iso_fits[0].coefficient
    assert coefficient.luminance_k == pytest.approx(fit().iso_fits[0].coefficient.luminance_k, rel=1e-9)
    assert coefficient.dark_rate_dn_per_s == pytest.approx(200.0)
    assert {p.exposure_time_s: round(p.dark_signal_dn, 6) for p in result.points} == {
        0.01: DARK + 2, 0.1: DARK + 20, 1.0: DARK + 200
    }  # fmt: skip
    exposure = Exposure(exposure_time_s=0.5, f_number=8.0, iso=3200.0)
    applied = apply_coefficient(statistics(DARK + 400), exposure=exposure, coefficients=[coefficient])
    assert applied.luminance_cd_m2.value == pytest.approx(300 * 64 / (30 * 0.5 * 3200))
    assert maps.find_map_scale((coefficient,), exposure).dark_signal_dn == pytest.approx(DARK + 100)


def test_growth_that_was_not_measured_is_a_line_of_the_budget():
    one_time = (*LIGHTS, *(dark(f"d{n}", time_s=0.1) for n in range(3)))
    budget = {line.source: line.u_rel for line in fit(one_time).iso_fits[0].budget}
    assert budget["dark current"] > 0.0
    trusted = fit(one_time, params=dataclasses.replace(PARAMS, dark_rate_u_rel=0.0))
    assert "dark current" not in {line.source for line in trusted.iso_fits[0].budget}
    # light frames of the dark frames' time do not show it: 0.002 /s of 3839 DN at ISO 3200 remain
    alike = [light(scene, f, time_s=0.1) for scene in SCENES for f in (8.0, 16.0)]
    doubted = fit((*alike, *one_time[len(LIGHTS) :])).iso_fits[0].coefficient
    u_at = [doubted.at(time_s).dark_signal_standard_uncertainty_dn for time_s in (0.1, 1.1)]
    assert u_at == pytest.approx(
        [trusted.iso_fits[0].coefficient.dark_signal_standard_uncertainty_dn, 245.7], rel=1e-4
    )


@pytest.mark.parametrize("dark_times_s", [None, (1 / 125,), (1 / 8,)], ids=["both", "shortest", "longest"])
@pytest.mark.parametrize("rate_e_s", [40.0, 400.0])
def test_dark_current_does_not_bias_k(rate_e_s, dark_times_s):
    """Dark current alone moves K by less than a fifth of its uncertainty: +7 and +57 % before."""
    results = []
    for rate in (0.0, rate_e_s):
        drawn = draw(3, camera=change(X5S, dark_current_e_s=rate), dark_times_s=dark_times_s)
        results.append(luminance.fit(drawn.rows, drawn.readings, Params()))
    without, with_current = (result.iso_fits[0].coefficient for result in results)
    assert (
        abs(with_current.luminance_k - without.luminance_k) < 0.2 * without.luminance_k_standard_uncertainty
    )
    assert abs(with_current.luminance_k - TRUE_K) < with_current.expanded_uncertainty
    assert with_current.expanded_uncertainty < 1.1 * without.expanded_uncertainty
    flagged = raised(results[1], codes.OFFSET_SIGNIFICANT)
    assert flagged == ([] if dark_times_s is None else ["iso 3200"])


def test_darks_around_the_light_times_are_not_flagged():
    rows = (*LIGHTS, *(dark(f"d{t}-{n}", time_s=t) for t in (0.01, 1.0) for n in range(2)))
    assert raised(fit(rows), "dark_exposure_differs") == []
    alone = (*LIGHTS, *(dark(f"d{n}", time_s=0.01) for n in range(3)))
    assert raised(fit(alone), "dark_exposure_differs") == ["iso 3200"]


def test_missing_black_level_is_flagged():
    rows = tuple(dataclasses.replace(row, assumes_black=row.scene == "dim") for row in ROWS)
    (flag,) = [each for each in fit(rows).flags if each.flag == "black_level_assumed"]
    assert flag.detail == "Frames without a black level: 3 of 9; 0 DN is used for plausibility alone."
    assert raised(fit((*LIGHTS, *ROWS[9:])), "black_level_assumed") == []
    bare = fit((light("dim", 4.0, assumes_black=True), *LIGHTS))
    assert "as the dark signal" in next(f.detail for f in bare.flags if f.flag == "black_level_assumed")
