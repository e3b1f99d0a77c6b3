"""What a fit warns of: the dark signal, agreement between frames and scenes, scatter."""

import dataclasses
import math
import re

import numpy as np
import pytest

from radiometry.findings import shared
from radiometry.frame.statistics import Signal
from radiometry.luminance import codes as luminance_codes
from radiometry.luminance.points import estimate_dark
from radiometry.luminance.presentation import explain_budget
from radiometry.luminance.rows import Params, Reading
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


def signal(value, u=0.1, black=250.0):
    return Signal(
        value_dn=value,
        standard_uncertainty_dn=u,
        saturated_share=0.0,
        black_level_dn=black,
        white_level_dn=4346.0,
    )


def test_dark_is_the_median():
    found = estimate_dark([signal(256.0), signal(259.0), signal(257.0)], [])
    assert found.signal_dn == 257.0
    spread = np.var([256, 259, 257], ddof=1)
    assert found.standard_uncertainty_dn == pytest.approx(math.sqrt(math.pi / 2 * spread / 3))
    assert found.frame_spread_dn == pytest.approx(math.sqrt(spread - 0.01))
    assert found.dof == 2


def test_quiet_dark_frames_are_not_better_than_their_noise():
    found = estimate_dark([signal(256.0), signal(256.0)], [])
    assert found.standard_uncertainty_dn == pytest.approx(0.1 / math.sqrt(2))
    assert found.frame_spread_dn == 0.0


def test_without_dark_frames_the_black_level_stands_in():
    found = estimate_dark([], [signal(900.0), signal(800.0)])
    assert (found.signal_dn, found.standard_uncertainty_dn) == (250.0, 1.0)


@pytest.mark.parametrize(
    ("rows", "readings", "params", "flag", "where"),
    [
        (LIGHTS, READINGS, PARAMS, shared.DARK_FROM_BLACK_LEVEL, "iso 3200"),
        ((*LIGHTS, DARKS[0]), READINGS, PARAMS, luminance_codes.DARK_FROM_FEW_FRAMES, "iso 3200"),
        ((*LIGHTS, *DARKS[:4]), READINGS, PARAMS, shared.DARK_EXPOSURE_DIFFERS, "iso 3200"),
        ((*ROWS, dark("warm", mean_dn=DARK + 20)), READINGS, PARAMS, luminance_codes.DARK_VARIES, "iso 3200"),
        ((*ROWS, dark("lit", mean_dn=DARK + 20)), READINGS, PARAMS, shared.DARK_NOT_DARK, "iso 3200"),
        (
            (*ROWS[1:], dataclasses.replace(LIGHTS[0], rendered=True)),
            READINGS,
            PARAMS,
            shared.RENDERED,
            "iso 3200",
        ),
        (
            (*ROWS[1:], dataclasses.replace(LIGHTS[0], gain_maps=("ab",))),
            READINGS,
            PARAMS,
            luminance_codes.GAIN_MAPS_DIFFER,
            "iso 3200",
        ),
        ((*LIGHTS[::3], *LIGHTS[1:3], *DARKS), READINGS, PARAMS, shared.FEW_POINTS, "iso 3200"),
        (ROWS, READINGS, Params(), luminance_codes.METER_REPEATABILITY_ESTIMATED, "iso 3200"),
        (
            ROWS,
            [dataclasses.replace(READINGS[0], expanded_uncertainty_rel=None), *READINGS[1:]],
            PARAMS,
            luminance_codes.METER_CERTIFICATE_MISSING,
            "",
        ),
        (
            ROWS,
            READINGS,
            dataclasses.replace(PARAMS, exposure_basis="apex"),
            luminance_codes.APEX_MISSING,
            "iso 3200",
        ),
        (
            ROWS,
            (*READINGS, *(Reading(scene="dim", quantity="illuminance", value=v) for v in (10.0, 10.21))),
            PARAMS,
            luminance_codes.LAMP_DRIFT,
            "scene dim",
        ),
        (
            [dataclasses.replace(row, taken_at="2026-03-02T10:00:00+00:00") for row in ROWS],
            (dataclasses.replace(READINGS[0], taken_at="2026-03-02T12:00:00+00:00"), *READINGS[1:]),
            PARAMS,
            luminance_codes.READING_FAR_FROM_FRAMES,
            f"scene {READINGS[0].scene}",
        ),
        (
            ROWS,
            (*READINGS, Reading(scene="dim", quantity="illuminance", value=0.5 * math.pi / 0.8 * 10.764)),
            dataclasses.replace(PARAMS, panel_rho=0.8),
            luminance_codes.RHO_CROSS_CHECK,
            "scene dim",
        ),
    ],
)
def test_a_flag_says_where(rows, readings, params, flag, where):
    assert raised(fit(rows, readings, params), flag) == [where]
    assert raised(fit(), flag) == []


def test_agreement_raises_no_flag():
    readings = (*READINGS, *(Reading(scene="dim", quantity="illuminance", value=v) for v in (1.95, 1.98)))
    result = fit(readings=readings, params=dataclasses.replace(PARAMS, panel_rho=0.8))
    assert result.flags == ()
    dim = next(s for s in result.scenes if s.scene == "dim")
    assert dim.rho_e_pi_cd_m2 == pytest.approx(0.8 * 1.965 / math.pi)


@pytest.mark.parametrize(("exponent", "flagged"), [(1.03, True), (0.97, True), (1.01, False)])
def test_a_bent_response_is_flagged(exponent, flagged):
    rows = [
        dataclasses.replace(row, statistics=statistics(DARK + (row.statistics[0].mean_dn - DARK) ** exponent))
        for row in LIGHTS
    ]
    assert raised(fit((*rows, *DARKS)), luminance_codes.NONLINEAR) == (["iso 3200"] if flagged else [])


