"""A map made strip by strip is the map of the whole frame, and its file says what it is."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import ExifTags, Image

from bench.frames import make_mosaic
from bench.harness import Scale
from radiometry.frame.exposure import Exposure
from radiometry.luminance import SPEC
from radiometry.luminance.maps import MapScale, compute_map
from tests.support.frames import write_raw
from worker.decode.metadata import read_metadata
from worker.decode.pool import DecoderPool
from worker.decode.tiff import read_directories
from worker.maps import making as strips
from worker.maps.making import make_map
from worker.maps.picture import LUMINANCE
from worker.maps.tiff import ROUNDING_REL, MapFacts
from worker.measuring.surface import make_subject

SCALE = MapScale(slope_cd_m2_per_dn=0.004, dark_signal_dn=256.3, channel="green")
EXPOSURE = Exposure(
    exposure_time_s=1 / 60, f_number=5.6, iso=6400.0, exposure_time_apex_s=1 / 64, f_number_apex=2**2.5
)


@pytest.fixture(scope="module")
def decoders():
    with DecoderPool() as pool:
        yield pool


def save_frame(path, shape, *, compression="none", top=3000):
    mosaic = np.random.default_rng(1).integers(200, top, shape).astype(np.uint16)
    stated = {"exposure_time_s": 1 / 60, "f_number": 5.6, "iso": 6400, "serial": "S-1", "lens_model": "15mm"}
    return write_raw(path, mosaic, compression=compression, **stated)


def make(decoders, path, *, scale=SCALE, **place):
    header = replace(decoders.read_header(path), **place)
    facts = MapFacts(header=header, exposure=EXPOSURE, software="stilb test", description={"unit": "cd/m2"})
    target = path.with_suffix(".tif")
    subject = make_subject(SPEC.application, path, header, scale)
    make_map(decoders, subject, facts, target, style=LUMINANCE, caption="frame")
    return target


def read_back(target):
    return read_metadata(read_directories(target.read_bytes())[0])


@pytest.mark.parametrize(("compression", "channel"), [("none", "green"), ("ljpeg", "grey")])
@pytest.mark.parametrize("shape", [(16, 20), (300, 517), (530, 270)])
def test_strips_and_tiles_make_the_whole(decoders, tmp_path, monkeypatch, shape, compression, channel):
    monkeypatch.setattr(strips, "_STRIP_PX", 30_000)
    path = save_frame(tmp_path / "frame.dng", shape, compression=compression, top=4300)
    scale = replace(SCALE, channel=channel)
    target = make(decoders, path, scale=scale)
    whole = compute_map(decoders.read_window(path, (0, 0, *shape)), scale)
    found = tifffile.imread(target)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, whole, rtol=ROUNDING_REL)
    assert np.isnan(found).any()
    assert not np.any(found[np.isfinite(found)].view(np.uint32) & 0x7FF)


@pytest.mark.parametrize(
    ("band", "first", "height", "expected"),
    [
        (256, 256, 1000, [(0, 256), (256, 256), (512, 256), (768, 232)]),
        (256, 100, 600, [(0, 100), (100, 256), (356, 244)]),
        (2, 2, 600, [(0, 210), (210, 210), (420, 180)]),
        (4000, 4000, 600, [(0, 600)]),
    ],
)
def test_strips_are_whole_bands_of_the_files_tiles(
    decoders, tmp_path, monkeypatch, band, first, height, expected
):
    monkeypatch.setattr(strips, "_STRIP_PX", 20_000)
    header = decoders.read_header(save_frame(tmp_path / "frame.dng", (64, 96)))
    header = replace(header, height_px=height, width_px=95, band_rows=band, first_band_rows=first)
    assert strips.cut_strips(header) == expected


def test_the_file_keeps_what_the_frame_said(decoders, tmp_path):
    place = {"latitude_deg": -33.456789, "longitude_deg": 0.000001, "altitude_m": -12.25}
    target = make(decoders, save_frame(tmp_path / "frame.dng", (300, 520)), **place)
    found = read_back(target)
    assert (found["make"], found["model"], found["serial"]) == ("DJI", "FC6520", "S-1")
    assert (found["exposure_time_s"], found["f_number"], found["iso"]) == (1 / 60, 5.6, 6400)
    assert found["exposure_time_apex_s"] == pytest.approx(1 / 64)
    assert found["f_number_apex"] == pytest.approx(2**2.5, rel=1e-6)
    assert (found["lens_make"], found["lens_model"], found["lens_serial"]) == ("DJI", "15mm", "L1")
    assert found["taken_at"] == "2026-05-01T20:00:00+00:00"
    assert (found["latitude_deg"], found["longitude_deg"]) == pytest.approx((-33.456789, 1e-6), abs=3e-10)
    assert found["altitude_m"] == -12.25
    with tifffile.TiffFile(target) as file:
        page = file.pages[0]
        assert (page.tile, page.compression.name) == ((256, 256), "ADOBE_DEFLATE")
        assert json.loads(page.description) == {"unit": "cd/m2", "rounding_rel": ROUNDING_REL}
        assert page.software == "stilb test"
    with Image.open(target) as image:
        exif = image.getexif()
        assert exif.get_ifd(ExifTags.IFD.Exif)[ExifTags.Base.FNumber] == 5.6
        assert exif.get_ifd(ExifTags.IFD.GPSInfo)[ExifTags.GPS.GPSLatitudeRef] == "S"


def test_a_frame_that_says_little_makes_a_map_that_says_no_more(decoders, tmp_path):
    bare = dict.fromkeys(("make", "model", "serial", "lens_make", "lens_model", "lens_serial", "taken_at"))
    target = make(decoders, save_frame(tmp_path / "frame.dng", (64, 96)), **bare)
    found = read_back(target)
    assert (found["make"], found["serial"], found["taken_at"], found.get("latitude_deg")) == (None,) * 4
    assert found["exposure_time_s"] == 1 / 60


def test_the_same_frame_makes_the_same_bytes_and_times_of_every_form_are_kept(decoders, tmp_path):
    path = save_frame(tmp_path / "frame.dng", (300, 520))
    first, again = (make(decoders, path).read_bytes() for _ in range(2))
    assert first == again
    for stamp in ("2026-05-01T20:00:00", "2026-05-01T20:00:00.125", "2026-05-01T20:00:00.5-07:30"):
        assert read_back(make(decoders, path, taken_at=stamp))["taken_at"] == stamp


PEAK = """
import sys
from pathlib import Path
import worker
from radiometry.frame.exposure import Exposure
from radiometry.luminance import SPEC
from radiometry.luminance.maps import MapScale
from radiometry.luminance.measurement import Request, find_window, measure
from radiometry.frame.roi import Polygon
from tests.radiometry.coefficients import COEFFICIENT
from worker.decode.pool import DecoderPool
from worker.maps.making import make_map
from worker.maps.picture import LUMINANCE
from worker.measuring.surface import make_subject
from worker.maps.tiff import ROUNDING_REL, MapFacts

