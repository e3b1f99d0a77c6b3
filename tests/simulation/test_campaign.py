"""The simulated sensor tells the truth that the estimators must find."""

import math
from dataclasses import replace

import numpy as np
import pytest

from radiometry.frame.exposure import Settings, compute_rhs
from radiometry.frame.roi import Polygon, Window
from radiometry.frame.statistics import measure_signal
from radiometry.luminance import method as luminance
from simulation.camera import Lamp, change, expose, take
from simulation.luminance import ISOS, LUMINANCES_CD_M2, X5S, Errors, find_k, plan_campaign
from simulation.targets import Surface
from tests.radiometry.campaigns import TRUE_K, draw

NO_ERRORS = Errors(repeatability=0.0, calibration=0.0, f_number=0.0, exposure_time=0.0)
SMALL = change(X5S, height_px=120, width_px=160)
SETTINGS = Settings(exposure_time_s=0.125, f_number=4.0, iso=3200.0)


def render(camera, luminance_cd_m2, *, settings=SETTINGS, seed=1):
    lamp = Lamp(luminance_cd_m2=luminance_cd_m2)
    return expose(camera, Surface(), lamp, settings, np.random.default_rng(seed))


TRUTHS = {
    "falloff": lambda window: SMALL.share(4.0, window),
    "colour": SMALL.sensor.filter_light,
    "pattern": SMALL.sensor.pattern,
    "surface": lambda window: Surface(gradient=(0.1, 0.2), spots=[(40, 60, 9, 0.5)]).draw(SMALL, window),
}


@pytest.mark.parametrize("name", TRUTHS)
def test_a_window_has_the_truth_of_the_whole(name):
    whole = TRUTHS[name](SMALL.window)
    part = TRUTHS[name](Window(row0=31, col0=57, height=20, width=11))
    np.testing.assert_array_equal(part, whole[31:51, 57:68])


def test_falloff_by_hand():
    falloff = change(X5S, height_px=3, width_px=5).share(4.0)
    assert falloff[1, 2] == 1.0
    assert falloff[0, 0] == pytest.approx(1 - 0.55 * (2**2 + 1**2) / ((5**2 + 3**2) / 4))
    np.testing.assert_array_equal(falloff, falloff[::-1, ::-1])


def test_a_frame_holds_the_true_k_within_its_predicted_error():
    """PRNU is part of the frame, not of the truth: it adds 0.8 % over the root of the green pixels."""
    polygon = Polygon.from_points([(20, 30), (130, 25), (120, 100), (25, 90)])
    rows = luminance.extract(render(SMALL, 1.2), polygon)
    signal = measure_signal(rows)
    greens = sum(row.n for row in rows if row.channel in ("G1", "G2"))
    sensor = SMALL.sensor
    dark = sensor.black_level_dn + sensor.gain(3200.0) * sensor.dark_current_e_s * 0.125
    light = find_k(SMALL, polygon) * compute_rhs(SETTINGS, luminance_cd_m2=1.2)
    predicted = math.hypot(signal.standard_uncertainty_dn, light * sensor.prnu_rel / math.sqrt(greens))
    assert abs(signal.value_dn - dark - light) < 4 * predicted
    assert predicted / light < 0.003


def test_light_clips_at_the_white_level_and_dark_at_zero():
    bright = render(SMALL, 1000.0)
    assert bright.samples_dn.max() == 4095
    noisy = change(SMALL, black_level_dn=1.0)
    assert render(noisy, 0.0, settings=replace(SETTINGS, iso=25600.0)).samples_dn.min() == 0


def test_the_short_way_agrees_with_the_pixels():
    """Both draw the same mean and the same spread, within what their sizes allow."""
    drawn = draw(2, errors=NO_ERRORS)
    random = np.random.default_rng(5)
    camera = change(SMALL, sensitivity_e=TRUE_K / 1.5e-3, falloff=(0.0, 0.0, 0.0))
    for row, one in list(zip(drawn.rows, drawn.campaign.shots, strict=True))[::9]:
        frame = take(camera, one, random).frame
        full = luminance.extract(frame, Polygon.from_points([(0, 0), (160, 0), (160, 120), (0, 120)]))
        long, short = measure_signal(full), measure_signal(row.statistics)
        scatter = math.hypot(long.standard_uncertainty_dn, short.standard_uncertainty_dn)
        assert abs(long.value_dn - short.value_dn) < 4 * scatter
        spreads = [next(r.std_dn for r in rows if r.channel == "G1") for rows in (full, row.statistics)]
        assert spreads[0] == pytest.approx(spreads[1], rel=5 / math.sqrt(2 * 4800))


def test_a_campaign_is_usable_at_every_level():
    drawn = draw(3, errors=NO_ERRORS, isos=ISOS)
    result = luminance.fit(drawn.rows, drawn.readings, luminance.Params())
    assert [scene.luminance_cd_m2 for scene in result.scenes] == pytest.approx(list(LUMINANCES_CD_M2))
    for iso in ISOS:
        points = [p for p in result.points if p.iso == iso]
        assert {p.scene for p in points if p.used} == {f"level-{n}" for n in range(1, 7)}
        assert all(p.used for p in points)
        assert {p.f_number for p in points} == {1.7, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0}


def test_a_seed_gives_one_campaign():
    first, again, other = (
        plan_campaign(X5S, np.random.default_rng(seed), errors=Errors()) for seed in (1, 1, 2)
    )
    assert first == again
    assert first != other
