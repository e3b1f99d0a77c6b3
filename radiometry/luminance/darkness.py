"""Search for dark frames with an elevated dark signal, for example because the lamp stayed on."""

import math
from collections.abc import Mapping, Sequence

from radiometry.findings import Reason, shared
from radiometry.frame.darkness import TAKE_AGAIN, inspect_black
from radiometry.frame.statistics import Signal
from radiometry.luminance.dark import EXPOSURE_RATIO, time_ratio
from radiometry.luminance.points import DETECTION_ERRORS
from radiometry.luminance.rows import FrameRow, Params

ABOVE_OTHERS_SHARE = 0.001
"""Of the span from black to white, above the darkest dark frame of the same ISO and a like time: a tenth of
the weakest useful signal. Dark frames of one time differ by noise and by a wandering black level, together
about a tenth of this."""


def inspect_darks(rows: Sequence[FrameRow], params: Params) -> dict[str, list[Reason]]:
    """Find the dark frames with an elevated dark signal.

    Returns
    -------
    dict of str to list of Reason
        `dark_not_dark` by name of the frame: fail, or warn if it may be the
        sensor's own dark current.

    Notes
    -----
    A dark frame is compared with the darkest of its ISO value whose time is within
    a factor of two, because dark current grows with time. It is also compared with
    the black level, if the file states one: if the lamp was on in all of them, they
    agree with each other.
    """
    darks = [row for row in rows if row.role == "dark" and row.statistics]
    signals = {row.frame: row.measure(params.channel) for row in darks}
    by_iso: dict[float, list[FrameRow]] = {}
    for row in darks:
        by_iso.setdefault(row.exposure.iso, []).append(row)
    found = {}
    for group in by_iso.values():
        times = {r.frame: r.exposure.on_basis(params.exposure_basis).exposure_time_s for r in group}
        group.sort(key=lambda row: (signals[row.frame].value_dn, row.frame))
        for row in group:
            time_s = times[row.frame]
            darkest = next(r for r in group if time_ratio(times[r.frame], [time_s]) <= EXPOSURE_RATIO)
            signal = signals[row.frame]
            reason = _above_others(row, darkest, signals) or inspect_black(
                signal.value_dn, black_level_dn=signal.black_level_dn, white_level_dn=signal.white_level_dn
            )
            if reason is not None:
                found[row.frame] = [reason]
    return found


def name_unusable(rows: Sequence[FrameRow], found: Mapping[str, Sequence[Reason]]) -> list[str]:
    """Name the dark frames by which light frames are not judged, so that one mistake is reported once.

    Parameters
    ----------
    rows : sequence of FrameRow
        Frames of the campaign.
    found : mapping of str to sequence of Reason
        Result of `inspect_darks`.

    Returns
    -------
    list of str
        Names of the frames. If one fails, the lamp may shine faintly in others of
        its ISO value: only the darkest of them is used.
    """
    unusable = {frame for frame, reasons in found.items() if reasons[0].outcome == "fail"}
    for iso in {row.exposure.iso for row in rows if row.frame in unusable}:
        group = [row for row in rows if row.role == "dark" and row.statistics and row.exposure.iso == iso]
        left = [row for row in group if row.frame not in unusable]
        left.sort(key=lambda row: (row.measure("green").value_dn, row.frame))
        unusable |= {row.frame for row in left[1:]}
    return sorted(unusable)


def _above_others(row: FrameRow, darkest: FrameRow, signals: dict[str, Signal]) -> Reason | None:
    signal, least = signals[row.frame], signals[darkest.frame]
    excess = signal.value_dn - least.value_dn
    error = math.hypot(signal.standard_uncertainty_dn, least.standard_uncertainty_dn)
    if excess <= max(
        ABOVE_OTHERS_SHARE * max(signal.white_level_dn - signal.black_level_dn, 1.0), DETECTION_ERRORS * error
    ):
        return None
    detail = (
        f"Its mean is {excess:.3g} DN above that of {darkest.frame}, a dark frame of the same ISO and a like "
        f"time: this one saw light. {TAKE_AGAIN}"
    )
    return shared.DARK_NOT_DARK.reason(detail)
