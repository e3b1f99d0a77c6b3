"""The dark signal of one ISO value."""

import math
import statistics as python_statistics
from collections.abc import Sequence
from dataclasses import dataclass

from radiometry.findings import Raised, shared
from radiometry.frame.statistics import Signal
from radiometry.luminance import codes

EXPOSURE_RATIO = 2.0
FEW_DARK_FRAMES = 3
_VARIATION_REL = 0.01
_TWELVE_BIT_STEPS = 4096.0


@dataclass(frozen=True, kw_only=True)
class Dark:
    """Dark signal of one ISO value.

    Attributes
    ----------
    signal_dn, standard_uncertainty_dn : float
        Dark signal and its standard uncertainty [DN].
    frame_spread_dn : float
        Standard deviation of single frames about it beyond their noise [DN]: a
        light frame's own dark signal differs from the median by as much.
    dof : float
        Degrees of freedom of the standard uncertainty.
    """

    signal_dn: float
    standard_uncertainty_dn: float
    frame_spread_dn: float
    dof: float


def estimate_dark(dark: Sequence[Signal], light: Sequence[Signal]) -> Dark:
    """Estimate the dark signal of one ISO value: the median over its dark frames.

    Parameters
    ----------
    dark : sequence of Signal
        Signals of the dark frames.
    light : sequence of Signal
        Signals of the light frames.

    Returns
    -------
    Dark
        Dark signal with its standard uncertainty.

    Notes
    -----
    With s the standard deviation of the n frames [1]_::

        u(D)^2 = c max(s^2, mean u_i^2) / n

    c = pi / 2 for a median, and c = 1 for one or two frames, where it is the mean.
    Without a dark frame it is the black level that the light frames state, to
    within one step of 12 bits of their range, since it was not measured.

    References
    ----------
    .. [1] Standard operating procedure "Drone Camera Calibration", section E
    """
    if not dark:
        black = python_statistics.median(sorted(signal.black_level_dn for signal in light))
        span = min(signal.white_level_dn for signal in light) - black
        return Dark(
            signal_dn=black,
            standard_uncertainty_dn=max(span, 1.0) / _TWELVE_BIT_STEPS,
            frame_spread_dn=0.0,
            dof=math.inf,
        )
    values = sorted(signal.value_dn for signal in dark)
    n = len(values)
    within = math.fsum(sorted(signal.standard_uncertainty_dn**2 for signal in dark)) / n
    between = python_statistics.variance(values) if n > 1 else 0.0
    efficiency = math.pi / 2 if n >= FEW_DARK_FRAMES else 1.0
    return Dark(
        signal_dn=python_statistics.median(values),
        standard_uncertainty_dn=math.sqrt(efficiency * max(between, within) / n),
        frame_spread_dn=math.sqrt(max(0.0, between - within)),
        dof=float(n - 1) if n > 1 else math.inf,
    )


def check_dark(
    dark: Dark,
    *,
    iso: float,
    light_times_s: Sequence[float],
    dark_times_s: Sequence[float],
    weakest_signal_dn: float,
) -> list[Raised]:
    """Check the dark frames of an ISO value.

    Parameters
    ----------
    dark : Dark
        Dark signal of the ISO value.
    iso : float
        ISO value.
    light_times_s, dark_times_s : sequence of float
        Exposure times of the light and of the dark frames [s].
    weakest_signal_dn : float
        Weakest signal above dark of the light frames [DN].

    Returns
    -------
    list of Raised
        Flags `dark_from_black_level`, `dark_from_few_frames`, `dark_varies`,
        `dark_exposure_differs`.
    """
    where = f"iso {iso:g}"
    if not dark_times_s:
        detail = "No dark frame: the black level that the files state was subtracted."
        return [shared.DARK_FROM_BLACK_LEVEL.at(where, detail)]
    raised: list[Raised] = []
    if len(dark_times_s) < FEW_DARK_FRAMES:
        detail = f"Dark frames: {len(dark_times_s)}."
        raised.append(codes.DARK_FROM_FEW_FRAMES.at(where, detail))
    if dark.frame_spread_dn > _VARIATION_REL * weakest_signal_dn:
        detail = f"Spread {dark.frame_spread_dn:.3g} DN, weakest signal {weakest_signal_dn:.4g} DN."
        raised.append(codes.DARK_VARIES.at(where, detail))
    far = [time for time in sorted(set(light_times_s)) if time_ratio(time, dark_times_s) > EXPOSURE_RATIO]
    if far:
        times = ", ".join(f"{time:g} s" for time in far)
        detail = f"No dark frame within a factor of {EXPOSURE_RATIO:g} of the exposure time {times}."
        raised.append(shared.DARK_EXPOSURE_DIFFERS.at(where, detail))
    return raised


def time_ratio(time_s: float, others_s: Sequence[float]) -> float:
    """Compute the ratio to the nearest other time, free of rounding in the last digit.

    Parameters
    ----------
    time_s : float
        Exposure time [s].
    others_s : sequence of float
        Other exposure times, at least one [s].

    Returns
    -------
    float
        Ratio, at least 1.
    """
    return round(min(max(time_s / other, other / time_s) for other in others_s), 9)
