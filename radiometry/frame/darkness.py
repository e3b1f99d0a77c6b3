"""Test of a dark frame for light against the black level that its file states."""

from collections.abc import Mapping, Sequence

from radiometry.drawing.text import name_few, sort_naturally
from radiometry.findings import Raised, Reason, shared
from radiometry.frame import FrameHeader

ABOVE_BLACK_SHARE = 0.005
"""Of the span, above the stated black level: half of the weakest useful signal. A warm sensor reaches it at
long times by itself, so that it is no more than a warning."""

LIT_SHARE = 0.05
"""Of the span, above the stated black level: more than the dark current of any sensor at the times and ISO
values of a campaign; this is light."""

TAKE_AGAIN = "Switch the lamp off, cover the lens and take it again."


def inspect_black(mean_dn: float, *, black_level_dn: float, white_level_dn: float) -> Reason | None:
    """Compare a dark frame's mean with the stated black level.

    Parameters
    ----------
    mean_dn : float
        Mean of the frame's region [DN].
    black_level_dn : float
        Black level that the file states [DN]; 0 if it states none.
    white_level_dn : float
        White level [DN].

    Returns
    -------
    Reason or None
        `dark_not_dark`: fail, or warn if it may be the sensor's own dark current.
        None if the frame is dark, or the file states no black level.
    """
    # a black level of zero is what a file has that states none
    if black_level_dn <= 0.0:
        return None
    share = (mean_dn - black_level_dn) / max(white_level_dn - black_level_dn, 1.0)
    if share <= ABOVE_BLACK_SHARE:
        return None
    said = (
        f"Its mean is {share:.1%} of the span from black to white above the black level that the file states"
    )
    if share > LIT_SHARE:
        detail = f"{said}: this frame saw light. {TAKE_AGAIN}"
        return shared.DARK_NOT_DARK.reason(detail)
    detail = f"{said}. {TAKE_AGAIN} If it stays with the lens covered, the sensor is warm, the frame right."
    return shared.DARK_NOT_DARK.reason(detail, "warn")


def flag_not_dark(found: Mapping[str, Reason], where: str) -> list[Raised]:
    """Return the flag of a fit that uses dark frames that are not dark.

    Parameters
    ----------
    found : mapping of str to Reason
        Reason by name of the frame.
    where : str
        What the flag names, such as "iso 3200".

    Returns
    -------
    list of Raised
        `dark_not_dark`; empty if there is no such frame.
    """
    if not found:
        return []
    return [shared.DARK_NOT_DARK.at(where, name_not_dark(found))]


def name_not_dark(found: Mapping[str, Reason]) -> str:
    """Name the dark frames that are not dark, with the reason of the first.

    Parameters
    ----------
    found : mapping of str to Reason
        Reason by name of the frame, at least one.

    Returns
    -------
    str
        The first names in order, the number of the others, and one reason.
    """
    return f"{name_few('', found)}: {found[sort_naturally(found)[0]].detail}"


def flag_assumed_black(headers: Sequence[FrameHeader]) -> list[Raised]:
    """Return the flag of a result that is made from raw files without a black level.

    Parameters
    ----------
    headers : sequence of FrameHeader
        Headers of the frames that were used.

    Returns
    -------
    list of Raised
        `black_level_assumed`; empty if every raw file states its black level.
    """
    assumed = sum(header.assumes_black for header in headers)
    detail = f"Frames without a black level: {assumed} of {len(headers)}."
    return [shared.BLACK_LEVEL_ASSUMED.at("", detail)] if assumed else []
