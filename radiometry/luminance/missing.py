"""Gaps of a luminance campaign: what keeps its fit from starting, by name."""

from collections.abc import Sequence

from radiometry.drawing.text import sort_naturally
from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import list_unknown_exclusions
from radiometry.luminance.points import FEWEST_SCENES, IsoSeries, collect_series
from radiometry.luminance.rows import FrameRow, Params, Reading

_MOST_NAMES = 3


def list_missing(
    rows: Sequence[FrameRow],
    readings: Sequence[Reading],
    params: Params,
    *,
    unread: Sequence[str] = (),
) -> list[str]:
    """List by name what keeps a fit from starting.

    Parameters
    ----------
    rows : sequence of FrameRow
        Frames of the campaign.
    readings : sequence of Reading
        Meter readings.
    params : Params
        Parameters of the fit.
    unread : sequence of str, default: ()
        Names of frames that are not read yet.

    Returns
    -------
    list of str
        Fragments that can be joined by "; ".
    """
    excluded = {exclusion.frame for exclusion in params.exclude}
    found = list_unknown_exclusions(params.exclude, [*(row.frame for row in rows), *unread])
    wanted = [row for row in rows if row.frame not in excluded]
    waiting = sort_naturally({*unread} - excluded)
    if waiting:
        found.append(f"{_name_frames(waiting, 'has', 'have')} not been read yet")
    found += _list_unmeasured(wanted)
    light = [row for row in wanted if row.role == "light"]
    sceneless = sort_naturally(row.frame for row in light if not row.scene)
    if sceneless:
        found.append(f"{_name_frames(sceneless, 'has', 'have')} no scene: say which light level it is")
    if not light and not waiting:
        return [*found, "the campaign has no light frame"]
    if waiting:  # they may be of any ISO value
        return found
    unmeasured = {row.exposure.iso for row in light if not row.statistics}
    for series in collect_series(rows, readings, params):
        usable = len({candidate.scene for candidate in series.used})
        if usable < FEWEST_SCENES and series.iso not in unmeasured:
            found.append(
                f"ISO {series.iso:g} has {usable} usable scene{'' if usable == 1 else 's'}, "
                f"a fit needs {FEWEST_SCENES}: {_reasons(series)}"
            )
    return found


def require_shares(rows: Sequence[FrameRow], params: Params) -> None:
    """Refuse a fit in which some signals would be divided by V and others not.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated` if a light frame lacks V of its region.
    """
    excluded = {exclusion.frame for exclusion in params.exclude}
    light = [row for row in rows if row.role == "light" and row.statistics and row.frame not in excluded]
    lacking = sort_naturally(row.frame for row in light if row.lens_share is None)
    if params.vignetting is not None and lacking:
        raise InputRejected(
            shared.VIGNETTING_NOT_CALIBRATED,
            f"The fit corrects vignetting, and {_name_frames(lacking, 'has', 'have')} no V of its "
            "region: give it the vignetting version.",
        )


def list_unread_scenes(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> list[str]:
    """List the scenes that have light frames but no luminance reading.

    Returns
    -------
    list of str
        Fragments of sentences; a fit can start, but leaves these scenes out.
    """
    excluded = {exclusion.frame for exclusion in params.exclude}
    read = {reading.scene for reading in readings if reading.quantity == "luminance"}
    shown = {row.scene for row in rows if row.role == "light" and row.scene and row.frame not in excluded}
    return [f"scene {scene} has no luminance reading" for scene in sort_naturally(shown - read)]


def _list_unmeasured(rows: Sequence[FrameRow]) -> list[str]:
    """List the frames without statistics, with whether they lack a region or wait for a worker."""
    regionless = sort_naturally(row.frame for row in rows if not row.statistics and not row.has_region)
    waiting = sort_naturally(row.frame for row in rows if not row.statistics and row.has_region)
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
    """State why the frames of the scenes that do not count were left out."""
    usable = {candidate.scene for candidate in series.used}
    lost = {c.scene: c.left_out for c in series.candidates if c.scene not in usable}
    if not lost:
        return "photograph more light levels"
    return ", ".join(
        f"scene {scene}: a frame was left out because {lost[scene]}" for scene in sort_naturally(lost)
    )
