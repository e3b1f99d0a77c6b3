"""What is wrong with a flat frame is found before a fit, named with its frame, and says what to do."""

import math
from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.fitting.evidence import Exclusion, Region
from radiometry.frame.packing import unpack
from radiometry.frame.roi import Polygon, Window, mask
from radiometry.vignetting import fit as vignetting
from radiometry.vignetting import lens as vignetting_lens
from radiometry.vignetting import verdicts as vignetting_verdicts
from radiometry.vignetting.lens import require_format
from simulation.camera import change
from simulation.targets import FAST_LENS, Picture
from tests.radiometry.evidence import taken
from tests.radiometry.vignetting.flats import NONE, SMALL, coefficient, dark, flags_of, flat, surface

DARKS = [dark(SMALL, seed, name=f"dark-{seed}") for seed in (91, 92, 93)]


def fit(*rows):
    return vignetting.fit([*rows, *DARKS], NONE)


def fit_alone(row):
    return vignetting.fit([row], NONE)


def refuse(*rows):
    with pytest.raises(InputRejected) as refusal:
        fit(*rows)
    assert refusal.value.code == "flat_unusable"
    return refusal.value.message


def judge(*rows):
    return vignetting_verdicts.judge([taken(each, region=None) for each in rows], rows, NONE)


def reasons(verdict):
    return [reason.code for reason in verdict.reasons]


def test_a_clipped_flat_is_left_out_and_named():
    clipped = flat(SMALL, 1, name="bright", target=surface(1.02))
    message = refuse(clipped)
    assert "bright: " in message
    assert "of channel G" in message
    assert "expose less" in message
    both = fit(clipped, flat(SMALL, 2, name="good"))
    assert [point.used for point in both.points if point.role == "flat"] == [False, True]
    assert [(r.flag, r.where) for r in both.flags] == [("flat_left_out", "frame bright")]
    assert next(point for point in both.points if point.frame == "bright").saturated_share > 0.001


def test_too_little_signal_is_refused_and_little_is_flagged():
    # blue is at 0.7 of green: 1.4 % and 5.6 % of the span, times a median V of 0.87
    assert "faint: the light of channel" in refuse(flat(SMALL, 1, name="faint", target=surface(0.02)))
    weak = fit(flat(SMALL, 1, name="weak", target=surface(0.08)))
    assert flags_of(weak.flags) == {"weak_flat"}
    assert fit(flat(SMALL, 1)).flags == ()


@pytest.mark.parametrize(
    ("gradient", "towards"),
    [((0.12, 0.0), "bottom"), ((-0.12, 0.02), "top"), ((0.0, 0.12), "right"), ((0.0, -0.12), "left")],
)
def test_strongly_uneven_light_is_refused_with_its_direction(gradient, towards):
    message = refuse(flat(SMALL, 1, name="slope", target=surface(gradient=gradient)))
    assert "slope: the light of channel G" in message
    assert f"brighter towards the {towards}" in message


def test_a_centre_that_a_plane_explains_as_well_is_flagged():
    """A faint falloff under uneven light: without the plane the centre would lie near a border."""
    faint = {"falloffs": {8.0: (-0.03, 0.0, 0.0)}, "gain_dn_per_e": 2.0, "read_noise_e": 1.0}
    lens = change(SMALL, cfa="grey", centre_px=None, **faint)
    found = vignetting.fit([flat(lens, 3, 8.0, target=surface(gradient=(0.0, 0.012)))], NONE)
    assert "centre_uncertain" in flags_of(found.flags)


def test_dust_is_found_where_it_lies_and_left_out():
    dust = surface(spots=[(52.0, 200.0, 7.0, 0.3), (120.0, 60.0, 6.0, 0.5)])
    spoilt = fit(flat(SMALL, 1, target=dust))
    point = next(point for point in spoilt.points if point.frame == "flat")
    assert point.used
    places = {(round(spot.row_px / 8), round(spot.col_px / 8)) for spot in point.spots}
    assert len(point.spots) <= 20
    for row, col in ((52, 200), (120, 60)):
        assert any(abs(8 * r - row) <= 8 and abs(8 * c - col) <= 8 for r, c in places)
    assert all(min(abs(s.row_px - 52), abs(s.row_px - 120)) < 20 for s in point.spots)
    assert flags_of(spoilt.flags) == {"dust"}
    clean, found = (each.coefficients[1] for each in (fit(flat(SMALL, 1)), spoilt))
    off = found.corner_falloff - clean.corner_falloff
    assert abs(off) < 2 * clean.corner_falloff_standard_uncertainty


