"""Outliers: what they cost by least squares and in a robust fit."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from radiometry.fitting import sources
from radiometry.fitting.comparison import Budgeted, compare_measured, scale_effects, sign_effects
from radiometry.luminance import codes
from radiometry.luminance.rows import Params
from tests.radiometry.campaigns import TRUE_K, draw
from tests.radiometry.evidence import SPAN, K, dark, light, reading
from tests.radiometry.luminance.exact import fit, raised

PLAIN = Params(f_number_u_rel=0.015)
ROBUST = replace(PLAIN, estimator="robust")


def spoil(drawn, count, factor):
    """Return the rows, the signal of some light frames wrong by a factor."""
    light = [row for row in drawn.rows if row.role == "light"]
    chosen = {light[index].frame for index in range(2, len(light), len(light) // count)[:count]}
    rows = [
        replace(
            row,
            statistics=tuple(replace(s, mean_dn=256 + (s.mean_dn - 256) * factor) for s in row.statistics),
        )
        if row.frame in chosen
        else row
        for row in drawn.rows
    ]
    return rows, chosen


@pytest.fixture(scope="module")
def drawn():
    return draw(3)


@pytest.fixture(scope="module")
def unspoilt(drawn):
    return fit(drawn.rows, drawn.readings, ROBUST)


def test_outliers_cost_least_squares_much_and_the_robust_fit_little(drawn, unspoilt):
    rows, chosen = spoil(drawn, 3, 0.5)
    clean = unspoilt.iso_fits[0].coefficient
    plain, robust = (fit(rows, drawn.readings, params) for params in (PLAIN, ROBUST))
    wide, narrow = (result.iso_fits[0].coefficient for result in (plain, robust))
    assert wide.expanded_uncertainty > 1.2 * clean.expanded_uncertainty
    assert narrow.expanded_uncertainty < 1.2 * clean.expanded_uncertainty
    assert narrow.luminance_k == pytest.approx(clean.luminance_k, rel=0.004)
    assert abs(narrow.luminance_k - TRUE_K) < narrow.expanded_uncertainty
    assert {p.frame for p in robust.points if p.robust_weight is not None and p.robust_weight < 0.1} == chosen
    assert raised(robust, codes.OUTLIERS_DISCOUNTED) == ["iso 3200"]
    assert raised(plain, codes.OUTLIERS_DISCOUNTED) == []


def test_without_outliers_nothing_is_lost(drawn, unspoilt):
    assert unspoilt.iso_fits == fit(drawn.rows, drawn.readings, PLAIN).iso_fits
    assert raised(unspoilt, codes.OUTLIERS_DISCOUNTED) == []


def test_readings_without_scatter_do_not_keep_the_weights_from_converging():
    """One frame of seven scenes of four is off by a fifth: its weight makes the readings' variance 0."""
    random = np.random.default_rng(5)
    off = 1.0 + 0.005 * random.standard_normal(4)
    lights = np.geomspace(50.0, 0.5, 7)
    rows = []
    for level in lights:
        for a, wrong in zip((2.8, 4.0, 5.6, 8.0), off, strict=True):
            time_s = float(f"{0.4 * SPAN * a * a / (K * 3200 * level):.2g}")
            signal = K * time_s * 3200 * level / a**2 * (1 + 0.003 * random.standard_normal()) / wrong**2
            signal = (signal + 0.2 * random.standard_normal()) * (1.2 if len(rows) == 9 else 1.0)
            rows.append(light(f"{level}", a, time_s=time_s, luminance=level, signal_dn=signal))
    rows += [
        dark(f"{t}-{n}", time_s=t, mean_dn=256 + 0.2 * random.normal()) for t in (0.01, 1.0) for n in "abc"
    ]
    readings = [reading(f"{each}", each * (1 + 0.005 * random.standard_normal())) for each in lights]
    robust = fit(rows, readings, Params(estimator="robust"))
    narrow = robust.iso_fits[0].coefficient
    assert [p.frame for p in robust.points if p.robust_weight < 0.1] == [rows[9].frame]
    assert narrow.frame_scatter_rel == pytest.approx(0.003, rel=0.5)
    assert abs(narrow.luminance_k - K) < narrow.expanded_uncertainty


