"""The points of a luminance fit: which frames count, which are left out and why, what is still missing."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import Quantity
from radiometry.frame.exposure import Settings, compute_rhs
from radiometry.frame.statistics import Signal, measure_signal
from radiometry.luminance.dark import Dark, estimate_dark
from radiometry.luminance.results import SceneSummary
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.luminance.scenes import summarise_scenes

MOST_SATURATED_SHARE = 0.001
DETECTION_ERRORS = 3.0
FEWEST_SCENES = 3
FEW_POINTS = 6

_MOST_NAMES = 3


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A light frame with all that its point needs; ``left_out`` is "" when it counts."""

    frame: str
    scene: str
    settings: Settings
    signal: Signal
    luminance_cd_m2: float | None
    readings: int
    rhs: float | None
    left_out: str
    lens_share: Quantity | None = None

    def adjust_dn(self, dark_dn: float) -> float:
        """Give the signal above dark, and over V where vignetting is corrected [DN]."""
        return (self.signal.value_dn - dark_dn) / (self.lens_share.value if self.lens_share else 1.0)


@dataclass(frozen=True, kw_only=True)
class IsoSeries:
    """The light frames of one ISO value in canonical order, and their dark signal."""

    iso: float
    dark: Dark
    dark_times_s: tuple[float, ...]
    candidates: tuple[Candidate, ...]

    @property
    def used(self) -> tuple[Candidate, ...]:
        """The candidates that count."""
        return tuple(candidate for candidate in self.candidates if not candidate.left_out)