def wide_surface(height_px, width_px, *, spot=None):
    """Light of a lens of 88 degrees, cos^4 of the angle: .27 in the corners, which no three terms follow."""
    rows, cols = np.ogrid[:height_px, :width_px]
    squared = (rows - (height_px - 1) / 2) ** 2 + (cols - (width_px - 1) / 2) ** 2
    light = (
        0.7
        / (1.0 + squared * (math.tan(math.radians(44.0)) / math.hypot(height_px, width_px) * 2.0) ** 2) ** 2
    )
    if spot:
        light = np.where(np.hypot(rows - spot[0], cols - spot[1]) < 12.0, 0.9 * light, light)
    return Picture(shares=light)


@pytest.mark.parametrize(("height", "width"), [(514, 642), (912, 1368)])
def test_a_clean_flat_has_no_dust_in_blocks_that_the_border_cuts_nor_in_dark_corners(height, width):
    camera = change(FAST_LENS, height_px=height, width_px=width, centre_px=None, falloffs={})
    assert "dust" not in flags_of(fit_alone(flat(camera, 1, target=wide_surface(height, width))).flags)


@pytest.mark.parametrize("spot", [(896.0, 30.0), (905.0, 700.0)])
def test_dust_is_found_in_the_dark_corner_of_a_wide_lens_and_at_the_border(spot):
    camera = change(FAST_LENS, height_px=912, width_px=1368, centre_px=None, falloffs={})
    (point,) = fit_alone(flat(camera, 1, target=wide_surface(912, 1368, spot=spot))).points
    assert 1 <= len(point.spots) <= 6
    assert all(math.hypot(each.row_px - spot[0], each.col_px - spot[1]) < 30.0 for each in point.spots)


