"""Points of a luminance fit: dark signal, the frames that count, and why others are left out."""

import bisect
import itertools
import math
import statistics as python_statistics
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, cached_property

from radiometry.drawing.text import write_exposure
from radiometry.findings import Raised, shared
from radiometry.fitting.evidence import Exclusion, Quantity
from radiometry.frame.exposure import Settings, compute_rhs
from radiometry.frame.statistics import ChannelStatistics, Signal, select_rows
from radiometry.frame.verdicts import Keeping
from radiometry.luminance import codes
from radiometry.luminance.results import SceneSummary
from radiometry.luminance.rows import Colour, FrameRow, Params, Reading, measure_colour
from radiometry.luminance.scenes import Change, follow_lamp, summarise_scenes
from radiometry.records import Record

EXPOSURE_RATIO = 2.0
FEW_DARK_FRAMES = 3
_VARIATION_REL = 0.01
_SAME_TIME_REL = 0.02
_TWELVE_BIT_STEPS = 4096.0
MOST_SATURATED_SHARE = 0.001
DETECTION_ERRORS = 3.0
FEWEST_SCENES = 3
FEW_POINTS = 6
_BASE_ISO = 100.0


class Dark(Record):
    """Dark signal of one ISO value, D(t) = D + I (t - t_0)."""

    signal_dn: float  # D at `time_s`
    standard_uncertainty_dn: float
    # standard deviation of single frames about the line beyond their noise: a light frame's own dark signal
    # differs from it by as much
    frame_spread_dn: float
    dof: float  # of the standard uncertainties
    time_s: float = 0.0  # exposure time t_0 at which the errors of D and I are independent
    rate_dn_per_s: float = 0.0  # rate I of the dark current
    rate_u_dn_per_s: float = 0.0
    rate_measured: bool = (
        False  # if no frames of different times determine I, it is 0 within a plausible size
    )

    def at(self, time_s: float) -> "Dark":
        """Return the dark signal at a time; the plausible size of an unmeasured rate is no part of its u."""
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

    The line goes through the medians of the frames of each time: I is the median of their slopes, weighted
    with the frames and the time apart [1], and D the median of D_i - I (t_i - t_0) at the mean time t_0. Of a
    single time it is the median of the procedure [2], and I is 0 within `plausible_rate_dn_per_s`. With s the
    standard deviation of the n frames about it::

        u(D)^2 = c max(s^2, mean u_i^2) / n,   u(I)^2 = n u(D)^2 / sum (t_i - t_0)^2

    c = pi / 2 for a median, and c = 1 for one or two frames, where it is the mean. Without a dark frame it is
    the black level that the light frames state, to within one step of 12 bits of their range, since it was
    not measured.

    [1] P. K. Sen, J. Am. Stat. Assoc. 63, 1379 (1968), doi:10.1080/01621459.1968.10480934
    [2] Standard operating procedure "Drone Camera Calibration", section E
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


def time_ratio(time_s: float, others_s: Sequence[float]) -> float:
    """Compute the ratio to the nearest other time, free of rounding in the last digit."""
    return round(min(max(time_s / other, other / time_s) for other in others_s), 9)


class Candidate(Record, Keeping):
    """A light frame with all that its point needs."""

    frame: str
    scene: str
    settings: Settings  # on the basis of the fit
    signal: Signal
    luminance_cd_m2: float | None  # meter reading of its scene at the time of the frame
    readings: int  # of the scene
    dark: Dark  # at its exposure time
    lamp: Change
    rhs: float | None  # right-hand side X; None without a reading
    left_out: str  # "" if it counts, else the reason
    lens_share: Quantity | None = None  # V of its region, if vignetting is corrected
    statistics: tuple[ChannelStatistics, ...] = ()

    @cached_property
    def order(self) -> tuple[str, float, float, str]:
        return self.scene, self.settings.f_number, self.settings.exposure_time_s, self.frame

    def select_rows(self, channel: str) -> list[ChannelStatistics]:
        return self.keep("rows", channel, lambda: select_rows(self.statistics, channel=channel))

    @property
    def colour(self) -> Colour | None:
        """R/G and B/G of its region; None without colours."""
        dark_above_black_dn = self.dark.signal_dn - self.signal.black_level_dn
        return measure_colour(self.statistics, dark_above_black_dn=dark_above_black_dn)

    @property
    def above_dark_dn(self) -> float:
        return self.signal.value_dn - self.dark.signal_dn

    @property
    def span_dn(self) -> float:
        """Signal above dark at the white level [DN]."""
        return self.signal.white_level_dn - self.dark.signal_dn

    @property
    def adjusted_dn(self) -> float:
        """Signal above dark, divided by V if vignetting is corrected [DN]."""
        return self.above_dark_dn / (self.lens_share.value if self.lens_share else 1.0)


class IsoSeries(Record, Keeping):
    """Light frames of one ISO value in canonical order, and their dark signal."""

    iso: float
    dark: Dark
    dark_times_s: tuple[float, ...]
    candidates: tuple[Candidate, ...]

    @cached_property
    def used(self) -> tuple[Candidate, ...]:
        return tuple(candidate for candidate in self.candidates if not candidate.left_out)


