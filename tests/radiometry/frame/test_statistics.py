"""Statistics of a region: exact figures, the right CFA site, and the signal."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from radiometry.frame.grid import find_homography
from radiometry.frame.statistics import compute_statistics, measure_signal
from radiometry.frame.verdicts import inspect_black
from radiometry.noise import fit as noise
from radiometry.road.lanes import LaneGrid, describe_lanes, lay_lanes
from radiometry.vignetting import fit as vignetting
from simulation.camera import change
from tests.radiometry.frames import frame_of
from tests.radiometry.noise.series import PARAMS, SMALL, brightened, take
from tests.radiometry.vignetting import flats

SITES = {"RGGB": "R G1 G2 B", "GRBG": "G1 R B G2", "GBRG": "G2 B R G1", "BGGR": "B G2 G1 R"}


def frame(samples, *, cfa="RGGB", row0=0, col0=0, black=(0.0,), white=(4095.0,)):
    return frame_of(samples, cfa=cfa, row0=row0, col0=col0, size=(100, 100), black=black, white=white)


def all_of(a_frame):
    return np.ones(a_frame.samples_dn.shape[:2], bool)


def by_channel(a_frame, inside=None):
    rows = compute_statistics(a_frame, all_of(a_frame) if inside is None else inside)
    return {row.channel: row for row in rows}


def test_by_hand():
    row = by_channel(frame([[1, 4, 4, 7]], cfa="grey", white=(7.0,)))["grey"]
    assert (row.n, row.min_dn, row.max_dn, row.mean_dn, row.median_dn) == (4, 1, 7, 4.0, 4.0)
    assert row.std_dn == math.sqrt((9 + 0 + 0 + 9) / 3)
    assert (row.saturated_share, row.zero_share) == (0.25, 0.0)
    # an even count takes the mean of the middle two, and a single sample has no spread
    row = by_channel(frame([[0, 2, 5, 9]], cfa="grey"))["grey"]
    assert (row.median_dn, row.zero_share) == (3.5, 0.25)
    assert by_channel(frame([[9]], cfa="grey"))["grey"].std_dn == 0.0


@pytest.mark.parametrize("cfa", SITES)
@pytest.mark.parametrize("row0", [0, 1, 7])
@pytest.mark.parametrize("col0", [0, 1, 4])
def test_sites_are_counted_from_the_visible_corner(cfa, row0, col0):
    """A mosaic whose samples tell their site, cut anywhere: each channel sees its own number only."""
    whole = np.tile([[10, 20], [30, 40]], (10, 10))
    window = frame(whole[row0 : row0 + 5, col0 : col0 + 5], cfa=cfa, row0=row0, col0=col0)
    expected = dict(zip(SITES[cfa].split(), (10, 20, 30, 40), strict=True))
    rows = by_channel(window)
    assert {name: (rows[name].min_dn, rows[name].max_dn) for name in expected} == {
        name: (value, value) for name, value in expected.items()
    }
    assert list(rows) == ["R", "G1", "G2", "B", "grey"]
    assert rows["grey"].n == 25


def test_levels_follow_their_site():
    rows = by_channel(
        frame([[1, 2], [3, 4]], cfa="GRBG", black=(1.0, 2.0, 3.0, 4.0), white=(9.0, 2.0, 9.0, 9.0))
    )
    assert [rows[c].black_level_dn for c in ("R", "G1", "G2", "B", "grey")] == [2.0, 1.0, 4.0, 3.0, 2.5]
    assert rows["R"].saturated_share == 1.0
    assert rows["grey"].saturated_share == 0.25
    assert rows["grey"].white_level_dn == 2.0


@pytest.mark.parametrize(
    ("samples", "white", "share"), [([[6, 7, 8, 9]], 7.25, 0.5), ([[65535]], 70000.0, 0.0)]
)
def test_a_fractional_white_level_is_reached_by_the_next_number_if_there_is_one(samples, white, share):
    assert by_channel(frame(samples, cfa="grey", white=(white,)))["grey"].saturated_share == share


def test_a_rendered_colour_image_has_one_green_and_grey_is_the_mean_of_the_three():
    rows = by_channel(frame(np.dstack([[[3, 3]], [[5, 7]], [[9, 9]]]), cfa="rgb"))
    assert list(rows) == ["R", "G", "B", "grey"]
    assert (rows["G"].mean_dn, rows["grey"].mean_dn, rows["grey"].n) == (6.0, 6.0, 6)


def test_a_region_that_touches_only_one_site():
    inside = np.zeros((4, 4), bool)
    inside[0, 1] = True
    rows = by_channel(frame(np.arange(16).reshape(4, 4)), inside)
    assert list(rows) == ["G1", "grey"]
    assert rows["G1"].mean_dn == 1.0


mosaics = hnp.arrays(np.uint16, hnp.array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=12))


@settings(max_examples=30)
@given(mosaics, st.randoms(use_true_random=False), st.integers(0, 3), st.integers(0, 3))
def test_agrees_with_numpy(samples, random, row0, col0):
    inside = np.array([random.random() < 0.7 for _ in range(samples.size)]).reshape(samples.shape)
    inside[0, 0] = True
    rows = by_channel(frame(samples, row0=row0, col0=col0, white=(30000.0,)), inside)
    row_index, col_index = np.indices(samples.shape)
    for site, name in enumerate(("R", "G1", "G2", "B")):
        here = inside & ((row_index + row0) % 2 * 2 + (col_index + col0) % 2 == site)
        if not here.any():
            assert name not in rows
            continue
        values, row = samples[here].astype(float), rows[name]
        assert (row.n, row.min_dn, row.max_dn) == (values.size, values.min(), values.max())
        assert row.median_dn == np.median(values)
        assert row.mean_dn == pytest.approx(values.mean(), rel=1e-14)
        if values.size > 1:
            assert row.std_dn == pytest.approx(values.std(ddof=1), rel=1e-9, abs=1e-9)
        assert row.saturated_share == np.mean(values >= 30000)
    assert sum(row.n for name, row in rows.items() if name != "grey") == rows["grey"].n == inside.sum()


def test_large_numbers_stay_exact():
    """A million samples around 60000: squares summed in float32 would be off; the spread is known."""
    samples = np.full((1000, 1000), 60000)
    samples[:, ::2] += 1
    row = by_channel(frame(samples, cfa="grey"))["grey"]
    assert row.mean_dn == 60000.5
    assert row.std_dn == pytest.approx(0.5 * math.sqrt(1e6 / (1e6 - 1)), rel=1e-15)


def test_signal_is_the_mean_of_both_greens():
    rows = compute_statistics(
        frame([[9, 10, 9], [20, 9, 20]], black=(0.0, 64.0, 66.0, 0.0)), np.ones((2, 3), bool)
    )
    signal = measure_signal(rows)
    assert signal.value_dn == 15.0  # one sample of G1, two of G2: each green counts half
    assert signal.black_level_dn == 65.0


def test_signal_error_by_hand():
    samples = np.array([[0, 10], [40, 0], [0, 14], [40, 0]])  # G1: 10, 14 -> s^2 = 8; G2: 40, 40 -> s = 0
    signal = measure_signal(compute_statistics(frame(samples), np.ones((4, 2), bool)))
    assert signal.standard_uncertainty_dn == pytest.approx(math.sqrt((8 / 2 + 1 / 12) / 4), rel=1e-12)


def test_grey_takes_the_place_of_a_missing_green():
    rows = compute_statistics(frame([[5, 7]], cfa="grey"), np.ones((1, 2), bool))
    assert measure_signal(rows) == measure_signal(rows, channel="grey")
    assert measure_signal(rows).value_dn == 6.0


# --- Lanes in the image of a road: the points of EN 13201-3, and how well picked corners place them


# 30 m along and 7 m across at 10 px/m
FLAT = LaneGrid(
    corners=((0.0, 0.0), (300.0, 0.0), (300.0, 70.0), (0.0, 70.0)),
    lanes=2,
    lane_width_m=3.5,
    spacing_m=30.0,
    length_m=30.0,
    corner_u_px=1.0,
)


def test_homography_of_a_hand_computed_trapezoid():
    """A far side half as long as the near one: its middle line lies at a third of the height."""
    h = find_homography([(30.0, 10.0), (70.0, 10.0), (90.0, 60.0), (10.0, 60.0)])
    # by hand from (0, 0), (1, 0), (1, 1), (0, 1): g = 0, k = -1/2
    assert h == pytest.approx(np.array([[40.0, -25.0, 30.0], [0.0, 20.0, 10.0], [0.0, -0.5, 1.0]]))
    x, y, w = h @ (0.5, 0.5, 1.0)
    assert (x / w, y / w) == pytest.approx((50.0, 10.0 + 50.0 / 3.0))


@pytest.mark.parametrize(("spacing", "columns"), [(20, 10), (30, 10), (30.1, 11), (33, 11), (40, 14)])
def test_points_are_at_most_three_metres_apart_beyond_thirty(spacing, columns):
    assert replace(FLAT, spacing_m=spacing).columns == columns


def test_points_are_those_of_the_standard():
    """D = S / 10 from D / 2 on; a third of a lane across from a sixth on."""
    found = describe_lanes(FLAT)
    assert (found["along_m"], found["across_m"]) == pytest.approx((3.0, 3.5 / 3))
    assert found["points_m"][0][0] == pytest.approx([1.5, 3.5 / 6])
    assert found["points_m"][5][9] == pytest.approx([28.5, 7.0 - 3.5 / 6], abs=1e-6)


def test_uncertainty_of_points_is_that_of_corners_picked_again_and_again():
    """In perspective, against 500 draws of all eight coordinates at once."""
    size, random = np.array([30.0, 7.0]), np.random.default_rng(1)
    seen = replace(FLAT, corners=((300.0, 100.0), (700.0, 110.0), (900.0, 600.0), (60.0, 580.0)))
    told = describe_lanes(seen)
    points = np.array(told["points_m"]).reshape(-1, 2)
    image = np.column_stack([points / size, np.ones(len(points))]) @ find_homography(seen.corners).T
    errors = []
    for _ in range(500):
        picked = find_homography((np.array(seen.corners) + random.normal(size=(4, 2))).tolist())
        back = image @ np.linalg.inv(picked).T
        errors.append(np.sum((back[:, :2] / back[:, 2:] * size - points) ** 2, axis=1))
    assert told["point_u_m"] == pytest.approx(np.sqrt(np.mean(errors, axis=0).max()), rel=0.1)


def test_field_is_laid_from_a_rectangle_of_another_length():
    grid = lay_lanes(replace(FLAT, spacing_m=24.0))
    assert (grid.rows, grid.columns) == (6, 10)
    assert np.array(grid.corners) == pytest.approx(np.array([(0, 0), (240, 0), (240, 70), (0, 70)]))
    assert lay_lanes(FLAT).corners == FLAT.corners


# --- A dark frame that saw light is named beside every coefficient that rests on it


def raised(fit, flag):
    return [each for each in fit.flags if each.flag == flag]


@pytest.mark.parametrize(
    ("above_dn", "outcome"), [(20.0, None), (21.0, "warn"), (200.0, "warn"), (201.0, "fail")]
)
def test_the_limits_lie_where_they_are_said_to_lie(above_dn, outcome):
    """Of a span of 4000 DN half a per cent is 20, five are 200; a black level of zero states none."""
    found = inspect_black(256.0 + above_dn, black_level_dn=256.0, white_level_dn=4256.0)
    assert (found.outcome if found else None) == outcome
    assert inspect_black(256.0 + above_dn, black_level_dn=0.0, white_level_dn=4256.0) is None


@pytest.mark.parametrize(("by_dn", "names"), [(10, 0), (20, 1)])
def test_one_lit_dark_frame_of_a_noise_pair(by_dn, names):
    """A tenth of a per cent of 16127 DN is 16."""
    rows = take(SMALL, 3)
    (first, *_) = sorted(row.frame for row in rows if row.role == "dark")
    fit = noise.fit(brightened(rows, by_dn, lambda row: row.frame == first), PARAMS)
    found = raised(fit, "dark_not_dark")
    assert len(found) == names
    assert all(each.detail.startswith(f"{first}: Its mean is") for each in found)


def test_a_lamp_that_burnt_in_all_dark_frames_of_a_noise_campaign():
    fit = noise.fit(brightened(take(SMALL, 3), 900, lambda row: row.role == "dark"), PARAMS)
    (found,) = raised(fit, "dark_not_dark")
    assert "5.6% of the span" in found.detail
    assert "dark_not_dark" in noise.list_coefficients(fit)[0].flags


def test_a_warm_sensor_is_a_noise_campaign_s_subject():
    sensor = change(SMALL, dark_current_e_s=400.0)
    assert not raised(noise.fit(take(sensor, 5, dark_times=(0.02, 2.0)), PARAMS), "dark_not_dark")


@pytest.mark.parametrize(("black_level_dn", "flagged"), [(256.0, False), (956.0, True)])
def test_lit_dark_frames_of_a_falloff(black_level_dn, flagged):
    """At 956 DN the falloff would come out twice as large, with a small uncertainty."""
    lens = change(flats.SMALL, cfa="grey", falloffs={4.0: flats.SMALL.lens.falloffs[4.0]})
    bright = change(lens, black_level_dn=black_level_dn)
    darks = [flats.state_black(flats.dark(bright, seed, name=f"dark-{seed}"), 256.0) for seed in (2, 3)]
    fit = vignetting.fit([flats.flat(lens, 1, 4.0), *darks], flats.NONE)
    found = raised(fit, "dark_not_dark")
    assert [each.where for each in found] == (["iso 100"] if flagged else [])
    assert all(each.detail.startswith("dark-2, dark-3: Its mean is") for each in found)
    assert ("dark_not_dark" in vignetting.list_coefficients(fit)[0].flags) is flagged
