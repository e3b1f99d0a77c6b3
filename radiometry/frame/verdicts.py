"""What a field team is told of a frame while it is still on site: pass, warn, fail or pending, and why."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Literal, Self

from radiometry.findings.errors import Code, InputRejected
from radiometry.findings.flags import Flag
from radiometry.frame.roi import Polygon, bounding_window

Format = tuple[int, int, str]
"""Width and height [px], and the colour filter array."""

Outcome = Literal["pass", "warn", "fail", "pending"]

# What is certain to be lost outranks what is not known yet, and that what is doubtful.
_RANKS: tuple[Outcome, ...] = ("pass", "warn", "pending", "fail")

_FIELD = "field"


class ReasonCode(StrEnum):
    """Why a frame does not simply pass. Stable: clients match on it; each has a heading in docs/."""

    meaning: str

    def __new__(cls, value: str, meaning: str) -> Self:
        """Bind the one-line meaning to the value."""
        member = str.__new__(cls, value)
        member._value_ = value
        member.meaning = meaning
        return member

    # of any frame
    NOT_READ = "not_read", "The frame has arrived and waits to be read."
    NO_REGION = "no_region", "Neither the frame nor its campaign has a region."
    NOT_EXTRACTED = "not_extracted", "The statistics of the frame's region are not there yet."
    REFUSED = "refused", "The file cannot be used; the detail is the refusal's."
    ROI_UNFIT = "roi_unfit", "The region leaves the frame, or is too small for what is measured in it."
    FORMAT_DIFFERS = "format_differs", "Its size or colour filter differs from most frames of the campaign."
    ROLE_UNUSED = "role_unused", "Its role is none that the campaign's fit looks at."
    EXPOSURE_NOT_MANUAL = "exposure_not_manual", "The camera chose the exposure."
    RENDERED = "rendered", "The image is not raw."
    IMAGE_PART_EMPTY = "image_part_empty", "A part of the image is empty: the fit leaves the frame out."
    # of a light frame
    SCENE_MISSING = "scene_missing", "Nobody said which light level it shows."
    READING_MISSING = "reading_missing", "Its scene has no luminance reading."
    CLIPPED = "clipped", "More than 0.1 % of the region is saturated: the fit leaves the frame out."
    NEARLY_CLIPPED = "nearly_clipped", "The brightest of the region comes within 5 % of white."
    TOO_DARK = "too_dark", "The signal is less than three standard errors above dark: the fit leaves it out."
    WEAK_SIGNAL = "weak_signal", "The signal is above dark, but too little to weigh much."
    UNEVEN = "uneven", "The region is not one evenly lit surface."
    SCENE_DOUBTFUL = "scene_doubtful", "It disagrees with the other frames of its scene."
    LAMP_DRIFT = "lamp_drift", "The illuminance readings of its scene spread over more than 2 %."
    REDUNDANT = "redundant", "Another frame has the same scene, ISO, time and f-number."
    # of a flat frame
    DUST = "dust", "Dust, a mark or a reflection stands in the flat field."
    # of a multispectral frame
    PANEL_UNEVEN = "panel_uneven", "The signal changes by more than 3 % across the panel's region."
    PANEL_WEAK = "panel_weak", "The panel's signal cannot be told from black, or is no number."
    PANEL_UNKNOWN = "panel_unknown", "Nobody has said what the panel reflects in this band."
    SUNSHINE_UNUSABLE = "sunshine_unusable", "It carries no valid reading of a sunshine sensor."
    # of a frame among equal ones
    UNPAIRED = "unpaired", "No other frame has its settings: it shows no noise."
    PAIR_DRIFT = "pair_drift", "The light changed between it and the other frames of its settings."
    # of a dark frame
    DARK_NOT_DARK = "dark_not_dark", "It is brighter than other dark frames, or than black, by too much."
    # of a frame of a chart
    CHART_UNUSABLE = "chart_unusable", "A channel of a region shows no edge or star that can be measured."
    BLURRED = "blurred", "It is less sharp than another frame of the same position."
    # of a picture of a board
    BOARD_NOT_FOUND = "board_not_found", "The board was not found: the fit leaves the frame out."
    BOARD_BLURRED = "board_blurred", "The edges of the board's squares rise over more than 5 px."
    BOARD_SMALL = "board_small", "The board fills less than a twentieth of the frame."


@dataclass(frozen=True, kw_only=True)
class Reason:
    """One thing to know about a frame; ``detail`` is a sentence with the numbers and what to do."""

    code: ReasonCode
    outcome: Outcome
    detail: str


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What follows from all reasons together; without any, "pass"."""

    outcome: Outcome
    reasons: tuple[Reason, ...]


@dataclass(frozen=True, kw_only=True)
class ReviewedFrame:
    """A frame as its campaign knows it at a moment.

    ``frame`` : its name, unique in the campaign; ``role`` : "light", "dark", ...
    ``state`` : received | read | extracted | refused; ``refusal`` : the sentence of a refused frame, else ""
    ``flags`` : those raised when it was accepted, and the code of a region that did not do
    ``format`` : of a frame that has been read, else None
    ``region`` : the polygon that holds for it now, None where nobody has drawn one
    ``needs_region`` : False for a frame that is measured as a whole where none is drawn
    ``roles`` : those that its campaign's method looks at; empty: all
    ``told`` : False while nobody has said what is photographed, and the method must know
    """

    frame: str
    role: str
    scene: str | None
    state: str
    refusal: str
    flags: tuple[str, ...]
    format: Format | None
    region: Polygon | None
    needs_region: bool = True
    roles: frozenset[str] = frozenset()
    told: bool = True