@pytest.mark.parametrize(
    ("factor", "flagged"), [(4.5, True), (3.5, False), (1 / 3.5, False), (1 / 4.5, True)]
)
def test_an_implausible_k_is_flagged(factor, flagged):
    """Expected here: (4095 - 256) / 120 = 32; readings in foot-lamberts would be off by 3.4."""
    readings = [dataclasses.replace(r, value=r.value * K / 32.0 / factor) for r in READINGS]
    assert raised(fit(readings=readings), luminance_codes.IMPLAUSIBLE_K) == (["iso 3200"] if flagged else [])


def test_scatter_beyond_the_claims_is_flagged():
    rows = [light(s, f, k=K * (1 + (-1) ** n * 0.1)) for s in SCENES for n, f in enumerate((5.6, 8.0, 16.0))]
    result = fit((*rows, *DARKS), params=dataclasses.replace(PARAMS, f_number_u_rel=0.001))
    assert raised(result, shared.SCATTER_EXCEEDS_UNCERTAINTY) == ["iso 3200"]
    (iso_fit,) = result.iso_fits
    scatter = iso_fit.models[0].frame_scatter_rel
    assert scatter == pytest.approx(np.std(np.log([1.1, 0.9, 1.1] * 3), ddof=1), rel=0.02)
    assert iso_fit.birge_ratio == pytest.approx(1.0, abs=0.01)
    assert iso_fit.models[0].stated_chi_squared > 100
    (line,) = (line for line in explain_budget(iso_fit) if line.source == "scatter between frames")
    assert (line.kind, line.input_uncertainty) == ("A", scatter)
    assert line.sensitivity == pytest.approx(1 / 3, rel=0.01)


@pytest.mark.parametrize(("error", "flagged"), [(0.0001, False), (0.03, True)])
def test_only_scatter_that_chance_does_not_explain_is_flagged(error, flagged):
    """Frames of 0.2 DN noise in 20 DN and more: a tenth of a per mille is within, 3 % are not."""
    rows = [
        light(s, f, k=K * (1 + (-1) ** (n + m) * error))
        for m, s in enumerate(SCENES)
        for n, f in enumerate((5.6, 8.0, 16.0))
    ]
    result = fit((*rows, *DARKS))
    assert raised(result, shared.SCATTER_EXCEEDS_UNCERTAINTY) == (["iso 3200"] if flagged else [])
    assert ("scatter between frames" in {entry.source for entry in result.iso_fits[0].budget}) is flagged


def test_a_scene_is_predicted_with_the_scatter_that_was_found():
    """Of seven nearly noiseless frames one is 14 % low: it pulls the predictions by a fifth, no more."""
    shots = {"bright": (5.6, 8.0, 16.0), "middle": (5.6, 8.0), "dim": (8.0, 16.0)}
    rows = [light(s, f, k=K * (0.86 if (s, f) == ("bright", 5.6) else 1.0)) for s in shots for f in shots[s]]
    quiet = [
        dataclasses.replace(r, statistics=(dataclasses.replace(r.statistics[0], std_dn=1.0, n=10**8),))
        for r in (*rows, *DARKS)
    ]
    report = fit(quiet).iso_fits[0].models[0]
    pulled = 1 - 0.86 ** (1 / 5)
    assert report.left_out_max_rel == pytest.approx(0.14, abs=0.005)
    assert report.left_out_rms_rel == pytest.approx(math.sqrt((0.14**2 + 4 * pulled**2) / 7), rel=0.05)


def test_an_offset_is_flagged_with_its_size(drawn):
    """Stray light of 40 DN in every light frame of ISO 3200; the weakest has some 80 DN above dark."""
    lit = [
        dataclasses.replace(
            row,
            statistics=tuple(dataclasses.replace(s, mean_dn=s.mean_dn + 40.0) for s in row.statistics),
        )
        if row.role == "light" and row.exposure.iso == 3200.0
        else row
        for row in drawn.rows
    ]
    result = fit(lit, drawn.readings, Params())
    (found,) = [each for each in result.flags if each.flag == luminance_codes.OFFSET_SIGNIFICANT]
    assert found.where == "iso 3200"
    offset = float(re.match(r"Offset \+([\d.]+) DN, standard uncertainty", found.detail)[1])
    weakest = result.iso_fits[0].coefficient.signal_range_dn[0]
    assert offset == pytest.approx(40.0, rel=0.1)
    assert f"{offset / weakest:.0%} of the weakest point" in found.detail


def test_scatter_that_no_meter_has_is_named():
    """Readings of six coloured patches that differ by 27 %: not "usual"."""
    random = np.random.default_rng(1)
    rows = [light(s, f, name=f"{s}{n}-{f}") for n in range(2) for s in SCENES for f in (5.6,)]
    rows = [dataclasses.replace(row, scene=row.frame.partition("-")[0]) for row in rows]
    readings = [
        dataclasses.replace(r, scene=f"{r.scene}{n}", value=r.value * math.exp(random.normal(0, 0.27)))
        for n in range(2)
        for r in READINGS
    ]
    result = fit((*rows, *DARKS), readings, Params())
    assert raised(result, shared.SCATTER_IMPLAUSIBLE) == ["iso 3200"]
    assert raised(result, luminance_codes.METER_REPEATABILITY_ESTIMATED) == []
