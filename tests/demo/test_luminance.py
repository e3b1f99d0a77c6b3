"""The campaign is the procedure's, well exposed; its truth is the same in a readout and in a full frame."""

from dataclasses import replace

import numpy as np
import pytest
import tifffile
from rich.console import Console

from demo.journey import Display, Stage, see_from
from demo.journey import take as take_all
from demo.luminance import ROI, plan
from radiometry.frame.exposure import compute_rhs
from radiometry.frame.roi import Polygon, Window, mask
from simulation.camera import take

LEVELS = {"level-1": 54.4, "level-2": 2.94, "level-3": 1.28, "level-4": 1.2, "level-5": 0.26, "level-6": 0.24}


@pytest.fixture(scope="module")
def campaign():
    return plan(5)


def expose(campaign, number, window, *, seed=5):
    """The samples of one shot, read out through another window."""
    shot = replace(campaign.shots[number], window=window)
    return take(campaign.camera, shot, np.random.default_rng([seed, 0])).frame.samples_dn


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
        assert {one.settings.f_number for one in dark} == {1.7, 5.6, 16.0}
        assert {one.lamp.luminance_cd_m2 for one in dark} == {0.0}


def test_apertures_run_from_widest_to_narrowest(campaign):
    f_numbers = {shot.settings.f_number for shot in campaign.shots}
    assert (min(f_numbers), max(f_numbers)) == (1.7, 16.0)


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


def test_files_are_named_as_a_camera_names_them(campaign):
    names = [shot.frame for shot in campaign.shots]
    assert names[:2] == ["DJI_0001", "DJI_0002"]
    assert len(set(names)) == len(names)


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


def test_the_seed_decides_everything(campaign):
    again, other = plan(5), plan(6)
    assert again == campaign
    assert other.readings != campaign.readings
    window = Window(row0=1500, col0=2900, height=16, width=24)
    first = expose(campaign, 1, window)
    np.testing.assert_array_equal(expose(again, 1, window), first)
    assert not np.array_equal(expose(other, 1, window, seed=6), first)


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
    np.testing.assert_array_equal(samples, expose(campaign, 1, window))


def test_readout_and_full_frame_see_the_same_k(campaign):
    """Signal over exposure gives the same K in both, to the noise of the mean, cut into strips or not."""
    full = next(number for number, shot in enumerate(campaign.shots) if shot.window is None)
    readout = campaign.shots[full + 1].window
    tall = Window(row0=readout.row0 - 200, col0=readout.col0 - 300, height=900, width=1400)
    found = [_k(campaign, full, window) for window in (readout, tall)]
    truth = campaign.true_luminance_k[3200]
    # 80 000 greens of some 1100 electrons each: 0.011 % for photons, 0.003 % for the fixed pattern's mean
    assert found == pytest.approx([truth, truth], rel=6e-4)


def _k(campaign, number, window):
    samples = expose(campaign, number, window).astype(np.float64)
    row, col = np.indices(samples.shape)
    green = (row + window.row0 + col + window.col0) % 2 == 1
    under = mask(ROI, window) & green
    shot, camera = campaign.shots[number], campaign.camera
    true, sensor = camera.set_truly(shot.settings), camera.sensor
    dark = sensor.gain(3200) * sensor.dark_current_e_s * true.exposure_time_s
    signal = samples[under].mean() - sensor.black_level_dn - dark
    return signal / compute_rhs(true, luminance_cd_m2=shot.lamp.luminance_cd_m2)
