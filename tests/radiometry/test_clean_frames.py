"""Frames of plain noise and smooth vignetting raise no warning, whatever the size of the sensor."""

from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest

from radiometry.frame.grid import Grid
from radiometry.frame.proof import WholenessCheck
from radiometry.frame.roi import Polygon
from radiometry.luminance import method as luminance
from radiometry.luminance.measurement import Request, measure
from radiometry.luminance.rows import FrameRow, Params
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
from simulation.camera import change, take
from simulation.targets import CHART_STUDIO, FAST_LENS, Edge, Star, Surface, plan_dark, plan_flat
from tests.radiometry import evidence
from tests.radiometry.campaigns import draw
from tests.radiometry.evidence import taken
from tests.radiometry.noise import series
from tests.radiometry.reflectance import captures
from tests.radiometry.sharpness import shots
from tests.radiometry.vignetting import flats

SIZES = [(96, 128), (113, 113), (512, 640)]
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


# --- Simulated campaigns: clean ones raise no alarm


SEEDS = 15


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
