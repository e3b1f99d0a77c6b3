"""What a saturated spot adds to its neighbours, apart from the halo of the lens."""

import dataclasses

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.frame.exposure import Exposure, Settings
from radiometry.methods import get_method
from radiometry.sharpness import method as sharpness
from simulation.camera import Camera, Shot, change, take
from simulation.light import Lamp
from simulation.targets import Picture, Spot
from store.codec import encode
from tests.radiometry.sharpness.shots import row

SPOT = Spot(name="lamp", row0=0, col0=0, size=112)
TARGET = sharpness.Target(kind="saturated_spot")
CCD = change(
    Camera(),
    height_px=112,
    width_px=112,
    cfa="grey",
    full_well_e=20_000.0,
    gain_dn_per_e=0.2,
    read_noise_e=10.0,
    black_level_dn=64.0,
    white_level_dn=4095.0,
    spill_share=0.7,
)
TIMES_S = (0.01, 0.2)
WHOLE = Settings(exposure_time_s=TIMES_S[0], f_number=4.0, iso=100.0)


def shoot(camera, *, times_s=TIMES_S, seed=1, repeats=1, flicker=0.0):
    """The spot at half of the full well, and twenty times as long."""
    random = np.random.default_rng(seed)
    lamp = Lamp(luminance_cd_m2=camera.find_luminance(2000.0, WHOLE))
    rows = []
    for time_s in times_s:
        for repeat in range(repeats):
            settings = dataclasses.replace(WHOLE, exposure_time_s=time_s)
            bright = dataclasses.replace(
                lamp, luminance_cd_m2=lamp.luminance_cd_m2 * random.normal(1.0, flicker)
            )
            shot = Shot(
                frame=f"spot-{time_s:g}-{repeat}",
                role="chart",
                settings=settings,
                lamp=bright if flicker else lamp,
                target=Picture(SPOT.fill()),
            )
            frame = take(camera, shot, random).frame
            features = sharpness.extract(
                frame, [SPOT.region], header=camera.describe(), exposure=None, target=TARGET
            ).features
            exposure = Exposure(exposure_time_s=time_s, f_number=4.0, iso=100.0)
            rows.append(row(shot.frame, features, exposure=exposure))
    return rows


def fit(rows, **params):
    found = sharpness.fit(rows, sharpness.Params(**params))
    return found, {each.direction: each for each in found.blooming}


def true_blooming_px(camera):
    """The length of saturated pixels that flow down the strip, from the electrons themselves."""
    mean = camera.sensor.full_well_e / 2 * TIMES_S[1] / TIMES_S[0] * SPOT.fill()
    added = camera.sensor.overflow(mean) - np.minimum(mean, camera.sensor.full_well_e)
    return added[56:, 52:60].mean(axis=1).sum() / camera.sensor.full_well_e


def test_charge_that_flows_along_the_columns_is_found():
    found, by_direction = fit(shoot(CCD))
    truth = true_blooming_px(CCD)
    assert truth > 10.0
    for direction in ("up", "down"):
        blooming = by_direction[direction].blooming
        assert blooming.value == pytest.approx(truth, abs=3 * blooming.standard_uncertainty + 0.2)
        assert by_direction[direction].reach_px > 5.0
    for direction in ("left", "right"):
        blooming = by_direction[direction].blooming
        assert abs(blooming.value) < 3 * blooming.standard_uncertainty
    assert {each.where for each in found.flags if each.flag == "blooming_found"} == {"up", "down"}
    assert by_direction["up"].overexposure == pytest.approx(10.0, rel=0.1)
    first, *_ = by_direction["down"].added
    assert (first.distance_px, first.added_rel) == (1.0, pytest.approx(1.0, abs=0.05))


def test_coefficients_and_plot():
    found, _ = fit(shoot(CCD))
    listed = sharpness.list_coefficients(found)
    assert {each.model for each in listed} == {
        f"saturated_spot:lamp {direction}" for direction in ("up", "down", "left", "right")
    }
    assert {(each.name, each.unit, each.channel) for each in listed} == {("blooming_px", "px", "grey")}
    assert "Blooming of a saturated spot, down" in get_method("sharpness").draw(encode(found))
    assert all(point.used for point in found.points)


def test_a_halo_without_blooming_is_no_blooming():
    """The lens's halo is in both pictures; the intervals of the sum hold zero in 95 % of directions."""
    camera, inside = change(CCD, spill_share=0.0), 0
    for seed in range(8):
        # a true ratio of times off by its standard uncertainty at random
        ratio = 1.0 + 0.02 * np.random.default_rng(seed).standard_normal()
        wrong = change(camera, time_errors={TIMES_S[1]: ratio})
        _, by_direction = fit(shoot(wrong, seed=seed))
        inside += sum(
            abs(each.blooming.value) < 2 * each.blooming.standard_uncertainty
            for each in by_direction.values()
        )
    assert 24 <= inside <= 32


def test_repeats_of_a_lamp_that_flickers_have_students_factor():
    """Two frames of each time: their light changes as a whole, which the noise of a place does not show."""
    camera, dof = change(CCD, spill_share=0.0), []
    for flicker in (0.0, 0.2):
        found, _ = fit(shoot(camera, repeats=2, flicker=flicker, seed=3), black_u_dn=0.0)
        dof.append([each.effective_dof for each in sharpness.list_coefficients(found)])
    assert max(dof[0]) > 20.0
    assert max(dof[1]) < 3.0


def test_without_an_unsaturated_picture_there_is_no_fit():
    with pytest.raises(InputRejected, match="unsaturated"):
        fit(shoot(CCD, times_s=TIMES_S[1:], repeats=2))


def test_colour_planes_and_repeats():
    """Charge of a mosaic's column flows into both of its colours."""
    mosaic = change(CCD, cfa="RGGB", colours={"R": 1.0, "G": 1.0, "B": 1.0})
    found, _ = fit(shoot(mosaic, repeats=2))
    down = {each.channel: each for each in found.blooming if each.direction == "down"}
    assert set(down) == {"R", "G", "B"}
    for each in down.values():
        assert each.blooming.value == pytest.approx(true_blooming_px(CCD), rel=0.15)
        assert (len(each.frames), len(each.references)) == (2, 2)
