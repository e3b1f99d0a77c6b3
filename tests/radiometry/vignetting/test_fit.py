"""Simulated truth comes back within its own error: off-centre, not square, transposed, and lit unevenly."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter
from scipy.stats import chi2

from radiometry.findings import InputRejected
from radiometry.fitting.evidence import Exclusion
from radiometry.vignetting import fit as vignetting
from radiometry.vignetting import points
from radiometry.vignetting.blocks import Site
from radiometry.vignetting.channels import fit_channel
from radiometry.vignetting.falloff import CENTRE_U, EVEN, UNKNOWN, evaluate_curve, solve_falloff
from radiometry.vignetting.lens import evaluate
from simulation.camera import change, take
from simulation.targets import FALLOFFS, FAST_LENS, plan_flats
from tests.radiometry.vignetting.flats import (
    NONE,
    SMALL,
    dark,
    exact_blocks,
    flags_of,
    flat,
    grid_of,
    row,
    state_black,
    surface,
)

F_NUMBERS = (1.4, 2.0, 4.0, 8.0)
LENS = change(FAST_LENS, height_px=320, width_px=480, centre_px=(171.0, 222.0))


def true_corner(lens, f_number):
    """1 - V at the far corner, worked out without the code under test."""
    row0, col0 = lens.centre_px
    corners = [
        (r, c) for r in (-0.5, lens.sensor.height_px - 0.5) for c in (-0.5, lens.sensor.width_px - 0.5)
    ]
    squared = max((r - row0) ** 2 + (c - col0) ** 2 for r, c in corners)
    squared /= (lens.sensor.height_px**2 + lens.sensor.width_px**2) / 4
    k1, k2, k3 = lens.lens.falloffs[f_number]
    return -(k1 * squared + k2 * squared**2 + k3 * squared**3)


@pytest.fixture(scope="module")
def rows():
    random = np.random.default_rng(12)
    shots = [take(LENS, shot, random) for shot in plan_flats(LENS, f_numbers=F_NUMBERS, flats=2)]
    return [row(shot) for shot in shots]


@pytest.fixture(scope="module")
def fitted(rows):
    return vignetting.fit(rows, NONE)


def of(fit, f_number, channel="G1"):
    return next(
        each
        for each in fit.channel_fits
        if each.coefficient.f_number == f_number and each.coefficient.channel in {channel, "grey"}
    )


def test_truth_comes_back_within_its_error(fitted):
    """All five parameters with their correlations: chi-square of 5 per fit, of 80 over all."""
    distances = []
    for each in fitted.channel_fits:
        found = each.coefficient
        truth = [*LENS.lens.falloffs[found.f_number], *LENS.lens.centre_px]
        pull = np.array([*found.k, *found.centre_px]) - truth
        distances.append(float(pull @ np.linalg.solve(np.array(found.covariance), pull)))
        off = found.corner_falloff - true_corner(LENS, found.f_number)
        assert abs(off) < 4 * found.corner_falloff_standard_uncertainty
        assert found.corner_falloff_standard_uncertainty < 0.005
    assert len(distances) == 16
    assert max(distances) < chi2.ppf(1 - 1e-4 / 16, 5)
    assert chi2.ppf(1e-3, 80) < sum(distances) < chi2.ppf(1 - 1e-3, 80)
    scatter = [each.chi_squared / each.dof for each in fitted.channel_fits]
    assert np.mean(scatter) == pytest.approx(1.0, abs=0.05)
    assert of(fitted, 1.4).coefficient.model_u_rel == 0.0
    assert fitted.flags == ()


def test_order_of_the_input_changes_nothing():
    lens = change(SMALL, cfa="grey")
    rows = [flat(lens, seed, f, name=f"flat-{seed}") for seed, f in enumerate((1.4, 1.4, 4.0, 4.0))]
    rows += [dark(lens, seed, name=f"dark-{seed}") for seed in (5, 6)]
    assert vignetting.fit([rows[n] for n in (4, 2, 0, 5, 3, 1)], NONE) == vignetting.fit(rows, NONE)


def test_fit_survives_json_and_is_finite(fitted):
    adapter = TypeAdapter(vignetting.Fit)
    text = adapter.dump_json(fitted)
    assert adapter.validate_json(text) == fitted
    assert b"NaN" not in text
    assert b"Infinity" not in text


def test_figures_have_the_contract_s_names(fitted):
    figures = vignetting.list_coefficients(fitted)
    names = {"k1", "k2", "k3", "centre_row_px", "centre_col_px", "corner_falloff"}
    assert {each.name for each in figures} == names
    assert len(figures) == 6 * 16
    centre = next(e for e in figures if (e.name, e.f_number, e.channel) == ("centre_col_px", 2.0, "B"))
    coefficient = of(fitted, 2.0, "B").coefficient
    assert (centre.value, centre.unit, centre.band) == (coefficient.centre_col_px, "px", None)
    assert centre.standard_uncertainty == coefficient.covariance[4][4] ** 0.5


@given(
    height=st.integers(90, 400),
    width=st.integers(90, 400),
    where=st.tuples(st.floats(0.35, 0.65), st.floats(0.35, 0.65)),
    k=st.tuples(st.floats(-0.6, -0.2), st.floats(-0.15, 0.2), st.floats(-0.1, 0.1)),
    site=st.tuples(st.integers(0, 1), st.integers(0, 1)),
)
@example(height=218, width=90, where=(0.625, 0.5), k=(-0.5, 0.0, 0.0), site=(0, 0))
@settings(max_examples=6, deadline=None)
def test_exact_light_gives_exact_parameters_and_transposes(height, width, where, k, site):
    gradient = (0.03, -0.02)
    grid, turned = grid_of(height, width), grid_of(width, height)
    centre = (where[0] * height, where[1] * width)
    here = Site(row0=site[0], col0=site[1], step=2)
    there = Site(row0=site[1], col0=site[0], step=2)
    found = solve_falloff(exact_blocks(grid, k, centre, gradient=gradient, site=here), UNKNOWN)
    other = solve_falloff(exact_blocks(turned, k, centre[::-1], gradient=gradient[::-1], site=there), UNKNOWN)
    # 1e-3 of noise was claimed; what is left is a ten-thousandth of what that would allow
    errors = np.sqrt(np.diag(found.find_covariance_of_lens()))
    assert (np.abs(np.array([*found.k, *found.centre_px]) - [*k, *centre]) < 1e-3 * errors + 1e-9).all()
    assert found.gradient == pytest.approx(gradient, abs=1e-5)
    assert other.centre_px[::-1] == pytest.approx(found.centre_px, abs=0.01)
    assert other.k == pytest.approx(found.k, abs=1e-4)


def test_uneven_light_is_told_from_an_off_centre_lens():
    lens = change(LENS, cfa="grey", falloffs={1.4: FALLOFFS[1.4]})
    uneven = vignetting.fit([flat(lens, 5, target=surface(gradient=(0.02, 0.03)))], NONE)
    found = of(uneven, 1.4)
    assert found.gradient_fitted
    extent = (320 * 0.02 + 480 * 0.03) / np.hypot(320, 480) * 2
    assert abs(found.gradient_rel - extent) < 4 * found.gradient_standard_uncertainty_rel
    errors = np.sqrt(np.diag(found.coefficient.covariance))[3:]
    assert (np.abs(np.array(found.coefficient.centre_px) - lens.centre_px) < 4 * errors).all()
    assert flags_of(uneven.flags) == {"uneven_light", "dark_from_black_level"}
    # the plain fit would put the light's slope into the centre, many errors away
    plain = solve_falloff(
        exact_blocks(grid_of(320, 480), FALLOFFS[1.4], (171.0, 222.0), gradient=(0.02, 0.03)), EVEN
    )
    assert abs(plain.centre_px[0] - 171.0) > 3.0


@pytest.mark.parametrize(("depth", "flagged"), [(0.02, False), (0.05, True)])
def test_what_no_curve_describes_is_said_and_counted(depth, flagged):
    """A hood dims the corners at once: the rest of half a per cent goes by, of one per cent does not."""
    lens = change(LENS, falloffs={1.4: FALLOFFS[1.4]})
    hood = [
        (row, col, 90.0, depth) for row in (0, lens.sensor.height_px) for col in (0, lens.sensor.width_px)
    ]
    found = vignetting.fit([flat(lens, 5, target=surface(spots=hood))], NONE)
    assert 0.003 < of(found, 1.4).coefficient.model_u_rel < 0.015
    assert (of(found, 1.4).coefficient.model_u_rel > 0.005) is flagged
    assert ("vignetting_misfit" in flags_of(found.flags)) is flagged


def cover(f_numbers, plane, turns, *, runs):
    """Return, of the last f-number, the rms of u(V) and the shares of V and of the centre within 2 u."""
    random, found = np.random.default_rng(21), []
    grid = grid_of(240, 360)
    radius = grid.half_diagonal_px
    rows, cols = np.linspace(0, 239, 9)[:, None], np.linspace(0, 359, 13)[None]
    for _ in range(runs):
        centre = grid.middle_px + 0.05 * radius * random.standard_normal(2)
        way, known = random.uniform(0.0, 2.0 * np.pi), None
        for f_number in f_numbers:
            flats = []
            for turn in np.radians(turns) + way + 0.03 * random.standard_normal(len(turns)):
                extent = abs(np.cos(turn)) * 240 / radius + abs(np.sin(turn)) * 360 / radius
                gradient = plane / extent * np.array([np.cos(turn), np.sin(turn)])
                exact = exact_blocks(grid, FALLOFFS[f_number], centre, gradient=gradient)
                noisy = exact.light * (1.0 + 1e-3 * random.standard_normal(exact.light.shape))
                error = 1e-3 * exact.light
                flats.append(replace(exact, light=noisy, standard_error=error))
            fit = fit_channel(flats, f_number=f_number, channel="g", turns_deg=turns, known=known)
            known = known or fit.alone
        found_v = evaluate([fit.fit.coefficient], rows, cols, channel="g", f_number=f_number)
        squared = ((rows - centre[0]) ** 2 + (cols - centre[1]) ** 2) / radius**2
        off = np.abs(found_v.share - evaluate_curve(squared, FALLOFFS[f_number]))
        errors = np.sqrt(np.diag(np.array(fit.fit.coefficient.covariance))[-2:])
        at = np.abs(np.array(fit.fit.coefficient.centre_px) - centre)
        u = found_v.standard_uncertainty
        found.append((np.mean(u**2), np.mean(off < 2.0 * u), np.mean(at < 2.0 * errors)))
    u_squared, of_v, of_centre = np.mean(found, axis=0)
    return np.sqrt(u_squared), of_v, of_centre


@pytest.mark.parametrize(
    ("f_numbers", "plane", "turns", "largest_u"),
    [
        ((8.0,), 0.02, (0.0,), 0.004),
        ((1.4, 8.0), 0.02, (0.0, 0.0), 0.001),
        ((8.0,), 0.02, (0.0, 90.0, 180.0, 270.0), 0.0006),
    ],
)
def test_a_plane_of_light_is_within_the_uncertainty_of_v(f_numbers, plane, turns, largest_u):
    u, of_v, of_centre = cover(f_numbers, plane, turns, runs=10 if len(turns) == 1 else 5)
    assert of_v > 0.75
    assert of_centre > 0.75
    assert u < largest_u


@pytest.mark.parametrize(
    ("degrees", "terms", "largest"), [(20.0, 3, 0.001), (38.0, 5, 0.001), (42.0, 5, 0.002)]
)
def test_the_terms_of_a_wide_lens_are_chosen_and_the_corner_holds_cos4(degrees, terms, largest):
    random, grid, covered = np.random.default_rng(4), grid_of(960, 1440), []
    for _ in range(6):
        exact = exact_blocks(grid, (0.0,) * 3, centre := grid.middle_px + 20.0 * random.standard_normal(2))
        r, c = (np.arange(size)[:, None] for size in (960, 1440))
        squared = ((r - centre[0]) ** 2 + (c.T - centre[1]) ** 2) / grid.half_diagonal_px**2
        pixels = (1.0 + squared * np.tan(np.radians(degrees)) ** 2) ** -2
        light = pixels.reshape(len(exact.light), grid.block_px, -1, grid.block_px).mean((1, 3))
        noise = 3e-4 * np.sqrt(light)
        noisy = light + noise * random.standard_normal(light.shape)
        flat = replace(exact, light=noisy, standard_error=noise)
        found = fit_channel([flat], f_number=2.0, channel="g").fit.coefficient
        assert len(found.k) == terms
        # the farthest pixel's centre, which is half a pixel from the corner: .0005 of V at most
        off = abs(1.0 - found.corner_falloff - pixels.min())
        covered.append(off < 2.0 * found.corner_falloff_standard_uncertainty + 5e-4)
        assert off < largest + 5e-4
    assert sum(covered) >= 5


def test_a_knee_is_refused_by_the_light_that_it_leaves():
    exact = exact_blocks(grid_of(960, 1440), (0.0,) * 3, (479.5, 719.5))
    down, right = exact.places
    knee = replace(exact, light=1.0 - 0.6 / (1.0 + np.exp((0.9 - np.hypot(down, right)) / 0.01)))
    with pytest.raises(InputRejected, match=r"4\d\.\d% of the light is left in the block nearest"):
        fit_channel([knee], f_number=2.0, channel="g")


def test_light_that_turns_with_the_camera_is_found_out():
    blocks = exact_blocks(grid_of(320, 480), FALLOFFS[1.4], (171.0, 222.0), gradient=(0.02, 0.03))
    found = fit_channel([blocks] * 3, f_number=1.4, channel="G1", turns_deg=(0.0, 90.0, 180.0))
    assert found.not_turned
    assert found.solution.gradient == pytest.approx((0.02, 0.03), abs=1e-3)
    turned = fit_channel([blocks] * 3, f_number=1.4, channel="G1")
    assert turned.fit.coefficient == found.fit.coefficient


def test_the_budget_of_the_corner_adds_up(fitted):
    for each in fitted.channel_fits:
        total = sum(line.variance for line in each.corner_variances)
        assert total == pytest.approx(each.coefficient.corner_falloff_standard_uncertainty**2, rel=1e-6)
    wide, narrow = (of(fitted, f_number).corner_variances for f_number in (8.0, 1.4))
    assert [line.source for line in wide] == [line.source for line in narrow]
    assert {line.source: line.variance for line in wide}["centre of the falloff"] > 0.0


def test_the_centre_is_held_where_there_is_no_falloff():
    blocks = exact_blocks(grid_of(200, 300), (0.0, 0.0, 0.0), (100.0, 150.0))
    noisy = replace(
        blocks, light=blocks.light + 1e-3 * np.random.default_rng(1).standard_normal(blocks.light.shape)
    )
    found = solve_falloff(noisy)
    assert found.centre_held
    error = CENTRE_U * noisy.grid.half_diagonal_px
    assert found.centre_px == pytest.approx((99.5, 149.5), abs=2 * error)
    assert found.find_covariance_of_lens()[3, 3] > 0.2 * error**2
    fit = fit_channel([noisy], f_number=8.0, channel="grey").fit
    assert abs(fit.coefficient.corner_falloff) < 4 * fit.coefficient.corner_falloff_standard_uncertainty


def test_a_curve_that_does_not_fit_says_by_how_much():
    blocks = exact_blocks(grid_of(200, 300), (-0.3, 0.0, 0.0), (100.0, 150.0), error=1e-4)
    rings = 0.01 * np.cos(np.arange(blocks.light.shape[0]) * 2.0)[:, None]
    found = fit_channel([replace(blocks, light=blocks.light * (1 + rings))], f_number=2.0, channel="grey").fit
    assert found.coefficient.model_u_rel == pytest.approx(0.01 / np.sqrt(2), rel=0.1)
    assert found.birge_ratio > 10
    assert found.coefficient.corner_falloff_standard_uncertainty > 0.9 * found.coefficient.model_u_rel * 0.7


def test_frames_of_one_f_number_are_merged_whatever_their_level():
    lens = change(SMALL, cfa="grey", falloffs={2.0: FALLOFFS[2.0]})
    flats = [
        flat(lens, seed, 2.0, name=f"flat-{seed}", target=surface(level))
        for seed, level in ((1, 0.7), (2, 0.5), (3, 0.3))
    ]
    alone, together = vignetting.fit(flats[:1], NONE), vignetting.fit(flats, NONE)
    one, all_of = of(alone, 2.0).coefficient, of(together, 2.0).coefficient
    assert of(together, 2.0).frames == 3
    # shot noise: weights 0.7, 0.5, 0.3
    expected = (0.7 / 1.5) ** 0.5
    assert (
        all_of.corner_falloff_standard_uncertainty / one.corner_falloff_standard_uncertainty
        == pytest.approx(expected, rel=0.1)
    )
    off = all_of.corner_falloff - true_corner(lens, 2.0)
    assert abs(off) < 4 * all_of.corner_falloff_standard_uncertainty


def test_dark_frames_take_the_place_of_a_black_level_that_is_wrong():
    lens = change(SMALL, cfa="grey", falloffs={1.4: FALLOFFS[1.4]})
    shots = [flat(lens, 1), *(dark(lens, seed, name=f"dark-{seed}") for seed in (2, 3, 4))]
    wrong = [state_black(each, 0.0) for each in shots]
    with_darks, without = vignetting.fit(wrong, NONE), vignetting.fit(wrong[:1], NONE)
    truth = true_corner(lens, 1.4)
    found = of(with_darks, 1.4).coefficient
    assert abs(found.corner_falloff - truth) < 4 * found.corner_falloff_standard_uncertainty
    # 256 DN of black kept on 2687 DN of green: the falloff is too small by 256 / 2943
    assert of(without, 1.4).coefficient.corner_falloff == pytest.approx(truth * (1 - 256 / 2943), rel=0.02)
    assert flags_of(without.flags) == {"dark_from_black_level"}
    assert with_darks.flags == ()


def test_darks_of_another_time_are_used_and_flagged_and_of_another_iso_are_not():
    lens = change(SMALL, cfa="grey", falloffs={1.4: FALLOFFS[1.4]})
    slow, other = dark(lens, 2, name="slow", time_s=0.1), dark(lens, 3, name="other", iso=800.0)
    fit = vignetting.fit([flat(lens, 1), slow, other], NONE)
    assert flags_of(fit.flags) == {"dark_exposure_differs"}
    assert {point.frame: point.left_out for point in fit.points} == {
        "flat": "",
        "slow": "",
        "other": "no flat frame at ISO 800",
    }
    assert flags_of(vignetting.fit([flat(lens, 1), other], NONE).flags) == {"dark_from_black_level"}


def test_from_which_f_number_on(fitted):
    assert [round(true_corner(LENS, f), 3) for f in F_NUMBERS] == [0.57, 0.356, 0.094, 0.035]
    two, ten = fitted.thresholds
    assert (two.falloff, two.lowest_f_number, two.from_f_number, two.is_sure) == (0.02, None, None, True)
    # 9.4 % at f/4 is within two standard uncertainties of 10 %
    assert (ten.falloff, ten.lowest_f_number, ten.from_f_number, ten.is_sure) == (0.1, 4.0, 4.0, False)


def test_a_falloff_that_grows_again_is_said_and_ends_the_range():
    """As of the report's 6 mm lens: below 2 % at f/4, above it at f/8."""
    falloffs = {2.0: (-0.12, 0.0, 0.0), 4.0: (-0.012, 0.0, 0.0), 8.0: (-0.035, 0.0, 0.0)}
    lens = change(SMALL, cfa="grey", falloffs=falloffs)
    rows = [flat(lens, 7 + int(f), f, name=f"flat-{f:g}") for f in lens.lens.falloffs]
    fit = vignetting.fit(rows, NONE)
    two, ten = fit.thresholds
    assert (two.lowest_f_number, two.from_f_number) == (4.0, None)
    assert (ten.lowest_f_number, ten.from_f_number) == (4.0, 4.0)
    assert {r.where for r in fit.flags if r.flag == "falloff_grows"} == {"f/8 grey"}


