"""The dark signal of one ISO value against exposure time."""

import bisect
import itertools
import math
import statistics as python_statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace

from radiometry.findings import Raised, shared
from radiometry.frame.statistics import Signal
from radiometry.luminance import codes

EXPOSURE_RATIO = 2.0
FEW_DARK_FRAMES = 3
_VARIATION_REL = 0.01
_SAME_TIME_REL = 0.02
_TWELVE_BIT_STEPS = 4096.0


@dataclass(frozen=True, kw_only=True)
class Dark:
    """Dark signal of one ISO value, D(t) = D + I (t - t_0).

    Attributes
    ----------
    signal_dn, standard_uncertainty_dn : float
        Dark signal D at `time_s` and its standard uncertainty [DN].
    frame_spread_dn : float
        Standard deviation of single frames about the line beyond their noise [DN]:
        a light frame's own dark signal differs from it by as much.
    dof : float
        Degrees of freedom of the standard uncertainties.
    time_s : float, default: 0.0
        Exposure time t_0 at which the errors of D and I are independent [s].
    rate_dn_per_s, rate_u_dn_per_s : float, default: 0.0
        Rate I of the dark current and its standard uncertainty [DN/s].
    rate_measured : bool, default: False
        False if no dark frames of different times determine I: it is then 0, within
        its plausible size.
    """

    signal_dn: float
    standard_uncertainty_dn: float
    frame_spread_dn: float
    dof: float
    time_s: float = 0.0
    rate_dn_per_s: float = 0.0
    rate_u_dn_per_s: float = 0.0
    rate_measured: bool = False

    def at(self, time_s: float) -> "Dark":
        """Return the dark signal at an exposure time, with its standard uncertainty there.

        Parameters
        ----------
        time_s : float
            Exposure time [s].

        Returns
        -------
        Dark
            The same line, with `time_s`, `signal_dn` and `standard_uncertainty_dn`
            of that time. The last contains that of a measured rate, not the
            plausible size of one that was not: whether a signal is seen above dark
            does not depend on what was assumed.
        """
        apart_s = time_s - self.time_s
        rate_u = self.rate_u_dn_per_s if self.rate_measured else 0.0
        return replace(
            self,
            time_s=time_s,
            signal_dn=self.signal_dn + apart_s * self.rate_dn_per_s,
            standard_uncertainty_dn=math.hypot(self.standard_uncertainty_dn, apart_s * rate_u),
        )


def estimate_dark(
    dark: Sequence[Signal],
    light: Sequence[Signal],
    *,
    times_s: Sequence[float] = (),
    plausible_rate_dn_per_s: float = 0.0,
) -> Dark:
    """Estimate the dark signal of one ISO value from its dark frames.

    Parameters
    ----------
    dark : sequence of Signal
        Signals of the dark frames.
    light : sequence of Signal
        Signals of the light frames.
    times_s : sequence of float, default: ()
        Exposure time of each dark frame [s]; all alike if empty.
    plausible_rate_dn_per_s : float, default: 0.0
        Standard uncertainty of the rate I where the frames do not determine it
        better [DN/s].

    Returns
    -------
    Dark
        Dark signal against time with its standard uncertainties.

    Notes
    -----
    The line goes through the medians of the frames of each time: I is the median of
    their slopes, weighted with the frames and the time apart [1]_, and D the median
    of D_i - I (t_i - t_0) at the mean time t_0. Of a single time it is the median of
    the procedure [2]_, and I is 0 within `plausible_rate_dn_per_s`. With s the
    standard deviation of the n frames about it::

        u(D)^2 = c max(s^2, mean u_i^2) / n,   u(I)^2 = n u(D)^2 / sum (t_i - t_0)^2

    c = pi / 2 for a median, and c = 1 for one or two frames, where it is the mean.
    Without a dark frame it is the black level that the light frames state, to
    within one step of 12 bits of their range, since it was not measured.

    References
    ----------
    .. [1] P. K. Sen, J. Am. Stat. Assoc. 63, 1379 (1968),
           doi:10.1080/01621459.1968.10480934
    .. [2] Standard operating procedure "Drone Camera Calibration", section E
    """
    if not dark:
        black = python_statistics.median(sorted(signal.black_level_dn for signal in light))
        span = min(signal.white_level_dn for signal in light) - black
        return Dark(
            signal_dn=black,
            standard_uncertainty_dn=max(span, 1.0) / _TWELVE_BIT_STEPS,
            frame_spread_dn=0.0,
            dof=math.inf,
            rate_u_dn_per_s=plausible_rate_dn_per_s,
        )
    # in one order, so that sums do not depend on that of the frames
    frames = sorted(
        (time_s, signal.value_dn, signal.standard_uncertainty_dn)
        for time_s, signal in zip(times_s or [0.0] * len(dark), dark, strict=True)
    )
    if frames[-1][0] > (1.0 + _SAME_TIME_REL) * frames[0][0]:
        line = _fit_line(frames, rate_dn_per_s=_estimate_rate(frames))
        if not plausible_rate_dn_per_s or line.rate_u_dn_per_s < plausible_rate_dn_per_s:
            return line
    level = _fit_line(frames, rate_dn_per_s=None)
    return replace(level, rate_u_dn_per_s=plausible_rate_dn_per_s)


