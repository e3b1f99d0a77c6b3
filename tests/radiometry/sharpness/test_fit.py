"""Frames of several positions merged: figures, falloff, what is left out, and what the field team is told."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings import InputRejected, shared
from radiometry.fitting.curve import coverage_factor
from radiometry.fitting.evidence import Exclusion
from radiometry.sharpness import fit as sharpness
from radiometry.sharpness import verdicts as sharpness_verdicts
from radiometry.sharpness.fit import list_coefficients
from radiometry.sharpness.positions import merge_estimates
from radiometry.sharpness.results import Estimate, Params, StarCentre, Target
from simulation.camera import change
from simulation.targets import CHART_STUDIO, Edge, Star
from tests.radiometry.evidence import taken
from tests.radiometry.sharpness.shots import EXPOSURE, extract, render_chart, row, seeded

# The corners' blur takes a quarter off MTF50, as the source found of its camera.
MIDDLE_PX, CORNER_PX = 0.72, 0.96
CAMERA = change(CHART_STUDIO, read_noise_e=40.0)
CHART = (
    Edge(name="centre", row0=80, col0=130, height=80, width=60, blur_px=MIDDLE_PX),
    Edge(name="top-left", row0=2, col0=2, height=60, width=90, blur_px=CORNER_PX, horizontal=True),
    Edge(name="bottom-right", row0=155, col0=255, height=80, width=60, blur_px=CORNER_PX),
)
REGIONS = [each.region for each in CHART]
PARAMS = Params(pixel_pitch_um=4.65)


def shoot(random, chart=CHART, camera=CAMERA):
    return extract(render_chart(camera, chart, random), REGIONS, camera=camera)


@pytest.fixture(scope="module")
def rows():
    random = seeded(2)
    return [row(f"frame-{n}", shoot(random)) for n in range(3)]


@pytest.fixture(scope="module")
def fitted(rows):
    return sharpness.fit(rows, PARAMS)


def flags_of(fit):
    return {(each.flag, each.where) for each in fit.flags}


def test_every_position_has_the_figures_of_the_contract(fitted):
    figures = {(each.model, each.name): each for each in list_coefficients(fitted)}
    for position, blur_px in (("centre", MIDDLE_PX), ("top-left", CORNER_PX), ("bottom-right", CORNER_PX)):
        model = f"slanted_edge:{position}"
        for name, unit, truth in (
            ("mtf50_cycles_per_pixel", "cycles/px", 0.187390 / blur_px),
            ("edge_rise_10_90_px", "px", 2.5631 * blur_px),
            ("lsf_fwhm_px", "px", 2.3548 * blur_px),
            ("mtf50_lp_per_mm", "lp/mm", 0.187390 / blur_px / 0.00465),
            ("mtf50_lp_per_ph", "LP/PH", 0.187390 / blur_px * 240),
            ("mtf50_lw_per_ph", "LW/PH", 0.187390 / blur_px * 480),
        ):
            figure = figures[model, name]
            assert (figure.unit, figure.channel, figure.f_number) == (unit, "grey", 4.0)
            assert figure.value == pytest.approx(truth, rel=0.01, abs=4 * figure.standard_uncertainty)
            assert 0 < figure.standard_uncertainty < 0.02 * truth
        assert figures[model, "mtf_nyquist"].value == pytest.approx(
            math.exp(-((math.pi * blur_px) ** 2) / 2), abs=0.01
        )
        assert 0 <= figures[model, "overshoot"].value < 0.02


def test_the_falloff_is_a_quarter_and_its_uncertainty_follows_from_its_parts(fitted):
    (table,) = fitted.falloff
    assert (table.centre, set(table.corners)) == (("centre",), {"top-left", "bottom-right"})
    for each in table.rows:
        assert each.ratio.value == pytest.approx(0.75, abs=4 * each.ratio.standard_uncertainty)
    found = {each.position: each.find("mtf50_cycles_per_pixel").quantity for each in fitted.positions}
    middle, one, two = found["centre"], found["top-left"], found["bottom-right"]
    corner = (one.value + two.value) / 2
    u_corner = math.hypot(one.standard_uncertainty, two.standard_uncertainty) / 2
    u_rel = math.hypot(u_corner / corner, middle.standard_uncertainty / middle.value)
    quantity = table.corner_falloff
    assert quantity.value == pytest.approx(1 - corner / middle.value)
    assert quantity.value == pytest.approx(0.25, abs=3 * quantity.standard_uncertainty)
    assert quantity.standard_uncertainty == pytest.approx(corner / middle.value * u_rel)
    parts = [each.find("mtf50_cycles_per_pixel").effective_dof for each in fitted.positions]
    assert min(parts) <= table.corner_falloff_dof <= sum(parts)
    (figure,) = [each for each in list_coefficients(fitted) if each.name == "corner_falloff"]
    assert (figure.model, figure.unit, figure.value) == ("slanted_edge", "1", quantity.value)


def test_repeats_are_averaged_with_the_larger_of_scatter_and_noise():
    close = [Estimate(value=v, standard_uncertainty=0.03) for v in (1.0, 1.01, 0.99)]
    assert merge_estimates(close, dof=7) == pytest.approx((1.0, 0.03 / math.sqrt(3), 0.01, 21))
    apart = [Estimate(value=v, standard_uncertainty=0.03) for v in (0.9, 1.0, 1.1)]
    assert merge_estimates(apart, dof=7) == pytest.approx((1.0, 0.1 / math.sqrt(3), 0.1, 2))
    assert merge_estimates(close[:1], dof=7) == (1.0, 0.03, None, 7)


def test_repeats_with_students_factor_cover_the_truth():
    """Two and three frames, with and without a scatter beyond noise; k = 2 would cover 85 % of the former."""
    random = np.random.default_rng(11)
    for count, scatter in itertools.product((2, 3), (0.0, 0.06)):
        inside = 0
        for _ in range(400):
            u = 0.02 * np.sqrt(random.chisquare(7, count) / 7)
            values = 1.0 + math.hypot(0.02, scatter) * random.standard_normal(count)
            frames = [Estimate(value=v, standard_uncertainty=e) for v, e in zip(values, u, strict=True)]
            mean, error, _, dof = merge_estimates(frames, dof=7)
            inside += abs(mean - 1.0) < coverage_factor(dof) * error
        assert 0.91 < inside / 400 < 0.999


def test_the_order_of_the_frames_changes_nothing(rows, fitted):
    for order in itertools.permutations(rows):
        assert sharpness.fit(order, PARAMS) == fitted


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"edge_order": 0}, "edge_order must lie between 1 and 5"),
        ({"edge_order": 6}, "edge_order must lie between 1 and 5"),
        ({"cycles": 2}, "cycles must lie between 4 and 1000"),
        ({"kind": "eye_chart"}, "kind must be one of slanted_edge, siemens_star"),
        ({"gamma": math.nan}, "gamma must lie between 0.2 and 5.0"),
        ({"tone_curve": "log"}, "tone_curve must be one of linear, srgb, gamma"),
        (
            {"centres": (StarCentre(region="a", x_px=math.inf, y_px=0.0),)},
            "x_px and y_px of centres must be finite numbers",
        ),
    ],
)
def test_a_target_that_cannot_be_is_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        Target(**wrong)


def test_points_carry_every_frame_and_region(fitted):
    assert len(fitted.points) == 9
    for point in fitted.points:
        assert (point.used, point.left_out) == (True, "")
        assert abs(point.residual_rel) < 0.02
    residuals = [p.residual_rel for p in fitted.points if p.position == "centre"]
    assert sum(residuals) == pytest.approx(0.0, abs=1e-12)


def test_an_excluded_frame_counts_no_more(rows, fitted):
    params = replace(PARAMS, exclude=(Exclusion(frame="frame-1", reason="touched", by="ann"),))
    without = sharpness.fit(rows, params)
    left = {point.frame for point in without.points if not point.used}
    assert left == {"frame-1"}
    assert {point.left_out for point in without.points} == {"", "excluded by ann: touched"}
    assert [each.frames for each in without.positions] == [2, 2, 2]
    assert without.positions == sharpness.fit([rows[0], rows[2]], PARAMS).positions
    assert without.positions != fitted.positions


def test_other_f_numbers_are_other_rows(rows):
    open_wide = replace(EXPOSURE, f_number=2.0)
    fit = sharpness.fit([*rows[:2], replace(rows[2], exposure=open_wide)], PARAMS)
    assert {(each.position, each.f_number, each.frames) for each in fit.positions} == {
        (position, f_number, count)
        for position in ("centre", "top-left", "bottom-right")
        for f_number, count in ((2.0, 1), (4.0, 2))
    }
    assert [table.f_number for table in fit.falloff] == [2.0, 4.0]
    unknown = sharpness.fit([replace(each, exposure=None) for each in rows], PARAMS)
    assert {each.f_number for each in unknown.positions} == {None}


def test_what_is_missing_is_named(rows):
    waiting = replace(rows[0], features=None)
    undrawn = replace(rows[1], features=None, has_region=False)
    assert sharpness.missing([], PARAMS)[0].startswith("no chart frame that can be used")
    assert sharpness.missing([], PARAMS, unread=["a"]) == ("not read yet: frame a",)
    assert sharpness.missing(rows, PARAMS) == ()
    assert sharpness.missing([waiting, undrawn], PARAMS) == (
        "no region: frame-1",
        "not extracted yet: frame-0",
    )
    with pytest.raises(InputRejected, match="frame-0") as refused:
        sharpness.fit([waiting, *rows[1:]], PARAMS)
    assert refused.value.code is shared.FIT_INCOMPLETE


# --- flags


def test_a_good_campaign_has_no_flag(fitted):
    assert flags_of(fitted) == set()


def test_a_single_frame_is_flagged(rows):
    fit = sharpness.fit(rows[:1], PARAMS)
    assert ("sharpness_once", "position centre") in flags_of(fit)
    figure = next(each for each in list_coefficients(fit) if each.model == "slanted_edge:centre")
    assert figure.flags == ("sharpness_once",)


def test_a_region_that_cannot_be_used_is_left_out_with_its_reason(rows):
    straight = replace(CHART[2], angle_deg=0.5)
    bad = row("frame-3", shoot(seeded(), (*CHART[:2], straight)))
    fit = sharpness.fit([*rows, bad], PARAMS)
    assert ("region_left_out", "frame frame-3") in flags_of(fit)
    (point,) = [each for each in fit.points if not each.used]
    assert (point.frame, point.position, point.value) == ("frame-3", "bottom-right", None)
    assert "0.5 degrees" in point.left_out


@pytest.fixture(scope="module")
def shaken():
    chart = tuple(replace(each, blur_px=each.blur_px * 1.3) for each in CHART)
    return row("shaken", shoot(seeded(), chart))


def test_rendered_frames_are_flagged():
    camera = change(CAMERA, cfa="rgb", bright_dn=12000.0)
    fit = sharpness.fit([row("a", shoot(seeded(), camera=camera))], PARAMS)
    assert ("rendered", "") in flags_of(fit)
    assert {each.channel for each in fit.positions} == {"R", "G", "B", "luminance"}
    assert len(fit.falloff) == 4


def change_edges(one, **changes):
    regions = tuple(
        replace(region, edges=tuple(replace(edge, **changes) for edge in region.edges))
        for region in one.features.regions
    )
    return replace(one, features=replace(one.features, regions=regions))


@pytest.mark.parametrize(
    ("flag", "changes", "beside"),
    [
        ("sharpening_suspected", {"overshoot": Estimate(value=0.06, standard_uncertainty=0.003)}, 0.057),
        ("edge_curved", {"departure_px": 0.26}, None),
    ],
)
def test_what_the_edges_show_is_flagged(rows, flag, changes, beside):
    fit = sharpness.fit([change_edges(rows[0], **changes)], PARAMS)
    assert (flag, "position centre") in flags_of(fit)
    if beside is not None:
        calm = change_edges(rows[0], overshoot=Estimate(value=beside, standard_uncertainty=0.003))
        assert (flag, "position centre") not in flags_of(sharpness.fit([calm], PARAMS))


def test_an_edge_sharper_than_the_curve_has_no_mtf50(rows):
    fit = sharpness.fit([change_edges(rows[0], mtf50=None)], PARAMS)
    assert ("sharpness_beyond_curve", "position centre") in flags_of(fit)
    names = {each.name for each in list_coefficients(fit)}
    assert "mtf50_cycles_per_pixel" not in names
    assert "edge_rise_10_90_px" in names
    assert fit.falloff == ()


def test_corners_alone_have_nothing_to_be_compared_with(rows):
    def cut(one):
        return replace(one, features=replace(one.features, regions=one.features.regions[1:]))

    fit = sharpness.fit([cut(each) for each in rows], PARAMS)
    assert fit.falloff == ()
    assert ("sharpness_centre_missing", "") in flags_of(fit)
    assert any(
        "middle" in sentence for sentence in sharpness_verdicts.plan([cut(each) for each in rows], PARAMS)
    )


# --- stars


def test_stars_have_their_own_figures():
    camera = change(CHART_STUDIO, height_px=200, width_px=200)
    star = Star(name="centre", row0=8, col0=8, size=184, centre_row_px=100.0, centre_col_px=99.0, cycles=36)
    target = Target(kind="siemens_star", cycles=36)
    features = extract(render_chart(camera, [star], seeded()), [star.region], camera=camera, target=target)
    fit = sharpness.fit([row("a", features)], Params(star_contrast=0.2, pixel_pitch_um=5.0))
    figures = {each.name: each for each in list_coefficients(fit)}
    power = figures["resolving_power_cycles_per_pixel"]
    assert power.model == "siemens_star:centre"
    assert power.value == pytest.approx(math.sqrt(-math.log(0.2 * 0.966) / 2) / (math.pi * 0.7), rel=0.02)
    across = figures["unresolved_diameter_px"]
    assert across.value == pytest.approx(36 / (math.pi * power.value))
    assert across.standard_uncertainty / across.value == pytest.approx(
        power.standard_uncertainty / power.value
    )
    assert figures["resolving_power_lp_per_mm"].value == pytest.approx(power.value / 0.005)
    (position,) = fit.positions
    assert len(position.curves) == 9
    assert len(position.directions) == 8
    assert position.curves[0].direction_deg is None
    # a second frame with every other ring: its curve is read off at the frequencies of the first
    (region,) = features.regions
    (response,) = region.stars
    whole, *sectors = (
        replace(each, contrast=each.contrast[::2], contrast_u=each.contrast_u[::2])
        for each in (response.whole, *response.sectors)
    )
    other = replace(response, frequency=response.frequency[::2], whole=whole, sectors=tuple(sectors))
    again = replace(features, regions=(replace(region, stars=(other,)),))
    (both,) = sharpness.fit([row("a", features), row("b", again)], Params(star_contrast=0.2)).positions
    for curve, merged in zip(position.curves, both.curves, strict=True):
        assert merged.response[::2] == pytest.approx(curve.response[::2])
        assert merged.response_u[::2] == pytest.approx(np.array(curve.response_u[::2]) / math.sqrt(2))


# --- on site


def verdicts(rows):
    found = sharpness_verdicts.judge([taken(each) for each in rows], rows, PARAMS)
    return {name: (each.outcome, {reason.code for reason in each.reasons}) for name, each in found.items()}


def test_a_shaken_frame_is_told_by_its_repeats(rows, shaken):
    good = {each.frame: ("pass", set()) for each in rows}
    assert verdicts(rows) == good
    assert verdicts([*rows, shaken]) == {**good, "shaken": ("warn", {"blurred"})}
    assert ("sharpness_repeats_differ", "position centre") in flags_of(sharpness.fit([*rows, shaken], PARAMS))


def test_an_unusable_region_warns():
    bad = row("bad", shoot(seeded(), (*CHART[:2], replace(CHART[2], angle_deg=0.5))))
    found = sharpness_verdicts.judge([taken(bad)], [bad], PARAMS)["bad"]
    assert found.outcome == "warn"
    assert found.reasons[0].code == "chart_unusable"
    assert found.reasons[0].detail.startswith("Region bottom-right: The edge leans 0.5 degrees")


def test_a_plan_says_what_would_be_good(rows):
    assert sharpness_verdicts.plan(rows, PARAMS) == ()
    assert sharpness_verdicts.plan([], PARAMS) == ()
    (few,) = [each for each in sharpness_verdicts.plan(rows[:2], PARAMS) if "centre" in each]
    assert few == "position centre has 2 usable frames: add 1 for its repeatability"
    (pitch,) = sharpness_verdicts.plan(rows, Params())
    assert pitch == "no pixel pitch: nothing can be said in line pairs per millimetre"
    assert pitch.finding.code == "pixel_pitch_missing"
    upright = [change_edges(each, orientation="vertical") for each in rows]
    assert any("add a horizontal one" in each for each in sharpness_verdicts.plan(upright, PARAMS))


def set_mtf50(one, value, u):
    return change_edges(one, mtf50=Estimate(value=value, standard_uncertainty=u))


@pytest.mark.parametrize(
    ("value", "u", "blurred"), [(0.17, 0.002, True), (0.19, 0.002, False), (0.17, 0.02, False)]
)
def test_a_frame_is_blurred_only_beyond_a_tenth_and_its_noise(rows, value, u, blurred):
    """Against 0.2: a tenth is 0.02, three standard uncertainties of the difference are 4.24 u."""
    found = verdicts([set_mtf50(rows[0], 0.2, u), set_mtf50(rows[1], value, u)])
    assert found["frame-1"] == (("warn", {"blurred"}) if blurred else ("pass", set()))


def test_picture_height_is_the_shorter_side_however_the_camera_is_held(rows):
    upright = [replace(each, features=replace(each.features, height_px=320, width_px=240)) for each in rows]
    found = [sharpness.fit(each, PARAMS).positions[0] for each in (rows, upright)]
    first, second = (each.find("mtf50_lp_per_ph").quantity for each in found)
    assert first == second
    assert first.value == pytest.approx(240 * found[0].find("mtf50_cycles_per_pixel").quantity.value)
