"""Verdict on a frame, from what is known of it before any fit."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, TypeVar

from radiometry.drawing.text import name_few, sort_naturally
from radiometry.findings import InputRejected, Outcome, Raised, Reason, shared
from radiometry.frame import FrameHeader
from radiometry.frame.roi import Polygon, bounding_window
from radiometry.records import Record, about

T = TypeVar("T")
Key = TypeVar("Key", str, tuple[int, int, str])


class Keeping:
    """Base of a record: reviews of a campaign that grows meet the same frames again and again."""

    @cached_property
    def _kept(self) -> dict[str, tuple[object, Any]]:
        return {}

    def keep(self, name: str, given: object, compute: Callable[..., T], *args: object) -> T:
        """Return a result that was computed from this object and from `given`, the last one of each name."""
        kept = self._kept.get(name)
        if kept is None or kept[0] != given:
            kept = self._kept[name] = given, compute(*args)
        found: T = kept[1]
        return found


# Of the span, above the stated black level: half of the weakest useful signal. A warm sensor reaches it at
# long times by itself, so that it is no more than a warning.
ABOVE_BLACK_SHARE = 0.005

# Of the span, above the stated black level: more than the dark current of any sensor at the times and ISO
# values of a campaign; this is light
LIT_SHARE = 0.05

TAKE_AGAIN = "Switch the lamp off, cover the lens and take it again."


def inspect_black(mean_dn: float, *, black_level_dn: float, white_level_dn: float) -> Reason | None:
    """Compare a dark frame's mean with the stated black level."""
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
        return shared.DARK_NOT_DARK.reason(f"{said}: this frame saw light. {TAKE_AGAIN}")
    detail = f"{said}. {TAKE_AGAIN} If it stays with the lens covered, the sensor is warm, the frame right."
    return shared.DARK_NOT_DARK.reason(detail, "warn")


def flag_not_dark(found: Mapping[str, Reason], where: str) -> list[Raised]:
    if not found:
        return []
    return [shared.DARK_NOT_DARK.at(where, name_not_dark(found))]


def name_not_dark(found: Mapping[str, Reason]) -> str:
    return f"{name_few('', found)}: {found[sort_naturally(found)[0]].detail}"


def flag_rendered(rendered: Sequence[bool], where: str = "") -> list[Raised]:
    """Return the flag of a result from frames whose tone curve lies between light and numbers."""
    detail = f"Rendered frames: {sum(rendered)} of {len(rendered)}."
    return [shared.RENDERED.at(where, detail)] if any(rendered) else []


def flag_assumed_black(headers: Sequence[FrameHeader]) -> list[Raised]:
    """Return the flag of a result that is made from raw files without a black level."""
    assumed = sum(header.assumes_black for header in headers)
    detail = f"Frames without a black level: {assumed} of {len(headers)}."
    return [shared.BLACK_LEVEL_ASSUMED.at("", detail)] if assumed else []


Format = tuple[int, int, str]  # Width and height [px], and the colour filter array

# What is certain to be lost outranks what is not known yet, and that what is doubtful.
_RANKS: dict[Outcome, int] = {"fail": 0, "pending": 1, "warn": 2, "pass": 3}

_FIELD = "field"

_OF_FLAGS = {
    shared.IMAGE_PART_EMPTY: "A part of this image is empty, zeros or below black where a sensor shows "
    "noise. Copy the file from the card again, or take the frame again. The fit leaves it out.",
    shared.EXPOSURE_NOT_MANUAL: "The camera chose the exposure itself. Set the exposure mode to manual and "
    "automatic ISO off, and take the frame again.",
    shared.RENDERED: "This is a converted image: a tone curve stands between light and numbers. Upload the "
    "camera's own raw file.",
}


class Verdict(Record):
    """Verdict from all reasons together; "pass" if there are none."""

    outcome: Outcome = about("Outcome of the gravest reason.")
    reasons: tuple[Reason, ...] = about("Reasons, the gravest first.")


class ReviewedFrame(Record, Keeping):
    """State of a frame in its campaign at one moment."""

    frame: str  #: Name of the frame, unique in the campaign
    role: str  #: "light", "dark" and so on
    scene: str | None  #: Name of what the frame shows, if it was given
    state: str  #: "received", "read", "extracted" or "refused"
    refusal: str  #: Message of a refused frame, else ""
    #: Flags raised when the frame was accepted, and the code of a region that could not be used
    flags: tuple[str, ...]
    format: Format | None  #: Format of a frame that has been read, else None
    region: Polygon | None  #: Polygon that applies to it now; None if none is drawn
    needs_region: bool = True  #: False for a frame that is measured as a whole if no region is drawn
    roles: frozenset[str] = frozenset()  #: Roles that the method of its campaign uses; empty for all
    told: bool = True  #: False if what is photographed has not been described and the method needs it
    lens: str = ""  #: Lens that the file names; "" if it names none
    left_out: str = ""  #: Why its campaign's method has no use for it; "" if it has


def conclude(reasons: Iterable[Reason]) -> Verdict:
    """Derive the verdict from reasons.

    Parameters
    ----------
    reasons : iterable of Reason
        Reasons of one frame.

    Returns
    -------
    Verdict
        Verdict with the gravest reason first; equally grave reasons keep their order.
    """
    ordered = tuple(sorted(reasons, key=lambda reason: _RANKS[reason.outcome]))
    return Verdict(outcome=ordered[0].outcome if ordered else "pass", reasons=ordered)


