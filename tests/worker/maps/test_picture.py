"""The picture: even colours, a logarithmic scale with its ticks, and what is unknown stands out."""

import io
import itertools

import numpy as np
import pytest
from PIL import Image

from radiometry.drawing.chart import WIDEST_PX
from worker.maps.picture import COLOURS, Reduction, Scale, choose_scale, draw_picture, make_colours


def to_lightness(colours):
    """CIE 1976 lightness of sRGB: another yardstick than the one that the table was made with."""
    share = colours / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    return np.where(luminance > 0.008856, 116 * np.cbrt(luminance) - 16, 903.3 * luminance)


def test_lightness_rises_evenly_through_the_colours():
    table = make_colours()
    lightness = to_lightness(table.astype(float))
    assert table.shape == (COLOURS, 3)
    assert lightness[-1] - lightness[0] > 75
    steps = np.diff(lightness[::16])
    assert np.all(steps > 0)
    assert steps.max() < 2 * steps.min()
    assert len({tuple(colour) for colour in table.tolist()}) == COLOURS


def test_equal_ratios_are_equal_steps_of_the_scale():
    scale = Scale(0.1, 1000.0)
    places = scale.place(np.array([0.01, 0.1, 1.0, 10.0, 100.0, 1000.0, 5000.0, -3.0]))
    assert places.tolist() == [0, 0, 64, 128, 192, 255, 255, 0]


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (0.3, 3.0, [0.5, 1.0, 2.0]),
        (1.0, 10.0, [1.0, 2.0, 5.0, 10.0]),
        (0.01, 1000.0, [0.01, 0.1, 1.0, 10.0, 100.0, 1000.0]),
    ],
)
def test_ticks_are_round_numbers_within(low, high, ticks):
    assert Scale(low, high).ticks() == pytest.approx(ticks)


def test_the_scale_leaves_a_lamp_and_the_dark_aside():
    means = np.geomspace(1.0, 100.0, 10_000)
    means[:5], means[-5:], means[20] = -1.0, 1e6, np.nan
    scale = choose_scale(means)
    assert (scale.low, scale.high) == pytest.approx((1.0, 100.0), rel=0.1)


@pytest.mark.parametrize("means", [np.full((4, 4), 3.0), np.full((4, 4), np.nan), np.zeros((4, 4))])
def test_a_scale_has_always_a_length(means):
    scale = choose_scale(means)
    assert 0 < scale.low < scale.high
    assert draw_picture(means, "x").startswith(b"\x89PNG")


@pytest.mark.parametrize("bands", [(256, 256, 188), (700,), (1, 698, 1)])
def test_squares_are_averaged_across_bands(bands):
    luminance = np.random.default_rng(1).random((700, 4300)).astype(np.float32)
    luminance[10, 20] = np.nan
    reduction = Reduction(700, 4300)
    tops = np.cumsum([0, *bands])
    for top, bottom in itertools.pairwise(tops):
        reduction.add(reduction.reduce(luminance[top:bottom], top=int(top)))
    assert reduction.factor == 4
    expected = luminance.reshape(175, 4, 1075, 4).astype(float).mean(axis=(1, 3))
    assert np.argwhere(np.isnan(reduction.means())).tolist() == [[2, 5]]
    np.testing.assert_allclose(reduction.means(), expected, rtol=1e-5)


def test_what_is_left_at_the_border_is_not_shown():
    reduction = Reduction(10, 5602)
    for top in (0, 9):
        reduction.add(reduction.reduce(np.ones((9 if top == 0 else 1, 5602), np.float32), top=top))
    assert reduction.means().shape == (2, 1120)
    assert np.all(reduction.means() == 1.0)


def test_the_picture_shows_dark_dark_bright_bright_and_unknown_apart():
    means = np.tile(np.geomspace(1.0, 100.0, 300), (250, 1))
    means[:20, :20] = np.nan
    with Image.open(io.BytesIO(draw_picture(means, "a caption"))) as image:
        pixels = np.asarray(image)
    assert image.width <= WIDEST_PX
    table = make_colours()
    assert pixels[100, 1].tolist() == table[0].tolist()
    assert pixels[100, 298].tolist() in table[-4:].tolist()
    assert pixels[5, 5].tolist() not in table.tolist()
    bar = pixels[60:225, 300 + 20]
    assert to_lightness(bar[2].astype(float)) > to_lightness(bar[-2].astype(float)) + 60
    labels = pixels[50:230, 300 + 60 :]
    assert (labels < 100).all(axis=2).sum() > 50
    assert (pixels[260:] < 100).all(axis=2).sum() > 50


def test_the_widest_frame_fits():
    means = np.ones(Reduction(10, 65_535).shape)
    with Image.open(io.BytesIO(draw_picture(means, "x"))) as image:
        assert image.width <= WIDEST_PX
