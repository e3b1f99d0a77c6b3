"""The DNG is one that others read: LibRaw the very samples, tifffile the exposure."""

import math
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest
import rawpy
import tifffile

from radiometry.frame.exposure import Settings
from simulation.camera import Camera, change
from simulation.dng import write_dng

CAMERA = Camera()
SETTINGS = Settings(exposure_time_s=1 / 60, f_number=1.7, iso=25600)
TAKEN_AT = datetime(2025, 3, 1, 21, 4, 5, tzinfo=UTC)


def mosaic(shape=(301, 515)):
    samples = np.random.default_rng(3).integers(0, 4096, shape).astype(np.uint16)
    samples[0, 0], samples[-1, -1] = 0, 4095
    return samples


def written(tmp_path, samples, **changes):
    path = tmp_path / "DJI_0001.DNG"
    write_dng(path, samples, **{"camera": CAMERA, "settings": SETTINGS, "taken_at": TAKEN_AT, **changes})
    return path


@pytest.mark.parametrize("compression", ["none", "ljpeg"])
@pytest.mark.parametrize("shape", [(50, 62), (301, 515), (256, 256), (1000, 300)])
def test_libraw_reads_the_very_samples(tmp_path, shape, compression):
    samples = mosaic(shape)
    with rawpy.imread(str(written(tmp_path, samples, compression=compression))) as raw:
        np.testing.assert_array_equal(raw.raw_image_visible, samples)
        assert raw.black_level_per_channel == [256] * 4
        assert raw.white_level == 4095
        assert raw.raw_pattern.tolist() == [[0, 1], [3, 2]]


@pytest.mark.parametrize("cfa", ["RGGB", "GBRG", "BGGR", "GRBG"])
def test_libraw_sees_the_colours_in_their_order(tmp_path, cfa):
    camera = change(Camera(), black_level_dn=0, serial="S", cfa=cfa)
    with rawpy.imread(str(written(tmp_path, mosaic(), camera=camera))) as raw:
        colours = [raw.color_desc.decode()[index] for index in np.ravel(raw.raw_pattern)]
    assert "".join(colours) == cfa


def test_the_exif_directory_and_the_camera_come_back(tmp_path):
    path = written(tmp_path, mosaic())
    with tifffile.TiffFile(path) as file:
        tags = {tag.name: tag.value for tag in file.pages[0].tags}
    exif = tags["ExifTag"]
    assert exif["ExposureTime"] == (1, 60)
    assert exif["FNumber"] == (17, 10)
    assert exif["ISOSpeedRatings"] == 25600
    assert (exif["ExposureMode"], exif["ExposureProgram"]) == (1, 1)
    assert (exif["DateTimeOriginal"], exif["OffsetTimeOriginal"]) == ("2025:03:01 21:04:05", "+00:00")
    assert (exif["BodySerialNumber"], exif["LensSerialNumber"]) == ("0K8TF1A0010042", "L0042")
    assert (exif["LensMake"], exif["LensModel"]) == ("DJI", "DJI MFT 15mm F1.7 ASPH")
    assert (tags["Make"], tags["Model"], tags["UniqueCameraModel"]) == ("DJI", "FC6520", "DJI FC6520")
    assert tags["CameraSerialNumber"] == "0K8TF1A0010042"
    assert tags["DNGVersion"] == bytes((1, 4, 0, 0))
    with rawpy.imread(str(path)) as raw:
        assert (raw.other.iso_speed, raw.other.aperture) == (25600, pytest.approx(1.7))
        assert raw.other.shutter_speed == pytest.approx(1 / 60)
    moment = datetime(2025, 3, 1, 21, 4, 5, tzinfo=timezone(timedelta(hours=-5, minutes=-30)))
    with tifffile.TiffFile(written(tmp_path, mosaic(), taken_at=moment)) as file:
        assert file.pages[0].tags["ExifTag"].value["OffsetTimeOriginal"] == "-05:30"


@pytest.mark.parametrize("exposure_time_s", [4.0, 1.0, 1 / 8, 1 / 8000])
@pytest.mark.parametrize("f_number", [1.7, 4.0, 16.0])
def test_apex_values_agree_with_the_nominal_ones(tmp_path, exposure_time_s, f_number):
    settings = Settings(exposure_time_s=exposure_time_s, f_number=f_number, iso=25600)
    with tifffile.TiffFile(written(tmp_path, mosaic(), settings=settings)) as file:
        exif = file.pages[0].tags["ExifTag"].value
    speed, aperture = (np.divide(*exif[name]) for name in ("ShutterSpeedValue", "ApertureValue"))
    assert 2.0**-speed == pytest.approx(np.divide(*exif["ExposureTime"]), rel=1e-6)
    assert math.sqrt(2.0**aperture) == pytest.approx(np.divide(*exif["FNumber"]), rel=1e-6)


def test_the_same_samples_give_the_same_bytes(tmp_path):
    first = written(tmp_path, mosaic()).read_bytes()
    assert written(tmp_path, mosaic()).read_bytes() == first