def test_the_residual_map_does_not_know_what_was_left_out():
    target = surface(spots=((60.0, 100.0, 6.0, 0.3),))
    fits = vignetting.fit([flat(SMALL, 1, 2.0, target=target)], NONE).channel_fits
    found = vignetting_lens.find_fit(fits, f_number=2.0, channel="G1")
    residuals = unpack(found.residuals)
    row, col = (int(place // found.block_px) for place in (60.0, 100.0))
    assert np.isnan(residuals[row, col])
    assert 0 < np.isnan(residuals).sum() < 10
    assert np.sqrt(np.nanmean(residuals**2)) == pytest.approx(found.residual_rms_rel, rel=1e-3)
    with pytest.raises(InputRejected, match=r"at f/2.8, channel G1; there are f/2 R, f/2 G1"):
        vignetting_lens.find_fit(fits, f_number=2.8, channel="G1")


def test_a_pattern_on_the_target_is_refused():
    dots = [(r, c, 6.0, 0.4) for r in range(20, 190, 36) for c in range(20, 280, 36)]
    assert "of its blocks are spots" in refuse(flat(SMALL, 1, name="dots", target=surface(spots=dots)))


def test_another_picture_size_is_left_out():
    crop = change(FAST_LENS, height_px=160, width_px=288)
    found = fit(flat(SMALL, 1, name="a"), flat(SMALL, 2, name="b"), flat(crop, 3, name="crop"))
    assert found.height_px == 192
    (left,) = [point for point in found.points if not point.used]
    assert left.frame == "crop"
    assert "another picture size" in left.left_out


def test_flats_of_two_lenses_are_refused():
    other = flat(SMALL, 2, name="other")
    other = replace(other, header=replace(other.header, lens_model="9 mm"))
    assert "several lenses: 9 mm, unnamed lens" in refuse(flat(SMALL, 1, name="one"), other)


def test_too_small_a_region_is_refused():
    small = Region(name="", polygon=Polygon.from_points([(96, 96), (128, 96), (128, 128), (96, 128)]))
    assert "only 16 blocks" in refuse(flat(SMALL, 1, regions=[small]))


def test_verdicts_say_the_same_as_the_fit():
    cases = {
        "good": ({}, "pass", []),
        "bright": ({"target": surface(1.02)}, "fail", ["clipped"]),
        "faint": ({"target": surface(0.02)}, "fail", ["too_dark"]),
        "weak": ({"target": surface(0.08)}, "warn", ["weak_signal"]),
        "slope": ({"target": surface(gradient=(0.12, 0.0))}, "fail", ["uneven"]),
        "tilted": ({"target": surface(gradient=(0.0, 0.04))}, "warn", ["uneven"]),
        "dusty": ({"target": surface(spots=[(52.0, 200.0, 7.0, 0.3)])}, "warn", ["dust"]),
    }
    rows = [flat(SMALL, 1, name=name, **how) for name, (how, _, _) in cases.items()]
    lit = flat(SMALL, 5, name="lit", target=surface(0.3), role="dark")
    verdicts = judge(*rows, *DARKS, replace(lit, exposure=replace(lit.exposure, iso=800.0)))
    for name, (_, outcome, codes) in cases.items():
        assert (verdicts[name].outcome, reasons(verdicts[name])) == (outcome, codes), name
    assert verdicts["dark-91"].outcome == "pass"
    assert (verdicts["lit"].outcome, reasons(verdicts["lit"])) == ("fail", ["dark_not_dark"])


def test_a_frame_that_waits_is_pending_and_an_excluded_one_is_not_judged():
    row = replace(flat(SMALL, 1), features=None)
    waiting = vignetting_verdicts.judge([taken(row, state="read")], [row], NONE)
    assert reasons(waiting["flat"]) == ["not_extracted"]
    bright = flat(SMALL, 1, target=surface(1.02))
    params = vignetting.Params(exclude=(Exclusion(frame="flat", reason="clipped", by="Ada"),))
    assert vignetting_verdicts.judge([taken(bright)], [bright], params)["flat"].outcome == "pass"


def test_the_plan_says_what_to_add():
    rows = [flat(SMALL, n, 1.4, name=f"wide-{n}") for n in (1, 2, 3)]
    assert vignetting_verdicts.plan([*rows, *DARKS], NONE) == (
        "only f/1.4: frames at other f-numbers cannot be corrected",
    )
    found = vignetting_verdicts.plan([*rows, flat(SMALL, 4, 4.0, name="far"), DARKS[0]], NONE)
    assert found == (
        "ISO 100 has 1 dark frame: add 2",
        "f/4 has 1 usable flat frame: add 2 more",
        "f/1.4 and f/4 are more than a stop apart: add one between",
    )
    clipped = flat(SMALL, 1, name="bright", target=surface(1.02))
    (again,) = vignetting_verdicts.plan([clipped], NONE)
    assert again.startswith("take again: frame bright (")
    assert "no dark frames at ISO 100: add 3 with the lens covered" in vignetting_verdicts.plan(rows, NONE)
    full = [flat(SMALL, n, f, name=f"{f:g}-{n}") for f in (1.4, 2.0) for n in (1, 2, 3)]
    assert vignetting_verdicts.plan([*full, *DARKS], NONE) == ()


def test_a_rendered_flat_is_flagged():
    row = flat(SMALL, 1)
    row = replace(row, header=replace(row.header, rendered=True))
    assert flags_of(fit(row).flags) == {"rendered"}


# --- V between f-numbers and over regions, against figures worked out by hand; a frame that it corrects


AT_2 = coefficient()
AT_4 = coefficient(f_number=4.0, k1=-0.1, k2=0.0)
PAIR = (AT_2, AT_4)
# 150 px to the right of the centre: r^2 = 0.36
PLACE = np.array(100.0), np.array(350.0)
V_2, V_4 = 1 - 0.4 * 0.36 + 0.1 * 0.36**2, 1 - 0.1 * 0.36


def evaluate(coefficients=PAIR, *, f_number, channel="G1", place=PLACE):
    return vignetting_lens.evaluate(coefficients, *place, channel=channel, f_number=f_number)


def test_v_and_its_uncertainty_at_a_calibrated_f_number():
    found = evaluate(f_number=2.0)
    assert float(found.share) == pytest.approx(V_2, rel=1e-12)
    # variances of 1e-4 on k1, k2, k3 and both coordinates; dV/dcol = -(2 b / R)(k1 + 2 k2 r^2), b = 0.6
    by_col = 2 * 0.6 / 250 * (0.4 - 0.2 * 0.36)
    expected = 1e-2 * math.sqrt(0.36**2 + 0.36**4 + 0.36**6 + by_col**2)
    assert float(found.standard_uncertainty) == pytest.approx(expected, rel=1e-9)
    assert float(found.gain) == pytest.approx(1 / V_2)


def test_misfit_adds_to_the_uncertainty():
    rough = replace(AT_2, model_u_rel=0.02)
    plain, added = (evaluate((each,), f_number=2.0).standard_uncertainty for each in (AT_2, rough))
    assert float(added) == pytest.approx(math.hypot(plain, 0.02 * V_2))


def test_between_f_numbers_v_is_linear_in_stops():
    half = evaluate(f_number=2.0 * math.sqrt(2.0))
    assert float(half.share) == pytest.approx((V_2 + V_4) / 2, rel=1e-12)
    ends = [float(evaluate(f_number=f).standard_uncertainty) for f in (2.0, 4.0)]
    between = (V_4 - V_2) / (2 * math.sqrt(3))
    assert float(half.standard_uncertainty) == pytest.approx(math.hypot(ends[0] / 2, ends[1] / 2, between))
    third = evaluate(f_number=2.0 * 2 ** (1 / 4))
    assert float(third.share) == pytest.approx(0.75 * V_2 + 0.25 * V_4, rel=1e-12)


@pytest.mark.parametrize("f_number", [1.99, 4.01])
def test_outside_the_range_is_refused(f_number):
    with pytest.raises(InputRejected, match=r"outside the calibrated range, f/2 to f/4") as refusal:
        evaluate(f_number=f_number)
    assert refusal.value.code == "vignetting_not_calibrated"


def test_an_unknown_channel_and_another_size_are_refused():
    with pytest.raises(InputRejected, match="no channel B; it has G1"):
        evaluate(f_number=2.0, channel="B")
    require_format(PAIR, height_px=300, width_px=400)
    with pytest.raises(InputRejected, match=r"The frame is 300 x 400 pixels, .* with 400 x 300"):
        require_format(PAIR, height_px=400, width_px=300)


def test_a_signal_s_channels():
    channels = [replace(AT_2, channel=name) for name in ("R", "G1", "G2", "B")]
    assert vignetting_lens.select_channels(channels, signal="green") == ("G1", "G2")
    assert vignetting_lens.select_channels(channels, signal="grey") == ("R", "G1", "G2", "B")
    band = [replace(AT_2, channel="red_edge")]
    assert vignetting_lens.select_channels(band, signal="green") == ("red_edge",)


@pytest.mark.parametrize("cfa", ["grey", "rgb", "GRBG"])
def test_a_correction_made_in_bands_is_one_over_v_everywhere(cfa):
    """Taller than a band, and between two f-numbers."""
    names = {"grey": ("grey",), "rgb": ("R", "G", "B"), "GRBG": ("G1", "R", "B", "G2")}[cfa]
    pair = [
        replace(each, channel=name, k1=each.k1 * (1 + 0.1 * number))
        for number, name in enumerate(names)
        for each in PAIR
    ]
    gains = vignetting_lens.compute_correction(pair, cfa=cfa, f_number=3.0)
    rows, cols = np.mgrid[:300, :400].astype(float)
    for number, name in enumerate(names):
        expected = vignetting_lens.evaluate(pair, rows, cols, channel=name, f_number=3.0).gain
        site = (slice(number // 2, None, 2), slice(number % 2, None, 2)) if cfa == "GRBG" else ()
        found = gains[..., number] if cfa == "rgb" else gains
        np.testing.assert_allclose(found[site], expected[site], rtol=3e-7)


def test_mean_over_a_region_is_that_of_its_pixels():
    polygon = Polygon.from_points([(40, 20), (340, 10), (380, 290), (60, 280)])
    other = [replace(each, channel="G2", k1=each.k1 - 0.05) for each in PAIR]
    found = vignetting_lens.average_over_polygon(
        (*PAIR, *other), polygon, channels=("G1", "G2"), f_number=2.5
    )
    inside = mask(polygon, Window(row0=0, col0=0, height=300, width=400))
    rows, cols = (each.astype(float) for each in np.nonzero(inside))
    means = [
        vignetting_lens.evaluate((*PAIR, *other), rows, cols, channel=channel, f_number=2.5).share.mean()
        for channel in ("G1", "G2")
    ]
    assert found.value == pytest.approx(np.mean(means), rel=1e-12)
    assert found.unit == "1"


def test_uncertainty_of_a_mean_does_not_average_out():
    """All pixels share the parameters' errors: a region's u is that of a place, not over sqrt(n)."""
    tiny = Polygon.from_points([(350, 100), (351, 100), (351, 101), (350, 101)])
    alone = vignetting_lens.average_over_polygon(PAIR, tiny, channels=("G1",), f_number=2.0)
    here = evaluate(f_number=2.0)
    assert alone.value == pytest.approx(float(here.share))
    assert alone.standard_uncertainty == pytest.approx(float(here.standard_uncertainty))
    around = Polygon.from_points([(330, 80), (371, 80), (371, 121), (330, 121)])
    wide = vignetting_lens.average_over_polygon(PAIR, around, channels=("G1",), f_number=2.0)
    assert wide.standard_uncertainty == pytest.approx(alone.standard_uncertainty, rel=0.05)
    twin = replace(AT_2, channel="G2")
    both = vignetting_lens.average_over_polygon((AT_2, twin), tiny, channels=("G1", "G2"), f_number=2.0)
    assert both.standard_uncertainty == pytest.approx(alone.standard_uncertainty / math.sqrt(2))
    half = vignetting_lens.average_over_polygon(PAIR, tiny, channels=("G1",), f_number=2.0 * math.sqrt(2.0))
    assert half.standard_uncertainty == pytest.approx(
        float(evaluate(f_number=2.0 * math.sqrt(2.0)).standard_uncertainty)
    )