def collect_series(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> tuple[IsoSeries, ...]:
    """Sort the frames into one series per ISO value; an ISO of which every light frame is excluded has none.

    Frames come in the order scene, f-number, time, name: the order of the input changes nothing.
    """
    scenes = {s.scene: s for s in summarise_scenes(readings, panel_rho=params.panel_rho)}
    excluded = {exclusion.frame: exclusion for exclusion in params.exclude}
    series = []
    measured = [row for row in rows if row.statistics]
    for iso in sorted(
        {row.exposure.iso for row in measured if row.role == "light" and row.frame not in excluded}
    ):
        light = [row for row in measured if row.exposure.iso == iso and row.role == "light" and row.scene]
        black = [row for row in measured if row.exposure.iso == iso and row.role == "dark"]
        black = [row for row in black if row.frame not in excluded]
        if light:
            series.append(_one_iso(iso, light, black, scenes, params))
    return tuple(series)


def _one_iso(
    iso: float,
    light: list[FrameRow],
    black: list[FrameRow],
    scenes: dict[str, SceneSummary],
    params: Params,
) -> IsoSeries:
    signals = {
        row.frame: measure_signal(row.statistics or (), channel=params.channel) for row in light + black
    }
    dark = estimate_dark([signals[row.frame] for row in black], [signals[row.frame] for row in light])
    found = [_candidate(row, signals[row.frame], dark, scenes.get(row.scene or ""), params) for row in light]
    found.sort(key=lambda c: (c.scene, c.settings.f_number, c.settings.exposure_time_s, c.frame))
    times = sorted(row.exposure.on_basis(params.exposure_basis).exposure_time_s for row in black)
    return IsoSeries(iso=iso, dark=dark, dark_times_s=tuple(times), candidates=tuple(found))


def _candidate(
    row: FrameRow, signal: Signal, dark: Dark, scene: SceneSummary | None, params: Params
) -> Candidate:
    settings = row.exposure.on_basis(params.exposure_basis)
    luminance = scene.luminance_cd_m2 if scene else None
    return Candidate(
        frame=row.frame,
        scene=row.scene or "",
        settings=settings,
        signal=signal,
        luminance_cd_m2=luminance,
        readings=scene.readings if scene else 0,
        rhs=compute_rhs(settings, luminance_cd_m2=luminance) if luminance is not None else None,
        left_out=_why_left_out(row, signal, dark, scene, params),
        lens_share=row.lens_share,
    )


def is_saturated(signal: Signal) -> bool:
    """Say whether too many samples are saturated for the mean to count."""
    return signal.saturated_share > MOST_SATURATED_SHARE


def signal_error_dn(signal: Signal, dark: Dark) -> float:
    """Give the standard error of a signal above dark [DN]."""
    return math.hypot(signal.standard_uncertainty_dn, dark.standard_uncertainty_dn)


def is_below_detection(signal: Signal, dark: Dark) -> bool:
    """Say whether a signal cannot be told from dark."""
    return signal.value_dn - dark.signal_dn < DETECTION_ERRORS * signal_error_dn(signal, dark)


def _why_left_out(
    row: FrameRow, signal: Signal, dark: Dark, scene: SceneSummary | None, params: Params
) -> str:
    for exclusion in params.exclude:
        if exclusion.frame == row.frame:
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


def list_missing(
    rows: Sequence[FrameRow],
    readings: Sequence[Reading],
    params: Params,
    *,
    unread: Sequence[str] = (),
) -> list[str]:
    """Say by name what keeps a fit from starting, in fragments that can be joined by "; ".

    ``unread`` : names of frames of which nothing is known yet
    """
    excluded = {exclusion.frame for exclusion in params.exclude}
    found = [
        f"frame {name} is to be left out, but the campaign has no such frame"
        for name in sorted(excluded - {row.frame for row in rows} - set(unread))
    ]
    wanted = [row for row in rows if row.frame not in excluded]
    waiting = sorted({*unread} - excluded)
    if waiting:
        found.append(f"{_name_frames(waiting, 'has', 'have')} not been read yet")
    found += _list_unmeasured(wanted)
    light = [row for row in wanted if row.role == "light"]
    sceneless = sorted(row.frame for row in light if not row.scene)
    if sceneless:
        found.append(f"{_name_frames(sceneless, 'has', 'have')} no scene: say which light level it is")
    if not light and not waiting:
        return [*found, "the campaign has no light frame"]
    for series in collect_series(rows, readings, params):
        usable = {candidate.scene for candidate in series.used}
        if len(usable) < FEWEST_SCENES:
            found.append(
                f"ISO {series.iso:g} has {len(usable)} usable scenes, a fit needs {FEWEST_SCENES}: "
                f"{_reasons(series)}"
            )
    return found


def require_shares(rows: Sequence[FrameRow], params: Params) -> None:
    """Refuse a fit in which some signals would be divided by V and others not.

    Raises InputRejected(vignetting_not_calibrated)
    """
    excluded = {exclusion.frame for exclusion in params.exclude}
    light = [row for row in rows if row.role == "light" and row.statistics and row.frame not in excluded]
    lacking = [row.frame for row in light if row.lens_share is None]
    if params.vignetting is not None and lacking:
        raise InputRejected(
            shared.VIGNETTING_NOT_CALIBRATED,
            f"The fit corrects vignetting, and {_name_frames(sorted(lacking), 'has', 'have')} no V of its "
            "region: give it the vignetting version.",
        )


def list_unread_scenes(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> list[str]:
    """Say which scenes have light frames but no luminance reading: a fit can start, but leaves them out."""
    excluded = {exclusion.frame for exclusion in params.exclude}
    read = {reading.scene for reading in readings if reading.quantity == "luminance"}
    shown = {row.scene for row in rows if row.role == "light" and row.scene and row.frame not in excluded}
    return [f"scene {scene} has no luminance reading" for scene in sorted(shown - read)]


def _list_unmeasured(rows: Sequence[FrameRow]) -> list[str]:
    """Say which frames have no statistics, and whether they lack a region or only wait for a worker."""
    regionless = sorted(row.frame for row in rows if not row.statistics and not row.has_region)
    waiting = sorted(row.frame for row in rows if not row.statistics and row.has_region)
    found = []
    if regionless and len(regionless) == len(rows):
        found.append("the campaign has no region (ROI)")
    elif regionless:
        found.append(f"{_name_frames(regionless, 'has', 'have')} no region (ROI)")
    if waiting:
        found.append(f"{_name_frames(waiting, 'has', 'have')} no statistics yet")
    return found


def _name_frames(names: Sequence[str], one: str, several: str) -> str:
    """Name the first few frames and count the rest, up to the verb."""
    if len(names) == 1:
        return f"frame {names[0]} {one}"
    if len(names) <= _MOST_NAMES:
        return f"frames {', '.join(names[:-1])} and {names[-1]} {several}"
    first = ", ".join(names[:_MOST_NAMES])
    return f"frames {first} and {len(names) - _MOST_NAMES} more {several}"


def _reasons(series: IsoSeries) -> str:
    """Say what happened to the frames of the scenes that do not count."""
    usable = {candidate.scene for candidate in series.used}
    lost = {c.scene: c.left_out for c in series.candidates if c.scene not in usable}
    if not lost:
        return "photograph more light levels"
    return ", ".join(
        f"scene {scene}: a frame was left out because {why}" for scene, why in sorted(lost.items())
    )
