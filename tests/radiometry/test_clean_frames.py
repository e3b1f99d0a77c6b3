"""Frames of plain noise and smooth vignetting raise no warning, whatever the size of the sensor."""

from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest

from radiometry.frame.grid import Grid
from radiometry.frame.proof import WholenessCheck
from radiometry.frame.roi import Polygon, Window
from radiometry.frame.statistics import compute_statistics
from radiometry.luminance import method as luminance
from radiometry.luminance.measurement import Request, measure
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.luminance.verdicts import judge
from radiometry.luminance.verdicts import judge as judge_luminance
from radiometry.noise.verdicts import judge as judge_noise
from radiometry.reflectance import method as reflectance
from radiometry.reflectance.findings import judge as judge_reflectance
from radiometry.sharpness import fit as sharpness
from radiometry.sharpness.results import Params as SharpnessParams
from radiometry.sharpness.results import Target
from radiometry.sharpness.verdicts import judge as judge_sharpness
from radiometry.vignetting import fit as vignetting
from radiometry.vignetting.verdicts import judge as judge_vignetting
from simulation.camera import Lamp, change, take
from simulation.luminance import X5S, Errors, plan_campaign
from simulation.targets import CHART_STUDIO, FAST_LENS, Edge, Star, Surface, plan_dark, plan_flat
from tests.radiometry import evidence
from tests.radiometry.campaigns import draw, draw_row
from tests.radiometry.evidence import taken
from tests.radiometry.noise import series
from tests.radiometry.reflectance import captures
from tests.radiometry.sharpness import shots
from tests.radiometry.vignetting import flats

SIZES = [
    *((96, 128), (102, 131), (113, 113), (118, 151), (127, 97), (130, 190), (142, 203), (151, 226)),
    *((173, 131), (197, 263), (211, 211), (1024, 1280)),
]
every_size = pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[1]}x{size[0]}")


def cfa_of(size):
    return "grey" if size[0] % 2 else "RGGB"


def camera_of(size, **changes):
    height, width = size
    return change(FAST_LENS, height_px=height, width_px=width, centre_px=None, cfa=cfa_of(size), **changes)


def middle_of(size):
    height, width = size
    return [(c * width, r * height) for c, r in ((0.3, 0.3), (0.7, 0.3), (0.7, 0.7), (0.3, 0.7))]


def name_reasons(verdicts):
    return {
        (frame, reason.code, reason.detail)
        for frame, verdict in verdicts.items()
        for reason in verdict.reasons
    }


def judged(judge, rows, *given, **region):
    return name_reasons(judge([evidence.taken(row, **region) for row in rows], rows, *given))


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


@every_size
def test_clean_flats_and_darks_are_whole_and_raise_nothing(size):
    camera, random = camera_of(size), np.random.default_rng(size[1])
    shots_of = [plan_flat(camera, f_number=2.8, name=f"flat-{n}") for n in (1, 2)]
    shots_of += [plan_dark(name=f"dark-{n}") for n in (1, 2)]
    frames = [take(camera, shot, random) for shot in shots_of]
    assert all(map(is_whole, frames))
    rows = [flats.row(each) for each in frames]
    assert not judged(judge_vignetting, rows, vignetting.Params(), region=None)
    rows = [series.make_row(each) for each in frames]
    assert not judged(judge_noise, rows, series.PARAMS, region=None)


