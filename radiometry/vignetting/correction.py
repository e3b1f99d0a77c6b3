"""The correction as a picture: one gain for every pixel of the mosaic."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.statistics import GREY, name_site
from radiometry.vignetting.application import evaluate_window, list_windows
from radiometry.vignetting.results import Coefficient

_COLOURS = ("R", "G", "B")


def compute_correction(
    coefficients: Sequence[Coefficient], *, cfa: str, f_number: float
) -> NDArray[np.float32]:
    """Give 1 / V of every pixel, each with its own channel's curve; multiply the signal above dark by it.

    Takes
      cfa : the pattern at the frame's corner, "grey" for one channel, "rgb" for a rendered image
    Returns (row, col) float32, or (row, col, 3) for "rgb"
    Raises InputRejected(vignetting_not_calibrated)
    """
    height, width = coefficients[0].height_px, coefficients[0].width_px
    if cfa == "rgb":
        planes = [_fill(coefficients, channel, f_number) for channel in _COLOURS]
        return np.stack(planes, axis=-1)
    if cfa == GREY:
        return _fill(coefficients, coefficients[0].channel, f_number)
    gains = np.empty((height, width), np.float32)
    for index in range(4):
        site = (slice(index // 2, None, 2), slice(index % 2, None, 2))
        gains[site] = _fill(coefficients, name_site(cfa, index), f_number)[site]
    return gains


def _fill(coefficients: Sequence[Coefficient], channel: str, f_number: float) -> NDArray[np.float32]:
    """Give one channel's gain at every pixel, a band of rows at a time."""
    gains = np.empty((coefficients[0].height_px, coefficients[0].width_px), np.float32)
    for window in list_windows(*gains.shape):
        share = evaluate_window(coefficients, window, channel=channel, f_number=f_number)
        gains[window.row0 : window.row0 + window.height] = share.gain
    return gains
