"""Blur from recorded attitudes: turns by hand, across 360 degrees, tilted, and of a real Sequoia."""

import math
from dataclasses import replace

import pytest
from scipy.spatial.transform import Rotation

from radiometry.findings import InputRejected, shared
from radiometry.frame.multispectral import Multispectral, SunshineCounts, SunshineRecord
from radiometry.tools.motion import Attitude, blur_of_file, compute_turns, read_attitudes
from simulation.camera import Camera


def attitudes(*angles, step_s=0.2):
    return [
        Attitude(time_s=10.0 + step_s * n, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
        for n, (yaw, pitch, roll) in enumerate(angles)
    ]


def blur_of(records, *, at_s, exposure_time_s=0.001):
    """Of a file of 1280 x 960 px, whose corners are 800 px from the middle."""
    records = tuple(
        SunshineRecord(
            time_us=round(1e6 * each.time_s),
            ch0=1,
            ch1=1,
            yaw_deg=each.yaw_deg,
            pitch_deg=each.pitch_deg,
            roll_deg=each.roll_deg,
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
    [(10.25, "during", 85.0), (9.0, "nearest", 15.0), (12.0, "nearest", 85.0), (None, "largest", 85.0)],
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

    level = {"yaw_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0}
    records = (record(300, **level), record(100, **level), record(200), record(100, **level))
    counts = SunshineCounts(record_bytes=28, cut_short=False, records=records, gains=())
    spectral = Multispectral(system="sequoia", band="red", band_name="Red", counts=counts)
    assert [each.time_s for each in read_attitudes(spectral)] == pytest.approx([1e-4, 3e-4])
    assert read_attitudes(None) == ()