def test_light_that_grows_outwards_is_said():
    lens = change(SMALL, cfa="grey", falloffs={2.0: (-0.3, 0.5, -0.1)})
    fit = vignetting.fit([flat(lens, 3, 2.0)], NONE)
    assert "falloff_not_monotonic" in flags_of(fit.flags)
    assert of(fit, 2.0).largest_falloff > of(fit, 2.0).coefficient.corner_falloff + 0.05


def test_a_dark_corner_is_no_falloff():
    lens = change(SMALL, cfa="grey", falloffs={1.4: (-0.71, 0.0, -0.1)})
    with pytest.raises(InputRejected, match="edge of the image circle") as refusal:
        vignetting.fit([flat(lens, 3)], NONE)
    assert refusal.value.code == "fit_failed"


def test_what_is_missing_is_named():
    waiting = replace(flat(SMALL, 1, name="late"), features=None)
    assert points.missing((), NONE) == (
        "no flat frame: photograph an even, format-filling surface at each f-number",
    )
    assert points.missing([waiting], NONE, unread=["new"]) == (
        "not read yet: frame new",
        "not extracted yet: frame late",
    )
    without = replace(flat(SMALL, 1, name="bare"), exposure=None)
    assert points.missing([without], NONE) == ("no exposure time, f-number and ISO: frame bare",)
    with pytest.raises(InputRejected, match="not extracted yet: frame late") as refusal:
        vignetting.fit([waiting], NONE)
    assert refusal.value.code == "fit_incomplete"


def test_an_excluded_frame_stays_in_the_record():
    rows = [flat(SMALL, 1, name="good"), flat(SMALL, 2, name="bad")]
    params = vignetting.Params(exclude=(Exclusion(frame="bad", reason="a bird", by="Ada"),))
    fit = vignetting.fit(rows, params)
    assert {point.frame: point.left_out for point in fit.points} == {
        "good": "",
        "bad": "excluded by Ada: a bird",
    }
    assert fit.channel_fits == vignetting.fit(rows[:1], NONE).channel_fits
