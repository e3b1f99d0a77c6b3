"""Residuals of a falloff fitted to a flat: rings are due to the lens, slopes and patches to the light."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.frame.packing import unpack
from radiometry.vignetting.results import ChannelFit


def read_residuals(
    fits: Sequence[ChannelFit], *, f_number: float, channel: str
) -> tuple[ChannelFit, NDArray[np.float32]]:
    """Return (light - fitted) / fitted of one f-number and channel, and the fit to which it belongs.

    Returns
    -------
    tuple of (ChannelFit, ndarray of float32)
        Fit, and residuals (row, col) of blocks of `block_px` x `block_px` pixels; NaN
        where a block did not count: clipped, in a spot, or outside the regions.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated` where no flat was fitted: residuals are not
        interpolated.
    """
    fit = find_fit(fits, f_number=f_number, channel=channel)
    return fit, unpack(fit.residuals).astype(np.float32)


def find_fit(fits: Sequence[ChannelFit], *, f_number: float, channel: str) -> ChannelFit:
    """Return the fit of one f-number and channel.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated` where no flat was fitted.
    """
    for fit in fits:
        if (fit.coefficient.f_number, fit.coefficient.channel) == (f_number, channel):
            return fit
    known = ", ".join(f"f/{each.coefficient.f_number:g} {each.coefficient.channel}" for each in fits)
    raise InputRejected(
        shared.VIGNETTING_NOT_CALIBRATED,
        f"No flat was fitted at f/{f_number:g}, channel {channel}; there are {known}. Ask for one of these.",
    )
