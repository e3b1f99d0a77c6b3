"""Image motion: the source's table to its printed digits, and what follows backwards."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radiometry.tools.motion import MotionCase, compute_motion

# 1/t, angle [deg], way on the ground [m], pixels at 6 mm, at 9 mm: as printed
TABLE_3 = [
    (100, "1.66", "0.72", "37.3", "55.9"),
    (200, "0.83", "0.36", "18.6", "28.0"),
    (400, "0.41", "0.18", "9.3", "14.0"),
    (500, "0.33", "0.14", "7.5", "11.2"),
    (640, "0.26", "0.11", "5.8", "8.7"),
    (800, "0.21", "0.09", "4.7", "7.0"),
    (1000, "0.17", "0.07", "3.7", "5.6"),
    (1250, "0.13", "0.06", "3.0", "4.5"),
    (2000, "0.08", "0.04", "1.9", "2.8"),
]
ROUNDS_PER_S = 0.46

numbers = st.floats(0.1, 100.0)
cases = st.builds(
    MotionCase,
    pixel_pitch_um=numbers,
    focal_length_mm=numbers,
    exposure_time_s=st.floats(1e-5, 1.0),
    distance_m=numbers,
    rotation_rate_deg_s=numbers,
    ground_speed_m_s=numbers,
    limit_px=numbers,
)


def case(**changes):
    whole = {"pixel_pitch_um": 4.65, "focal_length_mm": 9.0, "exposure_time_s": 1 / 800, "distance_m": 25.0}
    return MotionCase(**(whole | changes))


@pytest.mark.parametrize("row", TABLE_3, ids=lambda row: f"1/{row[0]}")
def test_table_3_is_reproduced_to_every_printed_digit(row):
    inverse, *printed = row
    moved = {
        c: compute_motion(
            case(focal_length_mm=c, exposure_time_s=1 / inverse, rotation_rate_deg_s=360 * ROUNDS_PER_S)
        )
        for c in (6.0, 9.0)
    }
    angle, ground = moved[9.0].rotation_angle_deg, moved[9.0].rotation_ground_m
    blurs = [moved[c].rotation_blur_px for c in (6.0, 9.0)]
    assert [f"{angle:.2f}", f"{ground:.2f}", *(f"{blur:.1f}" for blur in blurs)] == printed


def test_the_tolerable_rate_takes_the_limit_as_theoretical():
    moved = compute_motion(case(limit_px=0.5))
    assert moved.tolerable_rate_deg_s == pytest.approx(11.84, abs=0.005)
    turned = compute_motion(case(rotation_rate_deg_s=moved.tolerable_rate_deg_s))
    assert turned.theoretical_blur_px == pytest.approx(0.5)
    assert turned.practical_blur_px == pytest.approx(0.25)


@pytest.mark.parametrize(("focal_length_mm", "blur_px"), [(6.0, 0.484), (9.0, 0.726)])
def test_forward_motion(focal_length_mm, blur_px):
    moved = compute_motion(
        case(
            focal_length_mm=focal_length_mm, exposure_time_s=1 / 400, distance_m=100.0, ground_speed_m_s=15.0
        )
    )
    assert moved.forward_blur_px == pytest.approx(blur_px, abs=5e-4)
    assert moved.practical_blur_px == moved.forward_blur_px / 2
    assert moved.rotation_blur_px is None


def test_the_ground_sample_distance():
    assert compute_motion(case(distance_m=50.0)).gsd_m == pytest.approx(0.0258, abs=5e-5)
    assert compute_motion(case(distance_m=300.0)).gsd_m == pytest.approx(0.155, abs=5e-4)


@settings(max_examples=40)
@given(cases)
def test_the_longest_exposure_reaches_the_limit_and_not_more(one):
    longest = compute_motion(one).longest_exposure_s
    there = compute_motion(replace(one, exposure_time_s=longest))
    assert there.theoretical_blur_px == pytest.approx(one.limit_px, rel=1e-9)
    assert there.theoretical_blur_px == there.rotation_blur_px + there.forward_blur_px


def test_what_is_not_asked_is_not_there():
    moved = compute_motion(case())
    assert (moved.rotation_blur_px, moved.forward_blur_px, moved.theoretical_blur_px) == (None, None, None)
    assert moved.practical_blur_px is None
    assert moved.longest_exposure_s is None


@pytest.mark.parametrize("rate", [0.0, 5e-324])
def test_what_stands_still_may_be_exposed_for_ever_and_that_is_no_number(rate):
    assert compute_motion(case(rotation_rate_deg_s=rate, limit_px=1e5)).longest_exposure_s is None


@pytest.mark.parametrize(
    "changes", [{"distance_m": 0.0}, {"ground_speed_m_s": -1.0}, {"limit_px": float("nan")}]
)
def test_what_cannot_be_is_refused(changes):
    with pytest.raises(ValueError, match="cannot be"):
        case(**changes)
