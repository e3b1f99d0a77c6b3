"""What a fit warns of: the dark signal, agreement between frames and scenes, scatter."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings import shared
from radiometry.frame.exposure import Exposure
from radiometry.frame.statistics import Signal
from radiometry.luminance import codes, maps
from radiometry.luminance import method as luminance
from radiometry.luminance.points import estimate_dark
from radiometry.luminance.presentation import explain_budget
from radiometry.luminance.rows import Params, Reading
from simulation.camera import change
from simulation.luminance import X5S
from tests.radiometry.campaigns import TRUE_K, draw
from tests.radiometry.coefficients import apply_coefficient
from tests.radiometry.luminance.exact import (
    DARK,
    DARKS,
    LIGHTS,
    PARAMS,
    READINGS,
    ROWS,
    SCENES,
    K,
    dark,
    fit,
    light,
    raised,
    statistics,
)


def signals(*values):
    levels = {"saturated_share": 0.0, "black_level_dn": 250.0, "white_level_dn": 4346.0}
    return [Signal(value_dn=value, standard_uncertainty_dn=0.1, **levels) for value in values]


def test_dark_is_the_median():
    found = estimate_dark(signals(256.0, 259.0, 257.0), [])
    assert found.signal_dn == 257.0
    spread = np.var([256, 259, 257], ddof=1)
    assert found.standard_uncertainty_dn == pytest.approx(math.sqrt(math.pi / 2 * spread / 3))
    assert found.frame_spread_dn == pytest.approx(math.sqrt(spread - 0.01))
    assert found.dof == 2


def test_quiet_dark_frames_are_not_better_than_their_noise():
    found = estimate_dark(signals(256.0, 256.0), [])
    assert found.standard_uncertainty_dn == pytest.approx(0.1 / math.sqrt(2))
    assert found.frame_spread_dn == 0.0


def test_without_dark_frames_the_black_level_stands_in():
    found = estimate_dark([], signals(900.0, 800.0))
    assert (found.signal_dn, found.standard_uncertainty_dn) == (250.0, 1.0)


@pytest.mark.parametrize(
    ("rows", "readings", "params", "flag", "where"),
    [
        (LIGHTS, READINGS, PARAMS, shared.DARK_FROM_BLACK_LEVEL, "iso 3200"),
        ((*LIGHTS, DARKS[0]), READINGS, PARAMS, codes.DARK_FROM_FEW_FRAMES, "iso 3200"),
        ((*LIGHTS, *DARKS[:4]), READINGS, PARAMS, shared.DARK_EXPOSURE_DIFFERS, "iso 3200"),
        ((*ROWS, dark("warm", mean_dn=DARK + 20)), READINGS, PARAMS, codes.DARK_VARIES, "iso 3200"),
        ((*ROWS, dark("lit", mean_dn=DARK + 20)), READINGS, PARAMS, shared.DARK_NOT_DARK, "iso 3200"),
        ((*ROWS[1:], replace(LIGHTS[0], rendered=True)), READINGS, PARAMS, shared.RENDERED, "iso 3200"),
        (
            (*ROWS[1:], replace(LIGHTS[0], gain_maps=("ab",))),
            READINGS,
            PARAMS,
            codes.GAIN_MAPS_DIFFER,
            "iso 3200",
        ),
        ((*LIGHTS[::3], *LIGHTS[1:3], *DARKS), READINGS, PARAMS, shared.FEW_POINTS, "iso 3200"),
        (ROWS, READINGS, Params(), codes.METER_REPEATABILITY_ESTIMATED, "iso 3200"),
        (
            ROWS,
            [replace(READINGS[0], expanded_uncertainty_rel=None), *READINGS[1:]],
            PARAMS,
            codes.METER_CERTIFICATE_MISSING,
            "",
        ),
        (ROWS, READINGS, replace(PARAMS, exposure_basis="apex"), codes.APEX_MISSING, "iso 3200"),
        (
            ROWS,
            (*READINGS, *(Reading(scene="dim", quantity="illuminance", value=v) for v in (10.0, 10.21))),
            PARAMS,
            codes.LAMP_DRIFT,
            "scene dim",
        ),
        (
            [replace(row, taken_at="2026-03-02T10:00:00+00:00") for row in ROWS],
            (replace(READINGS[0], taken_at="2026-03-02T12:00:00+00:00"), *READINGS[1:]),
            PARAMS,
            codes.READING_FAR_FROM_FRAMES,
            f"scene {READINGS[0].scene}",
        ),
        (
            ROWS,
            (*READINGS, Reading(scene="dim", quantity="illuminance", value=0.5 * math.pi / 0.8 * 10.764)),
            replace(PARAMS, panel_rho=0.8),
            codes.RHO_CROSS_CHECK,
            "scene dim",
        ),
    ],
)
def test_a_flag_says_where(rows, readings, params, flag, where):
    assert raised(fit(rows, readings, params), flag) == [where]
    assert raised(fit(), flag) == []


def test_agreement_raises_no_flag():
    readings = (*READINGS, *(Reading(scene="dim", quantity="illuminance", value=v) for v in (1.95, 1.98)))
    result = fit(readings=readings, params=replace(PARAMS, panel_rho=0.8))
    assert result.flags == ()
    dim = next(s for s in result.scenes if s.scene == "dim")
    assert dim.rho_e_pi_cd_m2 == pytest.approx(0.8 * 1.965 / math.pi)


@pytest.mark.parametrize(("exponent", "flagged"), [(1.03, True), (0.97, True), (1.01, False)])
def test_a_bent_response_is_flagged(exponent, flagged):
    rows = [
        replace(row, statistics=statistics(DARK + (row.statistics[0].mean_dn - DARK) ** exponent))
        for row in LIGHTS
    ]
    assert raised(fit((*rows, *DARKS)), codes.NONLINEAR) == (["iso 3200"] if flagged else [])


@pytest.mark.parametrize(
    ("factor", "flagged"), [(4.5, True), (3.5, False), (1 / 3.5, False), (1 / 4.5, True)]
)
def test_an_implausible_k_is_flagged(factor, flagged):
    """Expected here: (4095 - 256) / 120 = 32; readings in foot-lamberts would be off by 3.4."""
    readings = [replace(r, value=r.value * K / 32.0 / factor) for r in READINGS]
    assert raised(fit(readings=readings), codes.IMPLAUSIBLE_K) == (["iso 3200"] if flagged else [])


def test_scatter_beyond_the_claims_is_flagged():
    rows = [light(s, f, k=K * (1 + (-1) ** n * 0.1)) for s in SCENES for n, f in enumerate((5.6, 8.0, 16.0))]
    result = fit((*rows, *DARKS), params=replace(PARAMS, f_number_u_rel=0.001))
    assert raised(result, shared.SCATTER_EXCEEDS_UNCERTAINTY) == ["iso 3200"]
    (iso_fit,) = result.iso_fits
    scatter = iso_fit.models[0].frame_scatter_rel
    assert scatter == pytest.approx(np.std(np.log([1.1, 0.9, 1.1] * 3), ddof=1), rel=0.02)
    assert iso_fit.birge_ratio == pytest.approx(1.0, abs=0.01)
    assert iso_fit.models[0].stated_chi_squared > 100
    (line,) = (line for line in explain_budget(iso_fit) if line.source == "scatter between frames")
    assert (line.kind, line.input_uncertainty) == ("A", scatter)
    assert line.sensitivity == pytest.approx(1 / 3, rel=0.01)


def test_scatter_that_chance_explains_is_not_flagged():
    """Frames of 0.2 DN noise in 20 DN and more: a tenth of a per mille is within."""
    rows = [
        light(s, f, k=K * (1 + (-1) ** (n + m) * 1e-4))
        for m, s in enumerate(SCENES)
        for n, f in enumerate((5.6, 8.0, 16.0))
    ]
    result = fit((*rows, *DARKS))
    assert raised(result, shared.SCATTER_EXCEEDS_UNCERTAINTY) == []
    assert "scatter between frames" not in {entry.source for entry in result.iso_fits[0].budget}


def test_an_offset_is_flagged_with_its_size(drawn):
    """Stray light of 40 DN in every light frame of ISO 3200; the weakest has some 80 DN above dark."""
    lit = [
        replace(row, statistics=tuple(replace(s, mean_dn=s.mean_dn + 40.0) for s in row.statistics))
        if row.role == "light" and row.exposure.iso == 3200.0
        else row
        for row in drawn.rows
    ]
    result = fit(lit, drawn.readings, Params())
    (found,) = [each for each in result.flags if each.flag == codes.OFFSET_SIGNIFICANT]
    assert found.where == "iso 3200"
    offset = float(re.match(r"Offset \+([\d.]+) DN, standard uncertainty", found.detail)[1])
    weakest = result.iso_fits[0].coefficient.signal_range_dn[0]
    assert offset == pytest.approx(40.0, rel=0.1)
    assert f"{offset / weakest:.0%} of the weakest point" in found.detail


def test_scatter_that_no_meter_has_is_named():
    """Readings of six coloured patches that differ by 27 %: not "usual"."""
    random = np.random.default_rng(1)
    rows = [light(s, f, name=f"{s}{n}-{f}") for n in range(2) for s in SCENES for f in (5.6,)]
    rows = [replace(row, scene=row.frame.partition("-")[0]) for row in rows]
    readings = [
        replace(r, scene=f"{r.scene}{n}", value=r.value * math.exp(random.normal(0, 0.27)))
        for n in range(2)
        for r in READINGS
    ]
    result = fit((*rows, *DARKS), readings, Params())
    assert raised(result, shared.SCATTER_IMPLAUSIBLE) == ["iso 3200"]
    assert raised(result, codes.METER_REPEATABILITY_ESTIMATED) == []


# --- The dark signal against exposure time: from dark frames, from light frames, and as a doubt


TIMES = (0.01, 0.01, 0.01, 0.1, 0.1, 0.1)


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


def test_growth_is_subtracted_at_the_time_of_each_frame():
    """Light at 0.01, 0.1 and 1 s above a dark signal that grows by 200 DN/s; so does a field frame's."""
    grown = [
        replace(row, statistics=statistics(row.statistics[0].mean_dn + 200 * row.exposure.exposure_time_s))
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
    trusted = fit(one_time, params=replace(PARAMS, dark_rate_u_rel=0.0))
    assert "dark current" not in {line.source for line in trusted.iso_fits[0].budget}
    # light frames of the dark frames' time do not show it: 0.002 /s of 3839 DN at ISO 3200 remain
    alike = [light(scene, f, time_s=0.1) for scene in SCENES for f in (8.0, 16.0)]
    doubted = fit((*alike, *one_time[len(LIGHTS) :])).iso_fits[0].coefficient
    u_at = [doubted.at(time_s).dark_signal_standard_uncertainty_dn for time_s in (0.1, 1.1)]
    assert u_at == pytest.approx(
        [trusted.iso_fits[0].coefficient.dark_signal_standard_uncertainty_dn, 245.7], rel=1e-4
    )


@pytest.mark.parametrize("dark_times_s", [None, (1 / 125,)], ids=["both", "shortest"])
def test_dark_current_does_not_bias_k(dark_times_s):
    """Dark current alone moves K by less than a fifth of its uncertainty: +57 % before."""
    results = []
    for rate in (0.0, 400.0):
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


def test_missing_black_level_is_flagged():
    rows = tuple(replace(row, assumes_black=row.scene == "dim") for row in ROWS)
    (flag,) = [each for each in fit(rows).flags if each.flag == "black_level_assumed"]
    assert flag.detail == "Frames without a black level: 3 of 9; 0 DN is used for plausibility alone."
    assert raised(fit((*LIGHTS, *ROWS[9:])), "black_level_assumed") == []
    bare = fit((light("dim", 4.0, assumes_black=True), *LIGHTS))
    assert "as the dark signal" in next(f.detail for f in bare.flags if f.flag == "black_level_assumed")


def test_darks_around_the_light_times_are_not_flagged():
    rows = (*LIGHTS, *(dark(f"d{t}-{n}", time_s=t) for t in (0.01, 1.0) for n in range(2)))
    assert raised(fit(rows), "dark_exposure_differs") == []
