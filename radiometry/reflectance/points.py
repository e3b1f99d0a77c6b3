"""Points of a reflectance fit: the panel on their day, panel frames used, those left out, what is missing."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import date, datetime
from typing import Final

from radiometry.findings import Finding, InputRejected, Raised, interface, shared
from radiometry.findings.grouping import Cause, name_frames
from radiometry.fitting.evidence import list_unknown_exclusions
from radiometry.frame import has_set_clock, multispectral
from radiometry.records import Record
from radiometry.reflectance import codes, imaging, sun
from radiometry.reflectance.results import FrameRow, Params, Reading
from radiometry.reflectance.sunshine import (
    Gain,
    Light,
    Sunshine,
    compare_channels,
    find_repeated,
    measure_light,
    see_light,
)

OLD_DAYS: Final = 730.5
_FEWEST_DAYS: Final = 365.25
"""Two measurements closer than this state no rate of ageing: their difference is mostly the meter's."""

PANEL = "panel"
MOST_SATURATED_SHARE = 0.001
DETECTION_ERRORS = 3.0
# Panel frames further apart than this belong to two visits to the panel.
VISIT_GAP_S = 300.0
STEEPEST_ANGLE_DEG = 60.0
NO_REFLECTANCE = "no reflectance of the panel in this band"


class PanelValue(Record):
    """Reflectance of a panel in one band on the day of a frame."""

    panel: str  # serial number; "" if the file states an albedo without one
    reflectance: float
    standard_uncertainty: float  # as stated, and of the change between or after the measurements
    states_uncertainty: bool  # True if every measurement that was used states its own
    measured_on: tuple[str, ...] = ()  # days of the measurements that were used
    age_days: float = 0.0  # from the nearest measurement, where none lies on the day's other side
    from_file: bool = False  # True if the camera read the value from the panel's code


def list_named(row: FrameRow) -> list[str]:
    """Return the panels that a frame names, by the camera's statement and by the code in the image."""
    stated = row.header.multispectral.panel_serial if row.header.multispectral else None
    return sorted({multispectral.name_panel(each) for each in (stated, row.identified) if each})


def describe_difference(row: FrameRow, readings: Sequence[Reading]) -> str:
    """Return a sentence if a frame shows another panel than the campaign's."""
    named = list_named(row)
    if len(named) > 1:
        return f"Frame {row.frame} names panel {named[0]} and panel {named[1]}, in its tags and by its code."
    own = {multispectral.name_panel(reading.panel): reading.panel for reading in readings}
    if not named or not own or named[0] in own:
        return ""
    return f"Frame {row.frame} shows panel {named[0]}, and the campaign's panel is {', '.join(own.values())}."


def require_one_panel(rows: Iterable[FrameRow], readings: Sequence[Reading]) -> None:
    """Refuse panel frames of another panel than the campaign's, or of several."""
    shown: dict[str, str] = {}
    for row in rows:
        difference = describe_difference(row, readings)
        for serial in list_named(row):
            shown.setdefault(serial, row.frame)
        if not difference and len(shown) > 1:
            (one, first), (other, second) = list(shown.items())[:2]
            difference = f"Frame {first} shows panel {one}, frame {second} panel {other}."
        if difference:
            raise interface.PANEL_DIFFERS.refuse(difference)


def choose_readings(readings: Sequence[Reading], params: Params) -> list[Reading]:
    """Return the readings of the measurement that the parameters name, else all; a file's only if alone."""
    if params.panel_measured_on is not None:
        return [each for each in readings if each.measured_on == params.panel_measured_on]
    measured = {each.band for each in readings if not each.from_file}
    return [each for each in readings if not each.from_file or each.band not in measured]


def find_value(
    band: multispectral.Multispectral, readings: Sequence[Reading], params: Params, *, at: datetime | None
) -> PanelValue | None:
    """Return what the panel reflected in a band: by its measurements, else as the camera read its code.

    Between the measurements a and b on either side of the day, at the fraction w of the time between them,
    and after (or before) the last two::

        R = (1 - w) R_a + w R_b       u = (1 - w) u_a + w u_b       u_change = |R_b - R_a| sqrt(w (1 - w))
        R = R_b                       u = u_b                       u_change = |R_b - R_a| d / T

    T is the time between the two, at least a year, and d the time to the nearest. The first u_change is that
    of a single step at a time that is not known, the largest of any change that goes one way; the second is
    the whole of a change that goes on. With one measurement the change since is not known, and `panel_old`
    states its age.
    """
    own = [each for each in choose_readings(readings, params) if each.band == band.band]
    if not own:
        if band.panel_albedo is None or not 0.0 < band.panel_albedo <= 1.0:
            return None
        return PanelValue(
            panel=band.panel_serial or "",
            reflectance=band.panel_albedo,
            standard_uncertainty=0.0,
            states_uncertainty=False,
            from_file=True,
        )
    if own[-1].from_file:
        return replace(_combine(own[-1]), measured_on=(), from_file=True)
    own.sort(key=lambda each: each.measured_on or "")
    day = at.date() if at is not None and has_set_clock(at) else None
    before = [each for each in own if day is None or (each.measured_on or "") <= day.isoformat()]
    after = own[len(before) :]
    if day is None or not own[0].measured_on:
        return _combine(before[-1])
    if before and after:
        span = _days(before[-1], after[0])
        w = (day - _day(before[-1])).days / span
        change = abs(after[0].reflectance - before[-1].reflectance) * math.sqrt(w * (1.0 - w))
        return _combine(before[-1], after[0], w=w, change=change)
    near, far = (before[-1], before[-2:-1]) if before else (after[0], after[1:2])
    age_days = abs((day - _day(near)).days)
    change = 0.0
    for other in far:
        rate = abs(near.reflectance - other.reflectance) / max(_days(other, near), _FEWEST_DAYS)
        change = rate * age_days
    return _combine(near, change=change, age_days=age_days)


