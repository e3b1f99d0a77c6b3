"""The picture to draw a region on: its scale, its geometry, and that tiles are decoded once."""

import imagecodecs
import numpy as np
import pytest

from tests.support import reader
from tests.worker.decode.dng_variants import Variant, make_dng
from worker.decode import ljpeg

ROWS, COLS = 240, 400


def _scene():
    """Dark but for a bright box at rows 60 to 119, columns 200 to 299."""
    samples = np.full((ROWS, COLS), 500, np.uint16)
    samples[60:120, 200:300] = 9000
    return samples


@pytest.fixture(params=["none", "ljpeg", "12 bit"])
def path(request, save):
    bits = 12 if request.param == "12 bit" else 16
    compression = "ljpeg" if request.param == "ljpeg" else "none"
    variant = Variant(bits=bits, compression=compression, tile=(64, 64) if bits == 16 else None)
    return save(make_dng(_scene() >> (16 - bits), variant))


@pytest.mark.parametrize("longest", [100, 73, 400])
def test_scale_is_the_ratio_of_widths(path, longest):
    picture = imagecodecs.png_decode(reader.render_preview(path, longest))
    height, width = picture.shape
    assert (width, height) == (longest, round(ROWS * longest / COLS))
    bright_rows, bright_cols = np.nonzero(picture > 200)
    scale = COLS / width
    assert bright_rows.min() * scale == pytest.approx(60, abs=scale + 2)
    assert (bright_rows.max() + 1) * scale == pytest.approx(120, abs=scale + 2)
    assert bright_cols.min() * scale == pytest.approx(200, abs=scale + 2)
    assert (bright_cols.max() + 1) * scale == pytest.approx(300, abs=scale + 2)


def test_every_tile_is_decoded_once(save, monkeypatch):
    path = save(make_dng(_scene(), Variant(compression="ljpeg", tile=(48, 80))))
    decoded = []
    decode = ljpeg.decode

    def counted(data, *, samples):
        decoded.append(bytes(data))
        return decode(data, samples=samples)

    monkeypatch.setattr(ljpeg, "decode", counted)
    reader.render_preview(path, 100)
    assert len(decoded) == (ROWS // 48) * (COLS // 80)


def test_small_frame_is_not_enlarged(save):
    path = save(make_dng(_scene(), Variant()))
    assert imagecodecs.png_decode(reader.render_preview(path, 1600)).shape == (ROWS, COLS)


@pytest.mark.parametrize("longest", [100, 300, 400])
def test_colour_pattern_does_not_show(longest, save):
    samples = np.full((ROWS, COLS), 1000, np.uint16)
    samples[::2, ::2] = 4000
    path = save(make_dng(samples, Variant()))
    assert np.ptp(imagecodecs.png_decode(reader.render_preview(path, longest))) == 0


def test_frame_without_light_is_black_and_not_an_error(save):
    path = save(make_dng(np.zeros((ROWS, COLS), np.uint16), Variant()))
    assert not imagecodecs.png_decode(reader.render_preview(path, 100)).any()


def test_rgb_is_shown_grey(real_files):
    picture = imagecodecs.png_decode(reader.render_preview(real_files / "edge" / "Test_edge1.tif"))
    assert picture.shape == (124, 343)