def conclude(reasons: Iterable[Reason]) -> Verdict:
    """Draw the verdict from reasons, the gravest first; of equals the order stays."""
    ordered = tuple(sorted(reasons, key=lambda reason: -_RANKS.index(reason.outcome)))
    return Verdict(outcome=ordered[0].outcome if ordered else "pass", reasons=ordered)


def give_whole_frame(frame: ReviewedFrame) -> ReviewedFrame:
    """Give the whole frame for its region where none is drawn and one is needed."""
    if frame.region is not None or frame.format is None or not frame.needs_region:
        return frame
    width, height = frame.format[:2]
    return replace(frame, region=Polygon.from_points([(0, 0), (width, 0), (width, height), (0, height)]))


def find_usual_format(frames: Sequence[ReviewedFrame]) -> Format | None:
    """Give the format that most frames of a campaign have; of equally many, the smallest by its numbers."""
    counts = Counter(frame.format for frame in frames if frame.format is not None and not frame.refusal)
    return min(counts, key=lambda form: (-counts[form], form), default=None)


def inspect_frames(frames: Sequence[ReviewedFrame]) -> dict[str, list[Reason]]:
    """Say what can be said of frames of any role and method before their statistics are looked at.

    Reasons
      refused, roi_unfit : fail; role_unused, exposure_not_manual, rendered : warn;
      not_read, no_region, not_extracted : pending;
      format_differs : fail where frames of another format share the frame's region, else warn
    """
    sharing: dict[Polygon | None, list[ReviewedFrame]] = {}
    for frame in frames:
        sharing.setdefault(frame.region, []).append(frame)
    usual = find_usual_format(frames)
    by_region = {region: find_usual_format(group) for region, group in sharing.items()}
    return {
        frame.frame: [*inspect_frame(frame), *_inspect_format(frame, by_region[frame.region], usual)]
        for frame in frames
    }


def inspect_frame(frame: ReviewedFrame) -> list[Reason]:
    """Say what can be said of one frame by itself: all that `inspect_frames` says, but for format_differs."""
    if frame.state == "refused":
        return [Reason(code=ReasonCode.REFUSED, outcome="fail", detail=frame.refusal)]
    if frame.format is None:
        detail = "This frame waits to be read: ask again in a few seconds."
        return [Reason(code=ReasonCode.NOT_READ, outcome="pending", detail=detail)]
    reasons = [*_inspect_role(frame), *_inspect_region(frame, *frame.format[:2])]
    if Flag.IMAGE_PART_EMPTY in frame.flags:
        detail = (
            "A part of this image is empty, zeros or below black where a sensor shows noise. Copy the file "
            "from the card again, or take the frame again. The fit leaves it out."
        )
        reasons.append(Reason(code=ReasonCode.IMAGE_PART_EMPTY, outcome="fail", detail=detail))
    if Flag.EXPOSURE_NOT_MANUAL in frame.flags:
        detail = (
            "The camera chose the exposure itself. Set the exposure mode to manual and automatic ISO off, "
            "and take the frame again."
        )
        reasons.append(Reason(code=ReasonCode.EXPOSURE_NOT_MANUAL, outcome="warn", detail=detail))
    if Flag.RENDERED in frame.flags:
        detail = (
            "This is a converted image: a tone curve stands between light and numbers. "
            "Upload the camera's own raw file."
        )
        reasons.append(Reason(code=ReasonCode.RENDERED, outcome="warn", detail=detail))
    return reasons


def _inspect_role(frame: ReviewedFrame) -> list[Reason]:
    """Say so of a frame that no fit will see; a field frame is there to be measured."""
    if not frame.roles or frame.role in {*frame.roles, _FIELD}:
        return []
    wanted = " and ".join(sorted(frame.roles))
    detail = (
        f"Its role is {frame.role}; this campaign's fit looks at {wanted} frames only. Correct the role, or "
        "upload the file to its own campaign."
    )
    return [Reason(code=ReasonCode.ROLE_UNUSED, outcome="warn", detail=detail)]


def _inspect_format(frame: ReviewedFrame, of_region: Format | None, usual: Format | None) -> list[Reason]:
    outcome: Outcome
    if frame.format is None or frame.state == "refused" or of_region is None or usual is None:
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
    return [Reason(code=ReasonCode.FORMAT_DIFFERS, outcome=outcome, detail=detail)]


def _inspect_region(frame: ReviewedFrame, width_px: int, height_px: int) -> list[Reason]:
    if frame.region is None and not frame.needs_region:
        return []
    if frame.region is None:
        detail = "No region (ROI) is drawn yet: draw it on the preview, for the campaign or for this frame."
        return [Reason(code=ReasonCode.NO_REGION, outcome="pending", detail=detail)]
    if frame.state == "extracted":
        return []
    try:
        bounding_window(frame.region, height_px=height_px, width_px=width_px)
    except InputRejected as refusal:
        detail = f"{refusal.message} Draw the region anew, or give this frame one of its own."
        return [Reason(code=ReasonCode.ROI_UNFIT, outcome="fail", detail=detail)]
    if Code.ROI_EMPTY in frame.flags:
        detail = "Its region is too small for what is measured in it. Draw it larger."
        return [Reason(code=ReasonCode.ROI_UNFIT, outcome="fail", detail=detail)]
    detail = (
        "The statistics of its region are being computed: ask again in a few seconds."
        if frame.told
        else "Nobody has said what is photographed: describe the board, and it is looked for here."
    )
    return [Reason(code=ReasonCode.NOT_EXTRACTED, outcome="pending", detail=detail)]


def _show_format(form: Format) -> str:
    return f"{form[0]} x {form[1]} pixels, {form[2]}"