def _combine(
    a: Reading, b: Reading | None = None, *, w: float = 0.0, change: float = 0.0, age_days: float = 0.0
) -> PanelValue:
    used = [(a, 1.0 - w), *([(b, w)] if b is not None and w > 0.0 else [])]
    stated = math.fsum(share * (each.standard_uncertainty or 0.0) for each, share in used)
    return PanelValue(
        panel=a.panel,
        reflectance=math.fsum(share * each.reflectance for each, share in used),
        standard_uncertainty=math.hypot(stated, change),
        states_uncertainty=all(each.standard_uncertainty is not None for each, _ in used),
        measured_on=tuple(each.measured_on for each, _ in used if each.measured_on),
        age_days=age_days,
    )


def _day(reading: Reading) -> date:
    return date.fromisoformat(reading.measured_on or "")


def _days(one: Reading, other: Reading) -> float:
    return float(abs((_day(other) - _day(one)).days))


def list_contradictions(readings: Sequence[Reading], params: Params) -> list[str]:
    """List what the measurements of the panel leave open, as fragments of sentences."""
    found = []
    if readings and not choose_readings(readings, params):
        days = ", ".join(sorted({each.measured_on for each in readings if each.measured_on}))
        found.append(
            f"panel {readings[0].panel} has no measurement of {params.panel_measured_on}: name one of {days}"
        )
    for band, day in sorted({(each.band, each.measured_on or "") for each in readings}):
        same = [each for each in readings if (each.band, each.measured_on or "") == (band, day)]
        stated = {(each.reflectance, each.standard_uncertainty) for each in same}
        if len(stated) > 1:
            found.append(
                f"band {band} has {len(stated)} different panel reflectances: give the one panel used"
            )
    return found


class Candidate(Record):
    """A panel frame with all that its point needs."""

    row: FrameRow
    band: multispectral.Multispectral
    at_s: float | None  # on the camera's clock
    visit: int  # number of the panel capture, from 1
    panel: PanelValue | None  # in this band on that day; None if not known
    sunshine: Sunshine | None
    left_out: str  # "" if it counts, else the reason
    left_out_code: Finding | None = None  # of the InputRejected that it would be

    @property
    def features(self) -> imaging.Features:
        if self.row.features is None:
            raise ValueError(f"{self.row.frame} has no features")
        return self.row.features


UNFOUND = "no region on the panel (give frames that do not show it the role field)"


def list_missing(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params, *, unread: Sequence[str] = ()
) -> list[str]:
    excluded = {exclusion.frame for exclusion in params.exclude}
    found = list_unknown_exclusions(params.exclude, [*(row.frame for row in rows), *unread])
    panels = [row for row in rows if row.role == PANEL and row.frame not in excluded]
    waiting = [row.frame for row in panels if row.has_region and row.features is None]
    groups = (
        ("not read yet", {*unread} - excluded, shared.NOT_READ),
        (UNFOUND, [row.frame for row in panels if not row.has_region], shared.NO_REGION),
        ("not extracted yet", waiting, shared.NOT_EXTRACTED),
    )
    found += [name_frames(what, names, finding) for what, names, finding in groups if names]
    if not panels and not unread:
        found.append("the campaign has no panel frame that can be used")
    return [*found, *list_contradictions(readings, params)]


