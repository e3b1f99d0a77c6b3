"""Simulated campaigns: clean ones raise no alarm, and every fault is found where it is and nowhere else."""

import dataclasses
from statistics import NormalDist

import numpy as np
import pytest

from radiometry.frame.roi import Window
from radiometry.frame.statistics import compute_statistics
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.luminance.verdicts import judge
from simulation.camera import Lamp, change, take
from simulation.luminance import X5S, Errors, plan_campaign
from tests.radiometry.campaigns import draw, draw_row
from tests.radiometry.evidence import taken

SEEDS = 50
CAMERA = change(X5S, height_px=480, width_px=640)
HERE = Window(row0=200, col0=280, height=60, width=80)


def reasons(rows, readings):
    found = judge([taken(row) for row in rows], rows, readings, Params())
    return {name: {r.code for r in v.reasons} for name, v in found.items() if v.reasons}


@pytest.mark.parametrize("iso", [3200.0, 6400.0, 12800.0])
def test_clean_campaigns_raise_no_alarm(iso):
    for seed in range(SEEDS):
        drawn = draw(seed, isos=(iso,))
        assert reasons(drawn.rows, drawn.readings) == {}


def test_at_the_highest_iso_only_what_is_near_white_is_said_so():
    """There noise is 9 % of full scale: 80 % of it and three times the noise reach white."""
    for seed in range(SEEDS):
        drawn = draw(seed, isos=(25600.0,))
        for name, found in reasons(drawn.rows, drawn.readings).items():
            row = next(row for row in drawn.rows if row.frame == name).statistics[0]
            top = NormalDist(row.mean_dn, row.std_dn).inv_cdf(0.999)
            assert found <= {"nearly_clipped", "clipped"}
            assert top > 256 + 0.94 * (4095 - 256)


@pytest.mark.parametrize("seed", range(5))
def test_the_lamp_left_on_during_the_dark_frames(seed):
    """At the dimmest level, f/5.6 and 1/8 s: 30 * 0.125 * 3200 * 0.24 / 5.6^2 = 92 DN above black."""
    drawn = draw(seed)
    random = np.random.default_rng(seed)
    rows, lit = [], {}
    for shot, row in zip(drawn.campaign.shots, drawn.rows, strict=True):
        if shot.role == "dark":
            shining = dataclasses.replace(shot, lamp=Lamp(luminance_cd_m2=0.24))
            rows.append(draw_row(drawn.campaign.camera, shining, random, pixels=20000))
            lit[row.frame] = rows[-1].statistics[0].mean_dn - 256.0
        else:
            rows.append(row)
    found = reasons(rows, drawn.readings)
    assert all(codes == {"dark_not_dark"} for codes in found.values())
    assert {name for name, above in lit.items() if above > 20.0} <= set(found) <= set(lit)


def test_a_drifting_lamp():
    drawn = draw(3)
    lux = [
        Reading(scene=f"level-{n}", quantity="illuminance", value=value)
        for n, values in {1: (200.0, 201.0), 2: (10.0, 10.4), 3: (5.0, 5.01)}.items()
        for value in values
    ]
    found = reasons(drawn.rows, (*drawn.readings, *lux))
    assert found == {row.frame: {"lamp_drift"} for row in drawn.rows if row.scene == "level-2"}


def test_clipped_frames():
    """Two stops more light than planned for one frame, of which the file knows."""
    drawn = draw(4)
    random = np.random.default_rng(4)
    level = [shot for shot in drawn.campaign.shots if shot.scene == "level-1"]
    shot = min(level, key=lambda shot: shot.settings.f_number)
    longer = dataclasses.replace(shot.settings, exposure_time_s=4 * shot.settings.exposure_time_s)
    over = dataclasses.replace(shot, settings=longer)
    bright = draw_row(drawn.campaign.camera, over, random, pixels=20000)
    rows = [bright if row.frame == shot.frame else row for row in drawn.rows]
    assert reasons(rows, drawn.readings) == {shot.frame: {"clipped"}}


def test_a_frame_under_another_scene_s_name():
    drawn = draw(5)
    index = next(i for i, row in enumerate(drawn.rows) if row.scene == "level-1")
    rows = list(drawn.rows)
    rows[index] = dataclasses.replace(rows[index], scene="level-5")
    assert reasons(rows, drawn.readings) == {rows[index].frame: {"scene_doubtful"}}


def render(campaign, shot, random, *, part=0.0):
    """A frame's row from its pixels; ``part`` of the region shows a surface with a tenth of the light."""
    shot = dataclasses.replace(shot, window=HERE)
    frame = take(campaign.camera, shot, random).frame
    if part:
        dim = dataclasses.replace(shot, lamp=Lamp(luminance_cd_m2=0.1 * shot.lamp.luminance_cd_m2))
        other = take(campaign.camera, dim, random).frame
        cut = round(part * HERE.width)
        samples = np.where(np.arange(HERE.width) < cut, other.samples_dn, frame.samples_dn)
        frame = dataclasses.replace(frame, samples_dn=samples)
    statistics = compute_statistics(frame, np.ones(frame.samples_dn.shape, np.bool_))
    row = draw_row(campaign.camera, shot, random, pixels=10)
    return dataclasses.replace(row, statistics=statistics)


def photograph(seed, *, moved=None, part=0.0) -> tuple[list[FrameRow], tuple[Reading, ...]]:
    random = np.random.default_rng(seed)
    campaign = plan_campaign(CAMERA, random, errors=Errors(), isos=(3200.0,))
    rows = [
        render(campaign, shot, random, part=part if number == moved else 0.0)
        for number, shot in enumerate(campaign.shots)
    ]
    return rows, campaign.readings


@pytest.mark.parametrize("seed", range(3))
def test_clean_pixels_raise_no_alarm(seed):
    assert reasons(*photograph(seed)) == {}


@pytest.mark.parametrize("part", [0.05, 0.3, 0.5])
def test_a_region_that_has_moved_off_the_surface(part):
    rows, readings = photograph(7, moved=0, part=part)
    found = reasons(rows, readings)
    assert found.keys() == {rows[0].frame}
    assert "uneven" in found[rows[0].frame]