def _estimate_rate(frames: Sequence[tuple[float, float, float]]) -> float:
    """Return the weighted median of the slopes between the medians of the times [DN/s]."""
    levels: list[tuple[float, float, int]] = []
    for time_s, group in itertools.groupby(frames, key=lambda frame: frame[0]):
        values = [value for _, value, _ in group]
        levels.append((time_s, python_statistics.median(values), len(values)))
    slopes = sorted(
        ((high - low) / (later - sooner), many * few * (later - sooner))
        for (sooner, low, many), (later, high, few) in itertools.combinations(levels, 2)
    )
    reached = list(itertools.accumulate(weight for _, weight in slopes))
    return slopes[bisect.bisect_left(reached, reached[-1] / 2.0)][0]


def _fit_line(frames: Sequence[tuple[float, float, float]], *, rate_dn_per_s: float | None) -> Dark:
    """Return the line of a rate, or the level without one, with the scatter of the frames about it."""
    n = len(frames)
    centre_s = math.fsum(time_s for time_s, _, _ in frames) / n
    rate = rate_dn_per_s or 0.0
    levels = sorted(value - rate * (time_s - centre_s) for time_s, value, _ in frames)
    dof = n - 1 - (rate_dn_per_s is not None)
    within = math.fsum(sorted(u_dn**2 for _, _, u_dn in frames)) / n
    between = python_statistics.variance(levels) * (n - 1) / dof if dof > 0 else 0.0
    efficiency = math.pi / 2 if n >= FEW_DARK_FRAMES else 1.0
    variance = efficiency * max(between, within)
    lever_s2 = math.fsum((time_s - centre_s) ** 2 for time_s, _, _ in frames)
    return Dark(
        signal_dn=python_statistics.median(levels),
        standard_uncertainty_dn=math.sqrt(variance / n),
        frame_spread_dn=math.sqrt(max(0.0, between - within)),
        dof=float(dof) if dof > 0 else math.inf,
        time_s=centre_s,
        rate_dn_per_s=rate,
        rate_u_dn_per_s=0.0 if rate_dn_per_s is None else math.sqrt(variance / lever_s2),
        rate_measured=rate_dn_per_s is not None,
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
    # between dark frames of two times the line is measured
    span = (min(dark_times_s), max(dark_times_s)) if dark.rate_measured else (math.inf, -math.inf)
    far = [
        time
        for time in sorted(set(light_times_s))
        if not span[0] <= time <= span[1] and time_ratio(time, dark_times_s) > EXPOSURE_RATIO
    ]
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
