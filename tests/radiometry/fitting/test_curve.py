"""One curve: the parameters, and above all what is claimed about them."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.stats import t as student_t

from radiometry.fitting.curve import coverage_factor, fit_curve
from radiometry.fitting.sources import Curve

K = 30.0


def curve(scenes, f_numbers, *, times=None, errors=0.0, u_dn=0.1, **changes):
    """Points at X = 2, 4, 8, ... with relative errors of the signal and one noise for all."""
    n = len(scenes)
    rhs = 2.0 ** np.arange(1, n + 1)
    signal = K * rhs * (1 + np.asarray(errors))
    made = Curve(
        rhs=rhs,
        signal_dn=signal,
        signal_u_dn=u_dn * np.ones(n),
        scenes=tuple(scenes),
        f_numbers=tuple(f_numbers),
        times_s=tuple(times or [0.1] * n),
        readings=np.ones(n, np.int64),
        dark_u_dn=0.0,
        dark_dof=math.inf,
        f_number_u_rel=0.0,
        time_u_rel=0.0,
        repeatability_u_rel=0.0,
        lens_shares=np.ones(n),
        lens_u_rel=np.zeros(n),
        dark_lever_s=np.zeros(n),
        lamp_u_rel=np.zeros(n),
        lamp_labels=("",) * n,
        lamp_level_u_rel=np.zeros(n),
        scatter_weights=np.ones(n),
    )
    return replace(made, **changes)


def u_rel(fit):
    return math.sqrt(fit.covariance[0, 0]) / fit.parameters[0]


@pytest.mark.parametrize(("shown", "size"), [(0.0, math.sqrt(0.5)), (0.02, math.sqrt(1.5))])
def test_drift_that_frames_show_by_hand(shown, size):
    """Two scenes of two frames at -1 and +1 % of drift, whose noise is 2 %.

    c = (-1, 1, -1, 1) % and V = s^2 + c c' give z = c'y / (s^2 + c'c) and u(z)^2 = s^2 / (s^2 + c'c) = 1/2;
    y = (-2, 2, -2, 2) % gives z = 1. What scenes share is at right angles to c.
    """
    signs = np.array([-1.0, 1.0, -1.0, 1.0])
    points = curve("aabb", [4.0] * 4, errors=np.expm1(shown * signs), repeatability_u_rel=0.03)
    points = replace(points, signal_u_dn=0.02 * K * points.rhs, lamp_u_rel=0.01 * signs)
    assert fit_curve(points, model="proportional").lamp_size == pytest.approx(size, rel=1e-6)


@pytest.mark.parametrize(
    ("scenes", "f_numbers", "changes", "expected"),
    [
        # each scene counts once, however many its frames
        ("abbccc", [4] * 6, {"repeatability_u_rel": 0.03}, 0.03 / math.sqrt(3)),
        ("abcd", [4] * 4, {"repeatability_u_rel": 0.03, "readings": np.full(4, 9)}, 0.03 / math.sqrt(4 * 9)),
        # f enters squared: twice its relative uncertainty, over the number of different f-numbers
        ("abcabc", [2, 2, 2, 8, 8, 8], {"f_number_u_rel": 0.015}, 2 * 0.015 / math.sqrt(2)),
        ("abcdef", [4] * 6, {"time_u_rel": 0.005}, 0.005),
        ("abcd", [4] * 4, {"scatter_u_rel": 0.02}, 0.02 / math.sqrt(4)),
    ],
)
def test_uncertainty_of_one_source_by_hand(scenes, f_numbers, changes, expected):
    fit = fit_curve(curve(scenes, f_numbers, u_dn=1e-6, **changes), model="proportional")
    assert u_rel(fit) == pytest.approx(expected, rel=1e-6)


def test_the_dark_signal_is_common_to_all_points():
    """Two points of 60 and 120 DN with noise of 1 DN and a dark signal known to 2 DN, solved on paper."""
    fit = fit_curve(replace(curve("ab", [4, 4], u_dn=1.0), dark_u_dn=2.0), model="proportional")
    n = np.array([60.0, 120.0])
    v = (np.eye(2) + 4.0) / np.outer(n, n)
    assert u_rel(fit) ** 2 == pytest.approx(1 / np.sum(np.linalg.inv(v)), rel=1e-9)


def test_repeatability_is_estimated_from_the_scatter_between_scenes():
    errors = np.repeat([0.02, -0.01, 0.03, -0.02], 2)
    points = curve("aabbccdd", [4] * 8, errors=np.expm1(errors), u_dn=1e-3, repeatability_u_rel=None)
    fit = fit_curve(points, model="proportional")
    assert fit.repeatability_u_rel == pytest.approx(np.std(errors[::2], ddof=1), rel=1e-4)
    assert fit.effective_dof() == pytest.approx(3, rel=1e-3)
    assert coverage_factor(fit.effective_dof()) == pytest.approx(3.182, abs=2e-3)
    assert fit.parameters[0] == pytest.approx(K * math.exp(np.mean(errors)), rel=1e-6)


def test_an_exact_common_variance_adds_degrees_of_freedom():
    errors = np.expm1(np.array([0.02, -0.01, 0.03, -0.02]))
    fit = fit_curve(
        curve("abcd", [4] * 4, errors=errors, u_dn=1e-6, repeatability_u_rel=None), model="proportional"
    )
    own = u_rel(fit) ** 2
    assert fit.effective_dof(own) == pytest.approx(3 * 2**2, rel=1e-3)  # (v + v)^2 / (v^2 / 3)


def test_birge_ratio_by_hand():
    """Relative noise of 1 % claimed, +-3 % found: chi^2 = 4 * 9 over 3; nu = 3."""
    errors = np.expm1(np.array([0.03, -0.03, 0.03, -0.03]))
    points = curve("abcd", [4] * 4, errors=errors, scatter_u_rel=0.0)
    points = replace(points, signal_u_dn=0.01 * K * points.rhs)
    fit = fit_curve(points, model="proportional")
    assert fit.chi_squared == pytest.approx(36.0, rel=0.01)
    assert fit.birge_ratio == pytest.approx(math.sqrt(12.0), rel=0.01)
    assert u_rel(fit) == pytest.approx(0.01 / 2 * math.sqrt(12), rel=0.01)
    assert fit.effective_dof() == pytest.approx(3.0)
    # it leaves alone what all points share
    common = fit_curve(replace(points, time_u_rel=0.5), model="proportional")
    assert u_rel(common) ** 2 == pytest.approx(0.5**2 + (0.01 / 2) ** 2 * 12, rel=0.01)


def same(one, other):
    return all(np.array_equal(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))


def test_scatter_between_frames_by_hand():
    """The same points as Birge's: 1 % claimed, a variance of 4 * 9 / 3 = 12 found, so 11 are the frames'."""
    errors = np.expm1(np.array([0.03, -0.03, 0.03, -0.03]))
    points = curve("abcd", [4] * 4, errors=errors, time_u_rel=0.5)
    points = replace(points, signal_u_dn=0.01 * K * points.rhs)
    fit = fit_curve(points, model="proportional")
    assert fit.scatter_u_rel == pytest.approx(0.01 * math.sqrt(11), rel=0.01)
    assert fit.stated_chi_squared == pytest.approx(36.0, rel=0.01)
    assert fit.chi_squared == pytest.approx(3.0)
    assert fit.birge_ratio == pytest.approx(1.0)
    assert fit.k_shares["scatter between frames"] == ("A", pytest.approx(11e-4 / 4, rel=0.01))
    assert fit.k_shares["exposure time"][1] == pytest.approx(0.5**2)
    alone = fit_curve(replace(points, time_u_rel=0.0), model="proportional")
    assert alone.effective_dof() == pytest.approx(3.0, rel=0.01)


@pytest.mark.parametrize("between", [0.02, 0.0])
def test_scenes_and_frames_are_told_apart_as_in_the_analysis_of_variance(between):
    """Four scenes of three frames each: the mean squares within, between, and their degrees of freedom."""
    errors = (
        between * np.repeat([1.0, -1.0, 0.5, 0.2], 3) + 0.01 * np.array([[1, 0, -1], [0, 1, -1]] * 2).ravel()
    )
    points = curve("aaabbbcccddd", [4] * 12, errors=np.expm1(errors), repeatability_u_rel=None)
    points = replace(points, signal_u_dn=1e-6 * points.signal_dn)
    fit = fit_curve(points, model="proportional")
    means = errors.reshape(4, 3).mean(axis=1)
    within = np.sum((errors.reshape(4, 3) - means[:, None]) ** 2) / 8
    among = 3 * np.var(means, ddof=1)
    pooled = np.var(errors, ddof=1)  # where the scenes do not differ by more than their frames
    scatter, repeatability, u, dof = (
        (within, (among - within) / 3, among / 12, 3) if between else (pooled, 0.0, pooled / 12, None)
    )
    assert fit.scatter_u_rel**2 == pytest.approx(scatter, rel=1e-6)
    assert fit.repeatability_u_rel**2 == pytest.approx(repeatability, rel=1e-6)
    assert u_rel(fit) ** 2 == pytest.approx(u, rel=1e-6)
    if dof:
        assert fit.effective_dof() == pytest.approx(dof, rel=1e-3)


def test_explained_scatter_changes_no_bit():
    explained = curve(
        "aabbcc", [2, 4] * 3, errors=[0.02, 0.01, -0.01, 0, 0, 0.01], f_number_u_rel=0.02, u_dn=3.0
    )
    exact = curve("aabbcc", [2, 4] * 3)
    shared = curve("aabbcc", [2, 4] * 3, errors=np.repeat([0.05, 0, -0.05], 2), repeatability_u_rel=0.01)
    alone = curve("abcdef", [4] * 6, errors=[0.1, 0, 0, -0.1, 0, 0], repeatability_u_rel=None)
    two = curve("ab", [2, 4], repeatability_u_rel=None)
    for points in (explained, exact, shared, alone, two):
        for model in ("proportional", "affine", "power", "semilog"):
            fit = fit_curve(points, model=model)
            without = fit_curve(replace(points, scatter_u_rel=0.0), model=model)
            assert fit is without or same(
                replace(fit, later_scatter_u_rel=0.0, later_scatter_dof=math.inf), without
            )
    assert fit_curve(shared, model="proportional").birge_ratio > 2  # Birge has what no frame has alone


def test_a_frame_of_half_its_light_is_scatter_and_no_reason_to_give_up():
    """Noise of 10 ppm alone weighs the points so unlike that the fit means nothing."""
    errors = np.zeros(12)
    errors[3] = -0.5
    points = curve(
        "aaabbbcccddd", [2, 4, 8] * 4, errors=errors, f_number_u_rel=0.015, repeatability_u_rel=None
    )
    points = replace(points, signal_u_dn=1e-5 * points.signal_dn)
    fit = fit_curve(points, model="proportional")
    assert u_rel(fit) == pytest.approx(math.hypot(math.log(2) / 12, 0.03 / math.sqrt(3)), rel=0.05)
    assert fit.stated_chi_squared > 1e6


def test_semilog_is_a_plain_regression():
    points = curve("abcdef", [4] * 6, errors=[0.1, 0, -0.1, 0, 0.1, 0])
    fit = fit_curve(points, model="semilog")
    slope, offset = np.polyfit(np.log(points.rhs), points.signal_dn, 1)
    assert fit.parameters == pytest.approx([slope, offset])
    _, covariance = np.polyfit(np.log(points.rhs), points.signal_dn, 1, cov=True)
    assert fit.covariance == pytest.approx(covariance)


def test_too_few_points_or_no_settling_is_no_fit():
    assert fit_curve(curve("ab", [4] * 2), model="affine") is None
    steep = replace(
        curve("abcd", [4] * 4), rhs=np.array([1.0, 1.1, 1.2, 1.3]), signal_dn=np.array([1e-3, 1.0, 1e3, 1e6])
    )
    assert fit_curve(steep, model="affine") is None


def test_coverage_factor_is_students_t():
    assert coverage_factor(math.inf) == pytest.approx(1.959964, abs=1e-6)
    assert coverage_factor(5.0) == pytest.approx(student_t.ppf(0.975, 5))