def list_bands_without_reflectance(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> list[str]:
    """List the bands that have panel frames but no reflectance, with what to do."""
    excluded = {exclusion.frame for exclusion in params.exclude}
    shown = {
        row.header.multispectral.band
        for row in rows
        if row.role == PANEL
        and row.frame not in excluded
        and row.header.multispectral is not None
        and row.header.multispectral.panel_albedo is None
    }
    unknown = ", ".join(sorted(shown - {reading.band for reading in choose_readings(readings, params)}))
    if not unknown:
        return []
    if readings:
        named = f"panel {readings[0].panel} has no reflectance (band {unknown})"
        return [Cause(f"{named}: register it with what it reflects there", codes.PANEL_UNKNOWN)]
    named = f"the panel's reflectance is not known (band {unknown})"
    return [Cause(f"{named}: register the panel; where several are, name it (panel_id)", codes.PANEL_UNKNOWN)]


def require_flat_angle(angle_deg: float) -> None:
    """Refuse an angle at which neither the cosine nor the panel's reflectance is reliable."""
    if angle_deg > STEEPEST_ANGLE_DEG:
        raise codes.PANEL_ANGLE_TOO_LARGE.reject(
            f"The angle of incidence is {angle_deg:g} degrees; above {STEEPEST_ANGLE_DEG:g} a panel is no "
            "longer diffuse and a degree changes the result by more than 3 %. Level the panel, or wait for "
            "a higher sun."
        )


def collect_candidates(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> tuple[Candidate, ...]:
    """Collect the panel frames in the order band, time, name: the order of the input changes nothing."""
    reasons = {exclusion.frame: f"{exclusion.reason} ({exclusion.by})" for exclusion in params.exclude}
    panels = [row for row in rows if row.role == PANEL and row.header.multispectral is not None]
    visits = _count_visits(panels)
    bands = [row.header.multispectral for row in panels if row.header.multispectral is not None]
    ratios = {name: compare_channels(b for b in bands if b.band == name) for name in {b.band for b in bands}}
    stale = _find_stale(rows) if params.normalisation == "sunshine" else {}
    found = [
        _judge(
            row,
            readings,
            params,
            visit=visits[row.frame],
            excluded=reasons.get(row.frame, ""),
            stale=stale.get(row.frame, ""),
            ratios=ratios,
        )
        for row in panels
    ]
    return tuple(sorted(found, key=lambda each: (each.band.band, each.at_s or 0.0, each.row.frame)))


def _find_stale(rows: Sequence[FrameRow]) -> dict[str, str]:
    """Compare each reading of a light sensor with the one before in its band."""
    found: dict[str, str] = {}
    before: dict[str, Light] = {}
    for row in sorted(rows, key=lambda row: (sun.read_clock_s(row.header) or 0.0, row.frame)):
        band = row.header.multispectral
        if band is None or (light := see_light(band)) is None:
            continue
        last = before.setdefault(band.band, light)
        if repeated := find_repeated(band, [last]):
            found[row.frame] = repeated[1]
        else:
            before[band.band] = light
    return found


def _count_visits(panels: Sequence[FrameRow]) -> dict[str, int]:
    """Number the panel captures; a frame without a time belongs to the only one, else to none (0)."""
    times = {row.frame: sun.read_clock_s(row.header) for row in panels}
    known = sorted(at for at in times.values() if at is not None)
    starts = [after for before, after in itertools.pairwise(known) if after - before > VISIT_GAP_S]
    return {
        frame: 1 + sum(at >= start for start in starts) if at is not None else int(not starts)
        for frame, at in times.items()
    }


def _judge(
    row: FrameRow,
    readings: Sequence[Reading],
    params: Params,
    *,
    visit: int,
    excluded: str,
    stale: str,
    ratios: Mapping[str, Gain | None],
) -> Candidate:
    band = row.header.multispectral
    assert band is not None  # noqa: S101  the caller chose rows with one
    panel = find_value(band, readings, params, at=sun.read_clock(row.header))
    sunshine = None
    left_out, code = (excluded, None) if excluded else _inspect(row)
    if not left_out and stale:
        left_out, code = f"its light reading is an earlier capture's. {stale}", codes.SUNSHINE_STALE
    if not left_out and panel is None:
        left_out = NO_REFLECTANCE
    if not left_out and not visit:
        left_out = "its time is not known, and the panel was visited more than once"
    if not left_out and params.normalisation == "sunshine":
        try:
            sunshine = measure_light(
                row.header,
                choice=params.sunshine_choice,
                params=params.levelling,
                ratio=ratios[band.band],
                where=f"frame {row.frame}",
            )
        except InputRejected as rejected:
            left_out, code = rejected.message, rejected.code
    return Candidate(
        row=row,
        band=band,
        at_s=sun.read_clock_s(row.header),
        visit=visit,
        panel=panel,
        sunshine=sunshine,
        left_out=left_out,
        left_out_code=code,
    )


def _inspect(row: FrameRow) -> tuple[str, Finding | None]:
    """Return what keeps a frame's signal out of a fit, and its code if it has one of its own."""
    features = row.features
    if features is None:
        return "not extracted", None
    if features.statistics.saturated_share > MOST_SATURATED_SHARE:
        share = f"{features.statistics.saturated_share:.1%} of the region"
        return f"saturated: {share}", codes.PANEL_SATURATED
    numbers = (features.i_sq, features.i_sq_standard_uncertainty, features.gradient_rel)
    if not all(math.isfinite(number) for number in numbers):
        return "its signal is no number", None
    if features.i_sq <= DETECTION_ERRORS * features.i_sq_standard_uncertainty:
        return "less than three standard errors above black", None
    return "", None


def sunshine_flags(candidates: Sequence[Candidate]) -> list[Raised]:
    """Collect the flags of the used frames' sunshine readings."""
    return [
        raised for each in candidates if each.sunshine and not each.left_out for raised in each.sunshine.flags
    ]
