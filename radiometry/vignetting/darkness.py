"""Uncertainty of the dark level under a flat, common to all of its blocks; and dark frames that saw light."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radiometry.findings import Reason
from radiometry.frame.darkness import inspect_black
from radiometry.frame.packing import unpack
from radiometry.vignetting.features import FrameRow

STATED_SHARE = 1.0 / 4096.0
"""Of the span: a black level that the file states, and nobody measured, holds to one step of 12 bits."""

WANDER_SHARE = 1e-4
"""Of the span: by so much dark levels wander between frames; taken where a single frame cannot show it."""


@dataclass(frozen=True, kw_only=True)
class DarkError:
    """Standard uncertainties of the dark level, in the unit of the light.

    Attributes
    ----------
    shared : float, default: 0.0
        Uncertainty of the subtracted level, one and the same for all flats with these
        dark frames.
    own : float, default: 0.0
        Uncertainty by which the dark level of a single frame departs from it.
    dof : float, default: inf
        Degrees of freedom of both.
    """

    shared: float = 0.0
    own: float = 0.0
    dof: float = math.inf


KNOWN = DarkError()


def estimate_dark_error(
    means_dn: Sequence[float], variances_dn2: Sequence[float], *, span_dn: float
) -> DarkError:
    """Estimate the error of a dark level from the means of its n dark frames.

    Parameters
    ----------
    means_dn : sequence of float
        Mean of a channel in each dark frame [DN].
    variances_dn2 : sequence of float
        Variance u_i^2 of each mean from pixel noise [DN^2].
    span_dn : float
        Signal from dark to white [DN].

    Returns
    -------
    DarkError
        Standard uncertainties [DN].

    Notes
    -----
    With s the standard deviation of the means::

        own^2 = max(0, s^2 - mean u_i^2),    shared^2 = (own^2 + mean u_i^2) / n

    For one frame, own is the usual variation of dark levels. Without any dark frame it is the uncertainty
    of the stated black level, to a step of 12 bits.
    """
    n = len(means_dn)
    if n == 0:
        return DarkError(shared=STATED_SHARE * span_dn)
    noise = math.fsum(variances_dn2) / n
    own = WANDER_SHARE * span_dn
    if n > 1:
        own = math.sqrt(max(0.0, float(np.var(np.array(means_dn), ddof=1)) - noise))
    return DarkError(shared=math.sqrt((own**2 + noise) / n), own=own, dof=n - 1 if n > 1 else math.inf)


def estimate_dark_drift(
    times_s: Sequence[float],
    means_dn: Sequence[float],
    variances_dn2: Sequence[float],
    *,
    apart_s: float,
    span_dn: float,
) -> float:
    """Estimate the effect of dark current on a dark level used for a flat of another exposure time [DN].

    Parameters
    ----------
    times_s : sequence of float
        Exposure time of each dark frame of the ISO value, whatever its time [s].
    means_dn : sequence of float
        Mean of a channel in each dark frame [DN].
    variances_dn2 : sequence of float
        Variance of each mean from pixel noise [DN^2].
    apart_s : float
        Time from the mean time of the subtracted dark frames to that of the flat [s].
    span_dn : float
        Signal from dark to white [DN].

    Returns
    -------
    float
        Standard uncertainty [DN]; 0 if all dark frames have one time, since nothing is
        known then.

    Notes
    -----
    A line through the means, with t the mean time::

        mean_i = m + b t_i,    u^2 = (b apart)^2 + (u_b apart)^2,    u_b^2 = s^2 / sum (t_i - t)^2

    The level is not corrected: dark current depends on the sensor's temperature, so b apart is the size of
    the error and no more. s is the scatter about the line, at least pixel noise; for two frames, through
    which every line goes, it is the usual variation of dark levels.
    """
    t, y = np.array(times_s), np.array(means_dn)
    if len(t) == 0 or float(np.ptp(t)) == 0.0:
        return 0.0
    from_mean = t - t.mean()
    spread = float(from_mean @ from_mean)
    slope = float(from_mean @ y) / spread
    noise = math.fsum(variances_dn2) / len(t)
    residual = y - y.mean() - slope * from_mean
    dof = len(t) - 2
    scatter = float(residual @ residual) / dof if dof else (WANDER_SHARE * span_dn) ** 2
    return abs(apart_s) * math.hypot(slope, math.sqrt(max(scatter, noise) / spread))


def merge_dark_errors(errors: Sequence[DarkError], shares: Sequence[float]) -> DarkError:
    """Compute the error of a weighted mean of flats: shared errors add up, own errors average.

    Parameters
    ----------
    errors : sequence of DarkError
        Errors of the flats, each relative to its flat's level.
    shares : sequence of float
        Weights of the flats, of sum 1.
    """
    pairs = list(zip(errors, shares, strict=True))
    return DarkError(
        shared=math.fsum(share * error.shared for error, share in pairs),
        own=math.hypot(*(share * error.own for error, share in pairs)),
        dof=min(error.dof for error in errors),
    )


def find_not_dark(dark: FrameRow) -> Reason | None:
    """Check whether a dark frame saw light: a channel's median lies too far above the stated black level.

    Parameters
    ----------
    dark : FrameRow
        Evidence of the dark frame.

    Returns
    -------
    Reason or None
        `dark_not_dark`: fail, or warn where it may be the sensor's own dark current;
        None if the frame is dark.
    """
    found = []
    for channel in dark.features.channels if dark.features else ():
        mean, n = unpack(channel.mean_dn), unpack(channel.n)
        if (n > 0).any():
            reason = inspect_black(
                float(np.median(mean[n > 0])),
                black_level_dn=channel.black_level_dn,
                white_level_dn=channel.white_level_dn,
            )
            found += [reason] if reason else []
    # "fail" comes before "warn"
    return min(found, key=lambda reason: reason.outcome, default=None)
