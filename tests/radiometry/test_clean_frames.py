"""Frames of plain noise and smooth vignetting raise no warning, whatever the size of the sensor."""

import dataclasses

import numpy as np
import pytest

from radiometry.frame.roi import Polygon
from radiometry.frame.wholeness import WholenessCheck
from radiometry.luminance import method as luminance
from radiometry.luminance.rows import FrameRow, Params
from radiometry.luminance.verdicts import judge as judge_luminance
from radiometry.noise.verdicts import judge as judge_noise
from radiometry.vignetting import method as vignetting
from radiometry.vignetting.verdicts import judge as judge_vignetting
from simulation.camera import change, take
from simulation.flats import FAST_LENS, plan_dark, plan_flat
from simulation.targets import Surface
from tests.radiometry import evidence
from tests.radiometry.noise import series
from tests.radiometry.vignetting import flats

SIZES = [
    *((96, 128), (100, 130), (102, 131), (110, 147), (113, 113), (118, 151), (121, 163), (127, 97)),
    *((130, 190), (135, 181), (142, 203), (149, 199), (151, 226), (166, 251), (173, 131), (181, 241)),
    *((190, 286), (197, 263), (211, 211), (514, 642)),
]


def camera_of(size, cfa="RGGB"):
    height, width = size
    return change(FAST_LENS, height_px=height, width_px=width, centre_px=None, cfa=cfa)


def name_reasons(verdicts):
    return {
        (frame, reason.code, reason.detail)
        for frame, verdict in verdicts.items()
        for reason in verdict.reasons
    }


def judged(judge, rows, **region):
    return name_reasons(judge([evidence.taken(row, **region) for row in rows], rows, PARAMS[judge]))


PARAMS = {
    judge_vignetting: vignetting.Params(),
    judge_noise: series.PARAMS,
}


def is_whole(taken):
    samples, sensor = taken.frame.samples_dn, taken.frame
    check = WholenessCheck(
        height_px=sensor.height_px,
        width_px=sensor.width_px,
        channels=1,
        black_dn=min(sensor.black_level_dn),
        lowest_dn=0.0,
        rendered=False,
    )
    check.add(0, samples)
    return not check.conclude().empty


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[1]}x{size[0]}")
def test_clean_flats_and_darks_are_whole_and_raise_nothing(size):
    camera, random = camera_of(size, "grey" if size[0] % 2 else "RGGB"), np.random.default_rng(size[1])
    shots_of = [plan_flat(camera, f_number=2.8, name=f"flat-{n}") for n in (1, 2)]
    shots_of += [plan_dark(name=f"dark-{n}") for n in (1, 2)]
    frames = [take(camera, shot, random) for shot in shots_of]
    assert all(map(is_whole, frames))
    assert not judged(judge_vignetting, [flats.row(each) for each in frames], region=None)
    assert not judged(judge_noise, [series.make_row(each) for each in frames], region=None)


@pytest.mark.parametrize("size", SIZES[::5], ids=lambda size: f"{size[1]}x{size[0]}")
def test_clean_light_frames_raise_nothing(size):
    """The middle of the frame is the region, at three levels and two apertures each."""
    camera, random = camera_of(size), np.random.default_rng(size[1])
    height, width = size
    region = Polygon.from_points(
        [(c * width, r * height) for c, r in ((0.3, 0.3), (0.7, 0.3), (0.7, 0.7), (0.3, 0.7))]
    )
    full = plan_flat(camera, f_number=2.8)
    rows, readings = [], []
    for scene, share in (("bright", 0.6), ("middle", 0.3), ("dim", 0.1)):
        lamp = dataclasses.replace(full.lamp, luminance_cd_m2=share * full.lamp.luminance_cd_m2)
        readings.append(evidence.reading(scene, lamp.luminance_cd_m2))
        for f_number in (2.8, 4.0):
            shot = dataclasses.replace(
                full,
                frame=f"{scene}-{f_number}",
                role="light",
                scene=scene,
                lamp=lamp,
                target=Surface(),
                settings=dataclasses.replace(full.settings, f_number=f_number),
            )
            rows.append(shot)
    rows += [plan_dark(name=f"dark-{n}") for n in range(3)]
    made = []
    for shot in rows:
        taken = take(camera, shot, random)
        assert is_whole(taken)
        made.append(
            FrameRow(
                frame=taken.name,
                role=taken.role,
                scene=shot.scene,
                exposure=taken.exposure,
                statistics=luminance.extract(taken.frame, region),
            )
        )
    frames = [evidence.taken(row) for row in made]
    assert not name_reasons(judge_luminance(frames, made, readings, Params()))
