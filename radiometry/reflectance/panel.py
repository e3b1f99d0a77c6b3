"""The panel of a fit: which one the frames show, and what it reflected on their day."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime
from typing import Final

from radiometry.findings import interface
from radiometry.frame.bands import name_panel
from radiometry.frame.clock import has_set_clock
from radiometry.frame.multispectral import Multispectral
from radiometry.reflectance.rows import FrameRow, Params, Reading

OLD_DAYS: Final = 730.5
_FEWEST_DAYS: Final = 365.25
"""Two measurements closer than this state no rate of ageing: their difference is mostly the meter's."""


@dataclass(frozen=True, kw_only=True)
class PanelValue:
    """Reflectance of a panel in one band on the day of a frame.

    Attributes
    ----------
    panel : str
        Serial number; "" if the file states an albedo without one.
    reflectance : float
        Reflectance on that day.
    standard_uncertainty : float
        Of the measurements as stated, 0 where they state none, and of the change between or after them.
    states_uncertainty : bool
        True if every measurement that was used states its own.
    measured_on : tuple of str, default: ()
        Days of the measurements that were used; empty if none is dated.
    age_days : float, default: 0.0
        From the nearest measurement to the day, where no measurement lies on the day's other side [d].
    from_file : bool, default: False
        True if the camera read the value from the panel's code.
    """

    panel: str
    reflectance: float
    standard_uncertainty: float
    states_uncertainty: bool
    measured_on: tuple[str, ...] = ()
    age_days: float = 0.0
    from_file: bool = False


def list_named(row: FrameRow) -> list[str]:
    """Return the panels that a frame names, by the camera's statement and by the code in the image.

    Parameters
    ----------
    row : FrameRow
        Panel frame.

    Returns
    -------
    list of str
        Serial numbers as `name_panel` writes them; two if the file contradicts itself.
    """
    stated = row.header.multispectral.panel_serial if row.header.multispectral else None
    return sorted({name_panel(each) for each in (stated, row.panel_serial) if each})


def describe_difference(row: FrameRow, readings: Sequence[Reading]) -> str:
    """Return a sentence if a frame shows another panel than the campaign's.

    Parameters
    ----------
    row : FrameRow
        Panel frame.
    readings : sequence of Reading
        Reflectances of the campaign's panel.

    Returns
    -------
    str
        Names both panels; "" if they are one, or either is not known.
    """
    named = list_named(row)
    if len(named) > 1:
        return f"Frame {row.frame} names panel {named[0]} and panel {named[1]}, in its tags and by its code."
    own = {name_panel(reading.panel): reading.panel for reading in readings}
    if not named or not own or named[0] in own:
        return ""
    return f"Frame {row.frame} shows panel {named[0]}, and the campaign's panel is {', '.join(own.values())}."


def require_one_panel(rows: Iterable[FrameRow], readings: Sequence[Reading]) -> None:
    """Refuse panel frames of another panel than the campaign's, or of several.

    Parameters
    ----------
    rows : iterable of FrameRow
        Panel frames that the fit uses.
    readings : sequence of Reading
        Reflectances of the campaign's panel; empty if it has none.

    Raises
    ------
    InputRejected
        `panel_differs`, naming both panels.
    """
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
    """Return the readings of the measurement that the parameters name, else all; a file's only without one.

    Parameters
    ----------
    readings : sequence of Reading
        Every measurement of the panel.
    params : Params
        Parameters of the fit.
    """
    if params.panel_measured_on is not None:
        return [each for each in readings if each.measured_on == params.panel_measured_on]
    measured = {each.band for each in readings if not each.from_file}
    return [each for each in readings if not each.from_file or each.band not in measured]


def find_value(
    band: Multispectral, readings: Sequence[Reading], params: Params, *, at: datetime | None
) -> PanelValue | None:
    """Return what the panel reflected in a band: by its measurements, else as the camera read its code.

    Parameters
    ----------
    band : Multispectral
        Metadata of the band.
    readings : sequence of Reading
        Every measurement of the panel.
    params : Params
        Parameters of the fit.
    at : datetime or None
        Time of the frame; of a clock that was never set the last measurement is taken.

    Returns
    -------
    PanelValue or None
        None if neither states the band.

    Notes
    -----
    Between the measurements a and b on either side of the day, at the fraction w of the time between
    them, and after (or before) the last two::

        R = (1 - w) R_a + w R_b       u = (1 - w) u_a + w u_b       u_change = |R_b - R_a| sqrt(w (1 - w))
        R = R_b                       u = u_b                       u_change = |R_b - R_a| d / T

    T is the time between the two, at least a year, and d the time to the nearest. The
    first u_change is that of a single step at a time that is not known, the largest of
    any change that goes one way; the second is the whole of a change that goes on.
    With one measurement the change since is not known, and `panel_old` states its age.
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
    """List what the measurements of the panel leave open, as fragments of sentences.

    Parameters
    ----------
    readings : sequence of Reading
        Every measurement of the panel.
    params : Params
        Parameters of the fit.
    """
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
