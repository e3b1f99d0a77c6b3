"""The correction as a picture: one gain for every pixel of the mosaic."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.statistics import GREY, name_site
from radiometry.vignetting.application import BAND_ROWS
from radiometry.vignetting.lens import Lens
from radiometry.vignetting.results import Coefficient

_COLOURS = ("R", "G", "B")


def compute_correction(
    coefficients: Sequence[Coefficient], *, cfa: str, f_number: float
) -> NDArray[np.float32]:
    """Compute 1 / V of every pixel, each with its own channel's curve.

    The signal above dark is multiplied by it.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of one version.
    cfa : str
        Pattern at the frame's corner; "grey" for one channel, "rgb" for a rendered
        image.
    f_number : float
        F-number.

    Returns
    -------
    ndarray of float32
        Gains, (row, col), or (row, col, 3) for "rgb".

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated` for another channel, or outside the range.
    """
    height, width = coefficients[0].height_px, coefficients[0].width_px
    lens = Lens(coefficients=tuple(coefficients), f_number=f_number)
    if cfa == "rgb":
        gains = np.empty((height, width, len(_COLOURS)), np.float32)
        for plane, channel in enumerate(_COLOURS):
            _fill(gains[..., plane], lens, channel, row0=0, col0=0, step=1)
        return gains
    gains = np.empty((height, width), np.float32)
    if cfa == GREY:
        _fill(gains, lens, coefficients[0].channel, row0=0, col0=0, step=1)
        return gains
    for index in range(4):
        row0, col0 = divmod(index, 2)
        _fill(gains[row0::2, col0::2], lens, name_site(cfa, index), row0=row0, col0=col0, step=2)
    return gains


def _fill(gains: NDArray[np.float32], lens: Lens, channel: str, *, row0: int, col0: int, step: int) -> None:
    """Write one channel's gains at its own pixels, a band of rows at a time."""
    cols = np.arange(gains.shape[1]) * step + col0
    for top in range(0, gains.shape[0], BAND_ROWS):
        band = gains[top : top + BAND_ROWS]
        rows = (top + np.arange(band.shape[0])) * step + row0
        np.divide(1.0, lens.compute_plane(rows, cols, channel=channel), out=band)