@every_size
def test_clean_light_frames_raise_nothing_nor_does_a_road_measured_with_them(size):
    """The middle of the frame is the region, at three levels and two apertures each.

    The light on the road falls; a measurement always states what it does not hold for.
    """
    camera, random = camera_of(size, falloffs={}), np.random.default_rng(size[1])
    region = Polygon.from_points(middle_of(size))
    full = plan_flat(camera, f_number=2.8)
    rows, readings = [], []
    for scene, share in (("bright", 0.6), ("middle", 0.3), ("dim", 0.1)):
        lamp = replace(full.lamp, luminance_cd_m2=share * full.lamp.luminance_cd_m2)
        readings.append(evidence.reading(scene, lamp.luminance_cd_m2))
        for f_number in (2.8, 4.0):
            shot = replace(
                full,
                frame=f"{scene}-{f_number}",
                role="light",
                scene=scene,
                lamp=lamp,
                target=Surface(),
                settings=replace(full.settings, f_number=f_number),
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
    params = Params(meter_repeatability_rel=0.01)
    assert not judged(judge_luminance, made, readings, params)
    fitted = luminance.fit(made, readings, params)
    assert not fitted.flags
    road = replace(full, target=Surface(share=0.3, gradient=(-0.3, 0.1)))
    taken = take(camera, road, random)
    found = measure(
        taken.frame,
        Request(polygon=region, grid=Grid(corners=tuple(middle_of(size)), rows=3, columns=4)),
        exposure=taken.exposure,
        coefficients=[each.coefficient for each in fitted.iso_fits],
        calibrated=(region,),
    )
    assert {raised.flag for raised in found.flags} == {"no_vignetting_correction", "observer_differs"}


def plan_edge(height, width):
    box = {"height": min(120, 4 * height // 5), "width": min(64, 3 * width // 5)}
    return Edge(name="", row0=(height - box["height"]) // 2, col0=(width - box["width"]) // 2, **box)


def plan_star(height, width):
    size = min(150, height - 3, width - 3)
    middle = size / 2.0 + 0.3
    centre = {"centre_row_px": middle + 1, "centre_col_px": middle + 2}
    return Star(name="", row0=1, col0=2, size=size, cycles=24, blur_px=0.9, **centre)


@pytest.mark.parametrize(("plan", "kind"), [(plan_edge, "slanted_edge"), (plan_star, "siemens_star")])
@every_size
def test_clean_charts_raise_nothing(size, plan, kind):
    """Stars in grey: of a mosaic, red and blue need more pixels than these have."""
    cfa = "grey" if kind == "siemens_star" else cfa_of(size)
    falloff = (-0.2, 0.06, -0.04)
    studio = change(CHART_STUDIO, height_px=size[0], width_px=size[1], cfa=cfa, falloff=falloff)
    studio = change(studio, photon_noise=True, colours=FAST_LENS.sensor.colours)
    one, random, target = plan(*size), np.random.default_rng(size[1]), Target(kind=kind, cycles=24)
    rows = []
    for n in range(2):
        frame = shots.render_chart(studio, [one], random)
        found = shots.extract(frame, [one.region], camera=studio, target=target)
        rows.append(shots.row(f"chart-{n}", found))
    assert not judged(judge_sharpness, rows, SharpnessParams())
    assert not sharpness.fit(rows, SharpnessParams()).flags


@every_size
def test_clean_panels_and_flights_raise_nothing(size):
    camera = change(captures.SEQUOIA, height_px=size[0], width_px=size[1])
    random, region = np.random.default_rng(size[1]), Polygon.from_points(middle_of(size))
    rows = [
        replace(row, identified="P1")
        for role, minutes in (("panel", 0.0), ("field", 10.0), ("panel", 20.0))
        for row in captures.take(
            random, captures.PANEL_R, camera=camera, minutes=minutes, role=role, polygon=region
        )
    ]
    params = reflectance.Params()
    assert not judged(judge_reflectance, rows, captures.READINGS, params)
    assert not reflectance.fit(rows, captures.READINGS, params).flags


# --- Simulated campaigns: clean ones raise no alarm, and every fault is found where it is and nowhere else


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
            shining = replace(shot, lamp=Lamp(luminance_cd_m2=0.24))
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
    longer = replace(shot.settings, exposure_time_s=4 * shot.settings.exposure_time_s)
    over = replace(shot, settings=longer)
    bright = draw_row(drawn.campaign.camera, over, random, pixels=20000)
    rows = [bright if row.frame == shot.frame else row for row in drawn.rows]
    assert reasons(rows, drawn.readings) == {shot.frame: {"clipped"}}


def test_a_frame_under_another_scene_s_name():
    drawn = draw(5)
    index = next(i for i, row in enumerate(drawn.rows) if row.scene == "level-1")
    rows = list(drawn.rows)
    rows[index] = replace(rows[index], scene="level-5")
    assert reasons(rows, drawn.readings) == {rows[index].frame: {"scene_doubtful"}}


def render(campaign, shot, random, *, part=0.0):
    """A frame's row from its pixels; ``part`` of the region shows a surface with a tenth of the light."""
    shot = replace(shot, window=HERE)
    frame = take(campaign.camera, shot, random).frame
    if part:
        dim = replace(shot, lamp=Lamp(luminance_cd_m2=0.1 * shot.lamp.luminance_cd_m2))
        other = take(campaign.camera, dim, random).frame
        cut = round(part * HERE.width)
        samples = np.where(np.arange(HERE.width) < cut, other.samples_dn, frame.samples_dn)
        frame = replace(frame, samples_dn=samples)
    statistics = compute_statistics(frame, np.ones(frame.samples_dn.shape, np.bool_))
    row = draw_row(campaign.camera, shot, random, pixels=10)
    return replace(row, statistics=statistics)


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