@pytest.mark.parametrize("noise", [0.0, 1e-9])
@pytest.mark.parametrize("model", ["proportional", "affine", "power"])
@pytest.mark.parametrize("estimator", ["least_squares", "robust"])
def test_frames_without_noise_are_fitted(noise, model, estimator):
    """Seven scenes of four apertures on the line to nine digits: no source of error shows a variance."""
    random, rows, lights = np.random.default_rng(1), [], np.geomspace(50.0, 0.5, 7)
    for level in lights:
        for a in (2.8, 4.0, 5.6, 8.0):
            time_s = float(f"{0.4 * SPAN * a * a / (K * 3200 * level):.2g}")
            signal = K * time_s * 3200 * level / a**2 * (1 + noise * random.standard_normal())
            rows.append(light(f"{level}", a, time_s=time_s, luminance=level, signal_dn=signal))
    rows += [dark(f"{t}-{n}", time_s=t) for t in (0.01, 1.0) for n in "abc"]
    readings = [reading(f"{each}", each * (1 + noise * random.standard_normal())) for each in lights]
    found = fit(rows, readings, Params(model=model, estimator=estimator)).iso_fits[0].coefficient
    assert abs(found.luminance_k - K) < max(found.luminance_k_standard_uncertainty, 1e-3)


def test_a_robust_fit_takes_at_most_five_times_as_long(drawn):
    rows, _ = spoil(drawn, 3, 1.3)

    def measure_s(params):
        began = time.process_time()
        fit(rows, drawn.readings, params)
        return time.process_time() - began

    plain, robust = (min(measure_s(params) for _ in range(2)) for params in (PLAIN, ROBUST))
    assert robust < 5.0 * plain


def test_one_frame_per_scene(drawn):
    """Readings and frames cannot be told apart: the robust fit counts their scatter as the frames'."""
    random = np.random.default_rng(2)
    first = {}
    for row in drawn.rows:
        if row.role == "light":
            first.setdefault(row.scene, row)
    scenes = [
        (replace(row, frame=f"{scene}-{n}", scene=f"{scene}-{n}"), scene)
        for scene, row in first.items()
        for n in range(4)
    ]
    readings = [
        replace(r, scene=row.scene, value=r.value * random.normal(1.0, 0.01))
        for row, scene in scenes
        for r in drawn.readings
        if r.scene == scene
    ]
    readings[7] = replace(readings[7], value=2.0 * readings[7].value)
    rows = [*(row for row, _ in scenes), *(row for row in drawn.rows if row.role == "dark")]
    plain, robust = (
        fit(rows, readings, replace(p, f_number_u_rel=0.0)).iso_fits[0].coefficient for p in (PLAIN, ROBUST)
    )
    assert robust.expanded_uncertainty < 0.6 * plain.expanded_uncertainty


# --- The four models: forward, backward, and their slopes


PARAMETERS = {
    "proportional": (30.0,),
    "affine": (30.0, -4.0),
    "power": (28.0, 1.02),
    "semilog": (600.0, -900.0),
}
RHS = np.array([8.0, 20.0, 55.0])


def test_forward_by_hand():
    x = np.array([math.e**2])
    assert sources.predict("proportional", np.array([2.0]), np.array([8.0]))[0] == 16.0
    assert sources.predict("affine", np.array([2.0, 3.0]), np.array([8.0]))[0] == 19.0
    assert sources.predict("power", np.array([2.0, 3.0]), np.array([4.0]))[0] == 128.0
    assert sources.predict("semilog", np.array([5.0, 1.0]), x)[0] == pytest.approx(11.0)


@pytest.mark.parametrize("model", sources.PARAMETER_NAMES)
def test_backward_undoes_forward(model):
    signals = sources.predict(model, np.array(PARAMETERS[model]), RHS)
    assert [sources.invert(model, PARAMETERS[model], float(signal)) for signal in signals] == pytest.approx(
        RHS
    )


