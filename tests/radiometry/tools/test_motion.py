"""Image motion: the source's table to its printed digits, and what follows backwards."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from radiometry.findings import InputRejected, shared
from radiometry.frame.multispectral import Multispectral, SunshineCounts, SunshineRecord
from radiometry.tools.motion import (
    Attitude,
    MotionCase,
    blur_of_file,
    compute_motion,
    compute_turns,
    read_attitudes,
)
from simulation.camera import Camera

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


# --- Blur from recorded attitudes: across 360 degrees, and of a file


ANGLES = ("yaw_deg", "pitch_deg", "roll_deg")


def attitudes(*angles, step_s=0.2):
    return [
        Attitude(time_s=10.0 + step_s * n, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
        for n, (yaw, pitch, roll) in enumerate(angles)
    ]


def blur_of(records, *, at_s, exposure_time_s=0.001):
    """Of a file of 1280 x 960 px, whose corners are 800 px from the middle."""
    records = tuple(
        SunshineRecord(
            time_us=round(1e6 * each.time_s), ch0=1, ch1=1, **{name: getattr(each, name) for name in ANGLES}
        )
        for each in records
    )
    band = Multispectral(
        system="sequoia",
        band="red",
        band_name="Red",
        counts=SunshineCounts(record_bytes=28, cut_short=False, records=records, gains=()),
        exposed_at_us=None if at_s is None else round(1e6 * at_s),
    )
    header = replace(Camera().describe(), width_px=1280, height_px=960, multispectral=band)
    return blur_of_file(header, exposure_time_s=exposure_time_s, pixel_pitch_um=3.75, focal_length_mm=3.98)


def test_north_is_no_jump():
    (turn,) = compute_turns(attitudes((359, 0, 0), (1, 0, 0)))
    assert turn.yaw_rate_deg_s == pytest.approx(10.0)


def test_the_rates_carry_one_attitude_into_the_next():
    first, second = attitudes((10, -20, 30), (17, -12, 21))
    (turn,) = compute_turns([first, second])
    step = Rotation.from_rotvec(
        [0.2 * math.radians(r) for r in (turn.roll_rate_deg_s, turn.pitch_rate_deg_s, turn.yaw_rate_deg_s)]
    )
    there = Rotation.from_euler("ZYX", [10, -20, 30], degrees=True) * step
    assert there.as_euler("ZYX", degrees=True) == pytest.approx([17, -12, 21])


def test_the_blur_of_a_frame_by_hand():
    blur = blur_of(attitudes((0, 0, 0), (4, 3, 0), (4, 20, 0)), at_s=10.05, exposure_time_s=0.01)
    assert blur.basis == "during"
    assert blur.centre_blur_px == pytest.approx(math.radians(15.0) * 0.01 * 3980 / 3.75, rel=1e-3)
    twist = math.radians(20.0) * 0.01 * 800
    assert blur.corner_blur_px - blur.centre_blur_px == pytest.approx(twist, rel=1e-3)


@pytest.mark.parametrize(
    ("at_s", "basis", "rate"),
    [
        (10.25, "during", 85.0),
        (10.1996, "during", 85.0),  # of an exposure of 1 ms the middle counts
        (9.0, "nearest", 15.0),
        (12.0, "nearest", 85.0),
        (None, "largest", 85.0),
    ],
)
def test_the_records_nearest_to_the_exposure_count(at_s, basis, rate):
    records = attitudes((0, 0, 0), (0, 3, 0), (0, 20, 0))
    blur = blur_of(records, at_s=at_s)
    assert blur.basis == basis
    assert blur.turn.tilt_rate_deg_s == pytest.approx(rate)


@pytest.mark.parametrize("records", [[], attitudes((0, 0, 0))])
def test_without_two_records_there_is_no_rate(records):
    with pytest.raises(InputRejected, match="no two records") as refused:
        blur_of(records, at_s=None)
    assert refused.value.code is shared.ATTITUDE_MISSING


def test_records_without_angles_or_of_one_time_are_not_read():
    def record(time_us, **angles):
        return SunshineRecord(time_us=time_us, ch0=1, ch1=1, **angles)

    level = dict.fromkeys(ANGLES, 0.0)
    records = (record(300, **level), record(100, **level), record(200), record(100, **level))
    counts = SunshineCounts(record_bytes=28, cut_short=False, records=records, gains=())
    spectral = Multispectral(system="sequoia", band="red", band_name="Red", counts=counts)
    assert [each.time_s for each in read_attitudes(spectral)] == pytest.approx([1e-4, 3e-4])
    assert read_attitudes(None) == ()
