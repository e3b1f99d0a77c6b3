"""Frames of a vignetting campaign: which are used, which are left out and why, and what is missing."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from radiometry.drawing.text import name_few
from radiometry.findings import InputRejected
from radiometry.vignetting import codes
from radiometry.vignetting.features import FrameRow
from radiometry.vignetting.light import ChannelLight, FlatLight, leave_out, measure_light
from radiometry.vignetting.quality import Quality, inspect_flat
from radiometry.vignetting.results import Point
from radiometry.vignetting.rows import DARK, FLAT, Params


@dataclass(frozen=True)
class Candidate:
    """Flat frame that may be used.

    Attributes
    ----------
    row : FrameRow
        Evidence of the frame.
    light : FlatLight or None
        Light above dark; None without features.
    quality : Quality or None
        Result of the inspection; None without features.
    left_out : str
        "" if it counts, else the reason.
    """

    row: FrameRow
    light: FlatLight | None
    quality: Quality | None
    left_out: str

    @property
    def channels(self) -> tuple[ChannelLight, ...]:
        """Light of every channel without the blocks of spots."""
        if self.light is None:
            return ()
        if self.quality is None or self.quality.spots_mask is None:
            return self.light.channels
        return tuple(leave_out(each, self.quality.spots_mask) for each in self.light.channels)


def missing(rows: Sequence[FrameRow], params: Params, *, unread: Sequence[str] = ()) -> tuple[str, ...]:
    """List, by name, what keeps a fit from starting."""
    excluded = {exclusion.frame for exclusion in params.exclude}
    flats = [row for row in rows if row.role == FLAT and row.frame not in excluded]
    waiting = [row.frame for row in rows if row.features is None and row.frame not in excluded]
    lacking = [
        f"{what}: {name_few('frame', group)}"
        for group, what in ((unread, "not read yet"), (waiting, "not extracted yet"))
        if group
    ]
    without = [row.frame for row in flats if row.exposure is None]
    if without:
        lacking.append(f"no exposure time, f-number and ISO: {name_few('frame', without)}")
    if not flats and not unread:
        lacking.append("no flat frame: photograph an even, format-filling surface at each f-number")
    return tuple(lacking)


def collect_candidates(rows: Sequence[FrameRow], params: Params) -> tuple[Candidate, ...]:
    """Return every flat frame, inspected.

    Parameters
    ----------
    rows : sequence of FrameRow
        Evidence of the campaign's frames.
    params : Params
        Parameters of the fit.

    Returns
    -------
    tuple of Candidate
        Candidates in the order f-number, name, whatever the order of the input.
    """
    excluded = {exclusion.frame: exclusion for exclusion in params.exclude}
    usable = [row for row in rows if row.frame not in excluded]
    usual = _find_usual(usable)
    found = []
    for row in sorted(rows, key=_order):
        if row.role != FLAT:
            continue
        exclusion = excluded.get(row.frame)
        if exclusion is not None:
            reason = f"excluded by {exclusion.by}: {exclusion.reason}"
            found.append(Candidate(row=row, light=None, quality=None, left_out=reason))
        elif row.features is None or row.exposure is None:
            found.append(Candidate(row=row, light=None, quality=None, left_out="not extracted"))
        elif _format(row) != usual:
            reason = "another picture size or colour filter than most flat frames: set the camera as for them"
            found.append(Candidate(row=row, light=None, quality=None, left_out=reason))
        else:
            light = measure_light(row, usable)
            quality = inspect_flat(light)
            found.append(Candidate(row=row, light=light, quality=quality, left_out=quality.left_out))
    return tuple(found)


def _order(row: FrameRow) -> tuple[float, str]:
    return (row.exposure.f_number if row.exposure else 0.0), row.frame


def _format(row: FrameRow) -> tuple[int, int, str] | None:
    if row.features is None:
        return None
    return row.features.grid.height_px, row.features.grid.width_px, row.features.cfa


def _find_usual(rows: Sequence[FrameRow]) -> tuple[int, int, str] | None:
    """Return the format of most flat frames; of equally many the smallest by its numbers."""
    counts = Counter(_format(row) for row in rows if row.role == FLAT and row.features is not None)
    return min(counts, key=lambda form: (-counts[form], form or (0, 0, "")), default=None)


def require_one_lens(candidates: Sequence[Candidate]) -> None:
    """Check that all flat frames are of one lens: a falloff belongs to one.

    Raises
    ------
    InputRejected
        `flat_unusable` if they are of several lenses.
    """
    lenses = {
        f"{header.lens_model or 'unnamed lens'} {header.lens_serial or ''}".strip()
        for header in (candidate.row.header for candidate in candidates if not candidate.left_out)
    }
    if len(lenses) > 1:
        raise InputRejected(
            codes.FLAT_UNUSABLE,
            f"The flat frames are of several lenses: {', '.join(sorted(lenses))}. A falloff belongs to one "
            "lens: exclude the frames of the others.",
        )


def describe_points(
    rows: Sequence[FrameRow], candidates: Sequence[Candidate], params: Params
) -> tuple[Point, ...]:
    """Return every flat and dark frame as it is stored, used or not.

    Parameters
    ----------
    rows : sequence of FrameRow
        Evidence of the campaign's frames.
    candidates : sequence of Candidate
        Flat frames.
    params : Params
        Parameters of the fit.

    Returns
    -------
    tuple of Point
        Point of each frame.
    """
    excluded = {exclusion.frame: exclusion for exclusion in params.exclude}
    points = [_describe_flat(candidate) for candidate in candidates]
    served = {
        candidate.row.exposure.iso
        for candidate in candidates
        if candidate.row.exposure and not candidate.left_out
    }
    for row in sorted((row for row in rows if row.role == DARK), key=_order):
        left_out = ""
        if row.frame in excluded:
            left_out = f"excluded by {excluded[row.frame].by}: {excluded[row.frame].reason}"
        elif row.features is None or row.exposure is None:
            left_out = "not extracted"
        elif row.exposure.iso not in served:
            left_out = f"no flat frame at ISO {row.exposure.iso:g}"
        points.append(
            Point(
                frame=row.frame,
                role=DARK,
                f_number=row.exposure.f_number if row.exposure else None,
                used=not left_out,
                left_out=left_out,
            )
        )
    return tuple(points)


def _describe_flat(candidate: Candidate) -> Point:
    quality = candidate.quality
    exposure = candidate.row.exposure
    return Point(
        frame=candidate.row.frame,
        role=FLAT,
        f_number=exposure.f_number if exposure else None,
        used=not candidate.left_out,
        left_out=candidate.left_out,
        saturated_share=quality.saturated_share if quality else None,
        signal_share=quality.signal_share if quality else None,
        gradient_rel=quality.gradient_rel if quality else None,
        gradient_standard_uncertainty_rel=quality.gradient_u_rel if quality else None,
        spots=quality.spots if quality else (),
    )