path = Path(sys.argv[1])
exposure = Exposure(exposure_time_s=0.01, f_number=4.0, iso=3200.0)
with DecoderPool() as decoders:
    header = decoders.read_header(path)
    wide, high = header.width_px, header.height_px
    whole = Polygon.from_points([(0, 0), (wide, 0), (wide, high), (0, high)])
    frame = decoders.read_window(path, (0, 0, high, wide))
    measure(frame, Request(polygon=whole), exposure=exposure, coefficients=(COEFFICIENT,),
            calibrated=(whole,))
    del frame
    scale = MapScale(slope_cd_m2_per_dn=0.004, dark_signal_dn=256.3, channel="green")
    facts = MapFacts(header=header, exposure=exposure, software="stilb", description={})
    make_map(decoders, make_subject(SPEC.application, path, header, scale), facts, path.with_suffix(".tif"),
             style=LUMINANCE, caption="whole")
status = Path("/proc/self/status").read_text()
print(wide * high, status.partition("VmHWM:")[2].split()[0])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the peak is read from /proc")
def test_a_whole_frame_of_20_megapixels_stays_below_600_mb(tmp_path):
    """The whole frame as region and as map, in a process that has imported all that a worker does."""
    path = tmp_path / "frame.dng"
    write_raw(path, make_mosaic(Scale()), iso=3200)
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-c", PEAK, str(path)], check=True, cwd=root, capture_output=True, text=True
    )
    pixels, peak_kb = map(int, done.stdout.split())
    assert pixels > 20_000_000
    assert peak_kb * 1024 < 600e6