def assume_whole_frame(frame: ReviewedFrame) -> ReviewedFrame:
    """Return the frame with the whole image as its region if none is drawn and one is needed."""
    if frame.region is not None or frame.format is None or not frame.needs_region:
        return frame
    width, height = frame.format[:2]
    return replace(frame, region=Polygon.from_points([(0, 0), (width, 0), (width, height), (0, height)]))


def find_usual_format(frames: Sequence[ReviewedFrame]) -> Format | None:
    found = [each.format for each in frames if each.format and not each.refusal and not each.left_out]
    return _find_usual(found) if found else None


def _find_usual(values: Iterable[Key]) -> Key:
    """Return the most frequent value, of equally frequent ones the smallest."""
    counts = Counter(values)
    return min(counts, key=lambda value: (-counts[value], value))


def inspect_frames(frames: Sequence[ReviewedFrame]) -> dict[str, list[Reason]]:
    """Check frames of any role and method before their statistics are used."""
    usual, lens = (
        find_usual_format(frames),
        _find_usual([each.lens for each in frames if _shows_lens(each)] or [""]),
    )
    if all(frame.format in {usual, None} for frame in frames):
        return {frame.frame: [*_inspect_lens(frame, lens), *inspect_frame(frame)] for frame in frames}
    sharing: dict[Polygon | None, list[ReviewedFrame]] = {}
    for frame in frames:
        sharing.setdefault(frame.region, []).append(frame)
    by_region = {region: find_usual_format(group) for region, group in sharing.items()}
    return {
        frame.frame: [
            *_inspect_format(frame, by_region[frame.region], usual),
            *_inspect_lens(frame, lens),
            *inspect_frame(frame),
        ]
        for frame in frames
    }


def inspect_frame(frame: ReviewedFrame) -> list[Reason]:
    """Check one frame without the others.

    Parameters
    ----------
    frame : ReviewedFrame
        Frame in review.

    Returns
    -------
    list of Reason
        The reasons of `inspect_frames` except `format_differs` and `lens_differs`.
    """
    return frame.keep("reasons", None, _inspect, frame)


def _inspect(frame: ReviewedFrame) -> list[Reason]:
    if frame.state == "refused":
        return [shared.REFUSED.reason(frame.refusal)]
    if frame.format is None:
        return [shared.NOT_READ.reason("This frame waits to be read: ask again in a few seconds.")]
    if frame.left_out:
        return [shared.FRAME_LEFT_OUT.reason(frame.left_out)]
    raised = [finding.reason(detail) for finding, detail in _OF_FLAGS.items() if finding in frame.flags]
    return [*_inspect_role(frame), *_inspect_region(frame, *frame.format[:2]), *raised]


def _inspect_role(frame: ReviewedFrame) -> list[Reason]:
    """Return a reason for a frame that no fit will use; a field frame is there to be measured."""
    if not frame.roles or frame.role in {*frame.roles, _FIELD}:
        return []
    wanted = " and ".join(sorted(frame.roles))
    detail = (
        f"Its role is {frame.role}; this campaign's fit looks at {wanted} frames only. Correct the role, or "
        "upload the file to its own campaign."
    )
    return [shared.ROLE_UNUSED.reason(detail)]


def _inspect_format(frame: ReviewedFrame, of_region: Format | None, usual: Format | None) -> list[Reason]:
    outcome: Outcome
    if frame.format is None or frame.state == "refused" or of_region is None or usual is None:
        return []
    if frame.left_out:
        return []
    if frame.format != of_region:
        outcome, other = "fail", of_region
    elif frame.format != usual:
        outcome, other = "warn", usual
    else:
        return []
    detail = (
        f"This frame is {_show_format(frame.format)}, others of the campaign are {_show_format(other)}: "
        "another picture size, crop or sensor mode. Set the camera as for the others and take it again."
    )
    return [shared.FORMAT_DIFFERS.reason(detail, outcome)]


def _shows_lens(frame: ReviewedFrame) -> bool:
    # a dark frame is the same behind any lens
    return bool(frame.lens) and frame.role != "dark" and not frame.refusal and not frame.left_out


def _inspect_lens(frame: ReviewedFrame, usual: str) -> list[Reason]:
    if frame.lens == usual or not _shows_lens(frame):
        return []
    detail = f"The file names the lens {frame.lens}, most others name {usual}. {shared.LENS_DIFFERS.remedy}"
    return [shared.LENS_DIFFERS.reason(detail)]


def _inspect_region(frame: ReviewedFrame, width_px: int, height_px: int) -> list[Reason]:
    if frame.region is None and not frame.needs_region:
        return []
    if frame.region is None:
        detail = "No region (ROI) is drawn yet: draw it on the preview, for the campaign or for this frame."
        return [shared.NO_REGION.reason(detail)]
    if frame.state == "extracted":
        return []
    try:
        bounding_window(frame.region, height_px=height_px, width_px=width_px)
    except InputRejected as refusal:
        detail = f"{refusal.message} Redraw the region, or give this frame one of its own."
        return [shared.ROI_UNFIT.reason(detail)]
    if shared.ROI_EMPTY in frame.flags:
        detail = "Its region is too small for what is measured in it. Draw it larger."
        return [shared.ROI_UNFIT.reason(detail)]
    detail = (
        "The statistics of its region are being computed: ask again in a few seconds."
        if frame.told
        else "Nobody has said what is photographed: describe the board, and it is looked for here."
    )
    return [shared.NOT_EXTRACTED.reason(detail)]


def _show_format(form: Format) -> str:
    return f"{form[0]} x {form[1]} pixels, {form[2]}"
