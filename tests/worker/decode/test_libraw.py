"""Files that only LibRaw reads."""

from uuid import uuid4

import numpy as np
import pytest
import rawpy

from radiometry.findings import InputRejected, files
from simulation.dng import LONG, RATIONAL
from tests.support import reader
from tests.worker.decode.dng_variants import Variant, make_dng, make_samples
from worker.decode import libraw

SAMPLES = make_samples(64, 96, 16)


@pytest.fixture
def tiff_ep(save):
    """A mosaic without DNG's own tags, as older cameras write it."""

    def write(samples=SAMPLES, **extra):
        exif = {33434: (RATIONAL, (1, 60))}
        content = make_dng(samples, Variant(exif=exif, **extra))
        version = b"\x12\xc6\x01\x00\x04\x00\x00\x00"
        assert content.count(version) == 1
        return save(content.replace(version, b"\xfe\xff\x01\x00\x04\x00\x00\x00"), f"{uuid4()}.nef")

    return write


def test_mosaic_and_exif(tiff_ep):
    path = tiff_ep()
    header = reader.read_header(path)
    assert (header.container, header.decoder, header.black_level_origin) == ("raw", "libraw", "libraw")
    assert (header.exposure_time_s, header.make) == (1 / 60, "Stilb")
    with rawpy.imread(str(path)) as raw:
        visible = raw.raw_image_visible.copy()
    assert (header.height_px, header.width_px) == visible.shape
    frame = reader.read_window(path, 10, 12, 20, 30)
    np.testing.assert_array_equal(frame.samples_dn, visible[10:30, 12:42])
    assert (frame.cfa, len(frame.black_level_dn)) == (header.cfa, 4)


def test_missing_samples_are_noticed_before_libraw_makes_them_up(tiff_ep):
    """Beyond the end of the file, or zero lines among lit ones."""
    cut = SAMPLES.copy()
    cut[40:44] = 0
    for path in (tiff_ep(extra={273: (LONG, 12_000)}), tiff_ep(cut), tiff_ep(np.zeros_like(SAMPLES))):
        with pytest.raises(InputRejected) as caught:
            reader.read_header(path)
        assert caught.value.code is files.TRUNCATED


def test_a_dark_frame_that_its_camera_clips_at_zero_is_read(tiff_ep):
    dark = np.zeros_like(SAMPLES)
    dark[::7, ::5] = 3
    assert reader.read_header(tiff_ep(dark)).decoder == "libraw"


def test_an_unsafe_version_is_not_used(monkeypatch):
    assert libraw.check_version()
    monkeypatch.setattr(libraw.rawpy, "__version__", "0.27.9")
    with pytest.raises(RuntimeError, match=r"0\.28 or newer"):
        libraw.check_version()
