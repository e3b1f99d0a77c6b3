"""The campaign is the procedure's and well exposed; what is sent states what was set."""

from dataclasses import replace

import numpy as np
import pytest
import tifffile
from rich.console import Console

from demo.journey import Display, Stage, see_from
from demo.journey import take as take_all
from demo.luminance import ROI, plan
from radiometry.frame.roi import Polygon, Window, mask
from simulation.camera import take

LEVELS = {"level-1": 54.4, "level-2": 2.94, "level-3": 1.28, "level-4": 1.2, "level-5": 0.26, "level-6": 0.24}


@pytest.fixture(scope="module")
def campaign():
    return plan(5)


def test_every_iso_sees_every_level_at_several_apertures_and_the_dark(campaign):
    assert list(campaign.true_luminance_k) == [3200, 6400, 12800, 25600]
    for iso in campaign.true_luminance_k:
        own = [shot for shot in campaign.shots if shot.settings.iso == iso]
        for scene, luminance in LEVELS.items():
            light = [one for one in own if one.scene == scene]
            assert len({one.settings.f_number for one in light}) == len(light) >= 2
            assert {one.lamp.luminance_cd_m2 for one in light} == {luminance}
        dark = [one for one in own if one.role == "dark"]
        assert len(dark) >= 3
        # from the widest to the narrowest
        assert {one.settings.f_number for one in dark} == {1.7, 5.6, 16.0}
        assert {one.lamp.luminance_cd_m2 for one in dark} == {0.0}


def test_no_frame_is_overexposed_and_none_is_lost(campaign):
    camera = campaign.camera
    range_dn = camera.sensor.white_level_dn - camera.sensor.black_level_dn
    for shot in campaign.shots:
        if shot.role == "light":
            light_e = camera.collect(shot.settings, luminance_cd_m2=shot.lamp.luminance_cd_m2)
            assert 0.015 < camera.sensor.gain(shot.settings.iso) * light_e / range_dn < 0.85


def test_one_frame_of_each_iso_is_whole_and_takes_the_campaigns_region(campaign):
    whole = [shot for shot in campaign.shots if shot.window is None]
    assert (campaign.camera.window.height, campaign.camera.window.width) == (3956, 5280)
    assert [shot.settings.iso for shot in whole] == list(campaign.true_luminance_k)


def test_a_readout_carries_the_very_same_region(campaign):
    """The sites under the region are the same ones, whichever way it is given."""
    window = next(shot.window for shot in campaign.shots if shot.window is not None)
    own = Polygon.from_points(see_from(window, ROI))
    here = mask(own, Window(row0=0, col0=0, height=window.height, width=window.width))
    np.testing.assert_array_equal(here, mask(ROI, window))
    assert here.any()
    assert window.row0 % 2 == window.col0 % 2 == 0  # the colours keep their order


def values_of(campaign, scene, quantity):
    return [r["value"] for r in campaign.readings if (r["scene"], r["quantity"]) == (scene, quantity)]


def test_every_scene_is_measured_several_times_by_both_meters(campaign):
    for scene, luminance in LEVELS.items():
        shown = values_of(campaign, scene, "luminance")
        assert len(shown) >= 3
        assert len(set(shown)) > 1
        assert np.mean(shown) == pytest.approx(luminance, rel=0.03)
        monitor = values_of(campaign, scene, "illuminance")
        assert np.ptp(monitor) / np.mean(monitor) < 0.02  # the lamp is steady


class Sent:
    """A client that keeps what it was asked to send."""

    def push_all(self, uploads, **_):
        self.uploads = uploads
        return []


@pytest.fixture
def stage(tmp_path):
    return Stage(client=Sent(), folder=tmp_path, display=Display(Console()))


def write(stage, campaign):
    window = Window(row0=1500, col0=2900, height=20, width=24)
    shot = replace(campaign.shots[1], window=window)
    take_all(stage, "c", [shot], camera=campaign.camera, seed=5, roi=ROI)
    return stage.client.uploads[0]


def test_written_twice_the_files_are_the_same_bytes(campaign, stage):
    first = write(stage, campaign).path.read_bytes()
    assert write(stage, campaign).path.read_bytes() == first


def test_the_file_says_what_was_set_and_not_what_is_true(campaign, stage):
    upload, shot = write(stage, campaign), campaign.shots[1]
    window = Window(row0=1500, col0=2900, height=20, width=24)
    assert (upload.role, upload.scene, upload.roi) == (shot.role, shot.scene, see_from(window, ROI))
    with tifffile.TiffFile(upload.path) as file:
        exif = file.pages[0].tags["ExifTag"].value
        samples = file.pages[0].asarray()
    assert np.divide(*exif["FNumber"]) == pytest.approx(shot.settings.f_number, rel=1e-6)
    assert np.divide(*exif["ExposureTime"]) == pytest.approx(shot.settings.exposure_time_s, rel=1e-6)
    assert shot.settings.f_number != campaign.camera.set_truly(shot.settings).f_number
    truly = take(campaign.camera, replace(shot, window=window), np.random.default_rng([5, 0]))
    np.testing.assert_array_equal(samples, truly.frame.samples_dn)