def check_dark(series: IsoSeries) -> list[Raised]:
    """Check the dark frames of an ISO value against its light frames."""
    where, dark, dark_times_s = f"iso {series.iso:g}", series.dark, series.dark_times_s
    if not dark_times_s:
        detail = "No dark frame: the black level that the files state was subtracted."
        return [shared.DARK_FROM_BLACK_LEVEL.at(where, detail)]
    raised: list[Raised] = []
    if len(dark_times_s) < FEW_DARK_FRAMES:
        raised.append(codes.DARK_FROM_FEW_FRAMES.at(where, f"Dark frames: {len(dark_times_s)}."))
    weakest_signal_dn = min(c.above_dark_dn for c in series.used)
    if dark.frame_spread_dn > _VARIATION_REL * weakest_signal_dn:
        detail = f"Spread {dark.frame_spread_dn:.3g} DN, weakest signal {weakest_signal_dn:.4g} DN."
        raised.append(codes.DARK_VARIES.at(where, detail))
    # between dark frames of two times the line is measured
    span = (min(dark_times_s), max(dark_times_s)) if dark.rate_measured else (math.inf, -math.inf)
    far = [
        time
        for time in sorted({c.settings.exposure_time_s for c in series.used})
        if not span[0] <= time <= span[1] and time_ratio(time, dark_times_s) > EXPOSURE_RATIO
    ]
    if far:
        times = [write_exposure(time) for time in far]
        said = ", ".join(times if len(times) < 4 else (times[0], "…", times[-1]))
        detail = f"No dark frame within a factor of {EXPOSURE_RATIO:g} of the exposure time {said}."
        raised.append(shared.DARK_EXPOSURE_DIFFERS.at(where, detail))
    return raised


def collect_series(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> tuple[IsoSeries, ...]:
    """Group the frames into one series per ISO value.

    Frames are in the order scene, f-number, time, name: the order of the input changes nothing.
    """
    # gaps, suggestions and verdicts of one review ask for the same series; the rows are kept too, so that no
    # other rows get their ids
    given = tuple(readings), tuple(map(id, rows))
    return params.keep("series", given, lambda: (tuple(rows), _collect(rows, readings, params)))[1]


def _collect(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> tuple[IsoSeries, ...]:
    scenes = {s.scene: s for s in summarise_scenes(readings, panel_rho=params.panel_rho)}
    excluded = {exclusion.frame: exclusion for exclusion in reversed(params.exclude)}
    lamp = follow_lamp(rows, readings, params)
    basis, channel, series = params.exposure_basis, params.channel, []
    measured = [row for row in rows if row.statistics]
    for iso in sorted(
        {row.exposure.iso for row in measured if row.role == "light" and row.frame not in excluded}
    ):
        here = [row for row in measured if row.exposure.iso == iso]
        light = [row for row in here if row.role == "light" and row.scene]
        black = [row for row in here if row.role == "dark" and row.frame not in excluded]
        if not light:
            continue
        lit = [row.measure(channel) for row in light]
        times = [row.settings_on(basis).exposure_time_s for row in black]
        span_dn = max(min(each.white_level_dn - each.black_level_dn for each in lit), 1.0)
        dark = estimate_dark(
            [row.measure(channel) for row in black],
            lit,
            times_s=times,
            plausible_rate_dn_per_s=params.dark_rate_u_rel * span_dn * iso / _BASE_ISO,
        )
        dark_at = cache(dark.at)
        found = [
            _candidate(
                row,
                settings := row.settings_on(basis),
                dark_at(settings.exposure_time_s),
                scenes.get(row.scene or ""),
                lamp[row.frame],
                excluded.get(row.frame),
                channel,
            )
            for row in light
        ]
        found.sort(key=lambda candidate: candidate.order)
        series.append(
            IsoSeries(iso=iso, dark=dark, dark_times_s=tuple(sorted(times)), candidates=tuple(found))
        )
    return tuple(series)


def _candidate(
    row: FrameRow,
    settings: Settings,
    dark: Dark,
    scene: SceneSummary | None,
    lamp: Change,
    exclusion: Exclusion | None,
    channel: str,
) -> Candidate:
    """Return the candidate of a frame, the same one as long as it is made of the same things."""

    def make() -> Candidate:
        signal = row.measure(channel)
        luminance = scene.luminance_cd_m2 * lamp.ratio if scene else None
        return Candidate(
            frame=row.frame,
            scene=row.scene or "",
            settings=settings,
            signal=signal,
            luminance_cd_m2=luminance,
            readings=scene.readings if scene else 0,
            dark=dark,
            lamp=lamp,
            rhs=compute_rhs(settings, luminance_cd_m2=luminance) if luminance is not None else None,
            left_out=_why_left_out(signal, dark, scene, exclusion),
            lens_share=row.lens_share,
            statistics=row.statistics or (),
        )

    return row.keep("candidate", (channel, settings, dark, scene, lamp, exclusion), make)


def is_saturated(signal: Signal) -> bool:
    return signal.saturated_share > MOST_SATURATED_SHARE


def signal_error_dn(signal: Signal, dark: Dark) -> float:
    return math.hypot(signal.standard_uncertainty_dn, dark.standard_uncertainty_dn)


def is_below_detection(signal: Signal, dark: Dark) -> bool:
    return signal.value_dn - dark.signal_dn < DETECTION_ERRORS * signal_error_dn(signal, dark)


def _why_left_out(signal: Signal, dark: Dark, scene: SceneSummary | None, exclusion: Exclusion | None) -> str:
    if exclusion is not None:
        return f"excluded by {exclusion.by}: {exclusion.reason}"
    if scene is None:
        return "its scene has no luminance reading"
    if is_saturated(signal):
        return (
            f"{signal.saturated_share:.2%} of its samples are saturated, more than {MOST_SATURATED_SHARE:.1%}"
        )
    if is_below_detection(signal, dark):
        return f"its signal is less than {DETECTION_ERRORS:g} standard errors above dark"
    return ""
