"""Points of a luminance fit: the frames that count, those left out with the reason, and what is missing."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

from radiometry.fitting.evidence import Exclusion, Quantity
from radiometry.frame.exposure import Settings, compute_rhs
from radiometry.frame.keeping import Keeping
from radiometry.frame.statistics import ChannelStatistics, Signal, select_rows
from radiometry.luminance.conditions import Colour, measure_colour
from radiometry.luminance.dark import Dark, estimate_dark
from radiometry.luminance.lamp import Change, follow_lamp
from radiometry.luminance.results import SceneSummary
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.luminance.scenes import summarise_scenes

MOST_SATURATED_SHARE = 0.001
DETECTION_ERRORS = 3.0
FEWEST_SCENES = 3
FEW_POINTS = 6
_BASE_ISO = 100.0


@dataclass(frozen=True, kw_only=True)
class Candidate(Keeping):
    """A light frame with all that its point needs.

    Attributes
    ----------
    frame : str
        Name of the frame.
    scene : str
        Name of the scene.
    settings : Settings
        Exposure settings on the basis of the fit.
    signal : Signal
        Signal of its region.
    luminance_cd_m2 : float or None
        Meter reading of its scene at the time of the frame [cd/m2]; None if there is
        none.
    readings : int
        Number of meter readings of the scene.
    dark : Dark
        Dark signal at its exposure time.
    lamp : Change
        Change of the lamp from the readings to the frame.
    rhs : float or None
        Right-hand side X; None without a reading.
    left_out : str
        "" if it counts, else the reason.
    lens_share : Quantity or None, default: None
        Relative illumination V of its region, if vignetting is corrected.
    statistics : tuple of ChannelStatistics, default: ()
        Rows of its region.
    """

    frame: str
    scene: str
    settings: Settings
    signal: Signal
    luminance_cd_m2: float | None
    readings: int
    dark: Dark
    lamp: Change
    rhs: float | None
    left_out: str
    lens_share: Quantity | None = None
    statistics: tuple[ChannelStatistics, ...] = ()

    @cached_property
    def order(self) -> tuple[str, float, float, str]:
        """Place among the candidates of its ISO value."""
        return self.scene, self.settings.f_number, self.settings.exposure_time_s, self.frame

    def select_rows(self, channel: str) -> list[ChannelStatistics]:
        """Return the statistics of which the signal of a channel is made.

        Parameters
        ----------
        channel : str
            Channel of the fit.
        """
        return self.keep("rows", channel, lambda: select_rows(self.statistics, channel=channel))

    @property
    def colour(self) -> Colour | None:
        """R/G and B/G of its region; None without colours."""
        dark_above_black_dn = self.dark.signal_dn - self.signal.black_level_dn
        return measure_colour(self.statistics, dark_above_black_dn=dark_above_black_dn)

    @property
    def above_dark_dn(self) -> float:
        """Signal above dark [DN]."""
        return self.signal.value_dn - self.dark.signal_dn

    @property
    def span_dn(self) -> float:
        """Signal above dark at the white level [DN]."""
        return self.signal.white_level_dn - self.dark.signal_dn

    @property
    def adjusted_dn(self) -> float:
        """Signal above dark, divided by V if vignetting is corrected [DN]."""
        return self.above_dark_dn / (self.lens_share.value if self.lens_share else 1.0)


@dataclass(frozen=True, kw_only=True)
class IsoSeries(Keeping):
    """Light frames of one ISO value in canonical order, and their dark signal.

    Attributes
    ----------
    iso : float
        ISO value.
    dark : Dark
        Dark signal.
    dark_times_s : tuple of float
        Exposure times of the dark frames [s].
    candidates : tuple of Candidate
        Light frames.
    """

    iso: float
    dark: Dark
    dark_times_s: tuple[float, ...]
    candidates: tuple[Candidate, ...]

    @cached_property
    def used(self) -> tuple[Candidate, ...]:
        """The candidates that count."""
        return tuple(candidate for candidate in self.candidates if not candidate.left_out)


def collect_series(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> tuple[IsoSeries, ...]:
    """Group the frames into one series per ISO value.

    Returns
    -------
    tuple of IsoSeries
        Series by rising ISO value; an ISO value of which every light frame is
        excluded has none.

    Notes
    -----
    Frames are in the order scene, f-number, time, name: the order of the input
    changes nothing.
    """
    # gaps, suggestions and verdicts of one review ask for the same series; the rows are kept too, so that no
    # other rows get their ids
    given = tuple(readings), tuple(map(id, rows))
    return params.keep("series", given, lambda: (tuple(rows), _collect(rows, readings, params)))[1]


def _collect(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> tuple[IsoSeries, ...]:
    scenes = {s.scene: s for s in summarise_scenes(readings, panel_rho=params.panel_rho)}
    excluded = {exclusion.frame: exclusion for exclusion in reversed(params.exclude)}
    lamp = follow_lamp(rows, readings, params)
    series = []
    measured = [row for row in rows if row.statistics]
    for iso in sorted(
        {row.exposure.iso for row in measured if row.role == "light" and row.frame not in excluded}
    ):
        light = [row for row in measured if row.exposure.iso == iso and row.role == "light" and row.scene]
        black = [row for row in measured if row.exposure.iso == iso and row.role == "dark"]
        black = [row for row in black if row.frame not in excluded]
        if light:
            series.append(_one_iso(iso, light, black, scenes, lamp, excluded, params))
    return tuple(series)


def _one_iso(
    iso: float,
    light: list[FrameRow],
    black: list[FrameRow],
    scenes: dict[str, SceneSummary],
    lamp: dict[str, Change],
    excluded: dict[str, Exclusion],
    params: Params,
) -> IsoSeries:
    signals = {row.frame: row.measure(params.channel) for row in light + black}
    lit = [signals[row.frame] for row in light]
    basis = params.exposure_basis
    times = [row.settings_on(basis).exposure_time_s for row in black]
    span_dn = max(min(each.white_level_dn - each.black_level_dn for each in lit), 1.0)
    dark = estimate_dark(
        [signals[row.frame] for row in black],
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
            params.channel,
        )
        for row in light
    ]
    found.sort(key=lambda candidate: candidate.order)
    return IsoSeries(iso=iso, dark=dark, dark_times_s=tuple(sorted(times)), candidates=tuple(found))


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
    """Return True if too many samples are saturated for the mean to count.

    Parameters
    ----------
    signal : Signal
        Signal of a region.

    Returns
    -------
    bool
        True if more than 0.1 % of the samples are saturated.
    """
    return signal.saturated_share > MOST_SATURATED_SHARE


def signal_error_dn(signal: Signal, dark: Dark) -> float:
    """Compute the standard error of a signal above dark.

    Returns
    -------
    float
        Standard error [DN].
    """
    return math.hypot(signal.standard_uncertainty_dn, dark.standard_uncertainty_dn)


def is_below_detection(signal: Signal, dark: Dark) -> bool:
    """Return True if a signal cannot be distinguished from dark.

    Returns
    -------
    bool
        True if it is less than three standard errors above dark.
    """
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
