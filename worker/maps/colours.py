"""A colour scale whose steps look equal: lightness rises evenly from dark violet to pale yellow."""

import numpy as np
from numpy.typing import NDArray

COLOURS = 256

_LIGHTNESS = (0.18, 0.95)
_HUES_DEG = (300.0, 105.0)
_CHROMA = 0.16

Table = NDArray[np.uint8]


def make_colours() -> Table:
    """The table, (256, 3) sRGB.

    In Oklab [1] a distance is nearly what an eye sees: lightness in equal steps, the hue turning once from
    violet over red to yellow, the chroma as strong as the screen allows.
    References [1] B. Ottosson, A perceptual color space for image processing, 2020
    """
    share = np.linspace(0.0, 1.0, COLOURS)
    lightness = _LIGHTNESS[0] + (_LIGHTNESS[1] - _LIGHTNESS[0]) * share
    # the short way round, through red
    hue = np.radians(_HUES_DEG[0] + (_HUES_DEG[1] + 360.0 - _HUES_DEG[0]) * share)
    linear = np.empty((COLOURS, 3))
    for index in range(COLOURS):
        linear[index] = _strongest(lightness[index], hue[index])
    curved = 1.055 * np.maximum(linear, 0.0) ** (1 / 2.4) - 0.055
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, curved)
    return np.round(255 * np.clip(encoded, 0.0, 1.0)).astype(np.uint8)


def _strongest(lightness: float, hue: float) -> NDArray[np.float64]:
    """The most colourful screen colour of a lightness and a hue, up to the scale's chroma: by halving."""
    low, high = 0.0, _CHROMA
    for _ in range(24):
        middle = (low + high) / 2
        linear = to_linear_rgb(lightness, middle * np.cos(hue), middle * np.sin(hue))
        inside = bool(np.all((linear >= 0.0) & (linear <= 1.0)))
        low, high = (middle, high) if inside else (low, middle)
    return to_linear_rgb(lightness, low * np.cos(hue), low * np.sin(hue))


def to_linear_rgb(lightness: float, a: float, b: float) -> NDArray[np.float64]:
    """Oklab to linear sRGB."""
    cones = np.array(
        [
            lightness + 0.3963377774 * a + 0.2158037573 * b,
            lightness - 0.1055613458 * a - 0.0638541728 * b,
            lightness - 0.0894841775 * a - 1.2914855480 * b,
        ]
    )
    matrix = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    return np.asarray(matrix @ cones**3, np.float64)
