"""The campaign is the procedure's, well exposed; its truth is the same in a readout and in a full frame."""

from dataclasses import replace

import numpy as np
import pytest
import tifffile

from demo.luminance.campaign import plan_campaign
from demo.luminance.frames import expose, write_frame
from radiometry.frame.exposure import compute_rhs
from radiometry.frame.roi import Polygon, Window, mask

LEVELS = {"level-1": 54.4, "level-2": 2.94, "level-3": 1.28, "level-4": 1.2, "level-5": 0.26, "level-6": 0.24}


@pytest.fixture(scope="module")
def campaign():
    return plan_campaign(5)


def reduced(campaign, number, window):
    """The campaign with one shot only, read out through another window."""
    return replace(campaign, shots=(replace(campaign.shots[number], window=window),))


def test_every_iso_sees_every_level_at_several_apertures_and_the_dark(campaign):
    assert list(campaign.true_luminance_k) == [3200, 6400, 12800, 25600]
    for iso in campaign.true_luminance_k:
        own = [shot.exposed for shot in campaign.shots if shot.exposed.stated.iso == iso]
        for scene, luminance in LEVELS.items():
            light = [one for one in own if one.scene == scene]
            assert len({one.stated.f_number for one in light}) == len(light) >= 2
            assert {one.luminance_cd_m2 for one in light} == {luminance}
        dark = [one for one in own if one.role == "dark"]
        assert len(dark) >= 3
        assert {one.stated.f_number for one in dark} == {1.7, 5.6, 16.0}
        assert {one.luminance_cd_m2 for one in dark} == {0.0}


def test_apertures_run_from_widest_to_narrowest(campaign):
    f_numbers = {shot.exposed.stated.f_number for shot in campaign.shots}
    assert (min(f_numbers), max(f_numbers)) == (1.7, 16.0)


def test_no_frame_is_overexposed_and_none_is_lost(campaign):
    range_dn = campaign.camera.white_level_dn - campaign.camera.black_level_dn
    for shot in campaign.shots:
        if shot.exposed.role == "light":
            rhs = compute_rhs(shot.exposed.true, luminance_cd_m2=shot.exposed.luminance_cd_m2)
            assert 0.015 < campaign.sensor.centre_k * rhs / range_dn < 0.85


def test_one_frame_of_each_iso_is_whole_and_takes_the_campaigns_region(campaign):
    whole = [shot for shot in campaign.shots if shot.own_roi is None]
    assert {(shot.window.height, shot.window.width) for shot in whole} == {(3956, 5280)}
    assert [shot.exposed.stated.iso for shot in whole] == list(campaign.true_luminance_k)


def test_a_readout_carries_the_very_same_region(campaign):
    """The sites under the region are the same ones, whichever way it is given."""
    readout = next(shot for shot in campaign.shots if shot.own_roi is not None)
    window = readout.window
    here = mask(
        Polygon.from_points(readout.own_roi), Window(row0=0, col0=0, height=window.height, width=window.width)
    )
    np.testing.assert_array_equal(here, mask(Polygon.from_points(campaign.roi), window))
    assert here.any()
    assert window.row0 % 2 == window.col0 % 2 == 0  # the colours keep their order


def test_files_are_named_as_a_camera_names_them(campaign):
    names = [shot.filename for shot in campaign.shots]
    assert names[:2] == ["DJI_0001.DNG", "DJI_0002.DNG"]
    assert len(set(names)) == len(names)


def test_every_scene_is_measured_several_times_by_both_meters(campaign):
    for scene, luminance in LEVELS.items():
        shown = [r.value for r in campaign.readings if (r.scene, r.quantity) == (scene, "luminance")]
        assert len(shown) >= 3
        assert len(set(shown)) > 1
        assert np.mean(shown) == pytest.approx(luminance, rel=0.03)
        monitor = [r.value for r in campaign.readings if (r.scene, r.quantity) == (scene, "illuminance")]
        assert np.ptp(monitor) / np.mean(monitor) < 0.02  # the lamp is steady


def test_the_meters_certificates_hold_their_errors(campaign):
    by_kind = {meter.kind: meter for meter in campaign.meters}
    assert by_kind["luminance"].expanded_uncertainty_rel / by_kind["luminance"].coverage_factor > 0
    assert set(by_kind) == {reading.quantity for reading in campaign.readings}


def test_the_seed_decides_everything(campaign):
    again, other = plan_campaign(5), plan_campaign(6)
    assert again == campaign
    assert other.readings != campaign.readings
    window = Window(row0=1500, col0=2900, height=16, width=24)
    first = expose(reduced(campaign, 1, window), 0)
    np.testing.assert_array_equal(expose(reduced(again, 1, window), 0), first)
    assert not np.array_equal(expose(reduced(other, 1, window), 0), first)


def test_written_twice_the_files_are_the_same_bytes(campaign, tmp_path):
    small = reduced(campaign, 1, Window(row0=1500, col0=2900, height=20, width=24))
    first = write_frame(small, 0, tmp_path).read_bytes()
    assert write_frame(small, 0, tmp_path).read_bytes() == first


def test_the_file_says_what_was_set_and_not_what_is_true(campaign, tmp_path):
    small = reduced(campaign, 1, Window(row0=1500, col0=2900, height=20, width=24))
    path = write_frame(small, 0, tmp_path)
    with tifffile.TiffFile(path) as file:
        exif = file.pages[0].tags["ExifTag"].value
        samples = file.pages[0].asarray()
    stated = small.shots[0].exposed.stated
    assert np.divide(*exif["FNumber"]) == pytest.approx(stated.f_number, rel=1e-6)
    assert np.divide(*exif["ExposureTime"]) == pytest.approx(stated.exposure_time_s, rel=1e-6)
    assert stated.f_number != small.shots[0].exposed.true.f_number
    np.testing.assert_array_equal(samples, expose(small, 0))


def test_readout_and_full_frame_see_the_same_k(campaign):
    """Signal over exposure gives the same K in both, to the noise of the mean, cut into strips or not."""
    full = next(number for number, shot in enumerate(campaign.shots) if shot.own_roi is None)
    readout = campaign.shots[full + 1].window
    tall = Window(row0=readout.row0 - 200, col0=readout.col0 - 300, height=900, width=1400)
    found = [_k(campaign, full, window) for window in (readout, tall)]
    truth = campaign.true_luminance_k[3200]
    # 80 000 greens of some 1100 electrons each: 0.011 % for photons, 0.003 % for the fixed pattern's mean
    assert found == pytest.approx([truth, truth], rel=6e-4)


def _k(campaign, number, window):
    small = reduced(campaign, number, window)
    samples = expose(small, 0).astype(np.float64)
    row, col = np.indices(samples.shape)
    green = (row + window.row0 + col + window.col0) % 2 == 1
    under = mask(Polygon.from_points(campaign.roi), window) & green
    exposed = small.shots[0].exposed
    dark = (
        campaign.sensor.gain_dn_per_e(3200) * campaign.sensor.dark_current_e_s * exposed.true.exposure_time_s
    )
    signal = samples[under].mean() - campaign.sensor.black_level_dn - dark
    return signal / compute_rhs(exposed.true, luminance_cd_m2=exposed.luminance_cd_m2)