@pytest.mark.parametrize("model", sources.PARAMETER_NAMES)
def test_slopes_agree_with_differences(model):
    parameters, signal, step = PARAMETERS[model], 700.0, 1e-6
    by_signal, by_parameters = sources.invert_gradient(model, parameters, signal)

    higher, lower = (sources.invert(model, parameters, signal * (1 + sign * step)) for sign in (1, -1))
    assert by_signal == pytest.approx((higher - lower) / (2 * step * signal), rel=1e-6)
    for index, value in enumerate(parameters):
        up, down = list(parameters), list(parameters)
        up[index], down[index] = value * (1 + step), value * (1 - step)
        difference = (sources.invert(model, up, signal) - sources.invert(model, down, signal)) / (
            2 * step * value
        )
        assert by_parameters[index] == pytest.approx(difference, rel=1e-5)


def test_a_curve_below_dark_cannot_be_laid_out():
    assert sources.linearise("affine", RHS, np.array([1.0, 2.0, 3.0]), np.array([1.0, -10.0])) is None


def test_no_inverse_is_not_a_number_and_no_exception():
    assert math.isinf(sources.invert("semilog", (1e-3, 0.0), 1e6))
    assert math.isnan(sources.invert("power", (30.0, 1.1), -5.0))
    assert math.isnan(sources.invert("power", (30.0, 1.1), 0.0))


# --- Two measurements against each other: figures by hand, and drawn errors


OLD = Budgeted(value=10.0, unit="cd/m2", effects={"fit of K": 0.2, "f-number": 0.1, "pixel noise": 0.03})
NEW = Budgeted(value=8.0, unit="cd/m2", effects={"fit of K": 0.16, "f-number": 0.08, "pixel noise": 0.04})


def test_what_is_common_cancels():
    """K: 0.16 - 0.2; the f-number and the noise count in both."""
    found = compare_measured(OLD, NEW, common={"fit of K"})
    u = math.sqrt(0.04**2 + 0.1**2 + 0.08**2 + 0.03**2 + 0.04**2)
    assert found.difference.value == pytest.approx(-2.0)
    assert found.difference.standard_uncertainty == pytest.approx(u)
    assert found.in_standard_uncertainties == pytest.approx(2.0 / u)
    # of the ratio 0.8 the error of K is gone altogether: 1 % twice, 0.3 % and 0.5 % of it remain
    rel = math.sqrt(2 * 0.01**2 + 0.003**2 + 0.005**2)
    assert found.change.value == pytest.approx(-20.0)
    assert found.change.standard_uncertainty == pytest.approx(100 * 0.8 * rel)


def test_with_nothing_in_common_both_count():
    found = compare_measured(OLD, NEW, common=())
    squares = [*OLD.effects.values(), *NEW.effects.values()]
    assert found.difference.standard_uncertainty == pytest.approx(math.hypot(*squares))


def test_a_negative_value_moves_with_k_the_other_way():
    assert sign_effects(-0.5, {"fit of K": 0.01, "dark signal": 0.2}) == {
        "fit of K": -0.01,
        "dark signal": -0.2,
    }


def test_a_cell_has_the_frames_effects_and_noise_of_its_own():
    mean = Budgeted(value=2.0, unit="cd/m2", effects={"K": 0.1, "dark signal": -0.03, "pixel noise": 0.01})
    cell = scale_effects(mean, 1.0, math.hypot(0.05, 0.03, 0.02))
    assert cell.effects == pytest.approx({"K": 0.05, "dark signal": -0.03, "pixel noise": 0.02})
    # no more is known of it than the frame's own: nothing is negative under the root
    assert scale_effects(mean, 1.0, 0.01).effects["pixel noise"] == 0.0


def test_nothing_is_divided_by_zero():
    zero = Budgeted(value=0.0, unit="cd/m2", effects={})
    found = compare_measured(zero, zero, common=())
    assert (found.change, found.in_standard_uncertainties) == (None, None)
    assert scale_effects(zero, 1.0, 0.5).effects == {"pixel noise": 0.5}
