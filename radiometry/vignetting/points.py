"""Flat frames of a campaign: their quality before any fit, which are used, and what is missing."""

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.drawing.text import name_few
from radiometry.findings import Finding, Raised, shared
from radiometry.findings.grouping import name_frames
from radiometry.records import Record
from radiometry.vignetting import codes
from radiometry.vignetting.blocks import FrameRow, Plane
from radiometry.vignetting.falloff import CENTRE, FEWEST_TERMS, Blocks, Solution, solve_falloff
from radiometry.vignetting.light import MOST_CLIPPED_SHARE, ChannelLight, FlatLight, leave_out, measure_light
from radiometry.vignetting.results import DARK, FLAT, Params, Point, Spot

# Of the span from dark to white: a dark signal that is wrong by a thousandth of it is then 5 % of the light,
# which a correction would turn into a falloff
LEAST_SIGNAL_SHARE = 0.02

WEAK_SIGNAL_SHARE = 0.10

# Of a plane, across the frame. So strong a gradient is hardly a plane, and what it departs from one by, a
# tenth of it perhaps, would pass for a falloff of 1 %.
MOST_GRADIENT_REL = 0.10

FLAGGED_GRADIENT_REL = 0.02

MOST_SPOTS_SHARE = 0.05
SPOT_REL = 0.01
SPOT_DEVIATIONS = 6.0

FEWEST_BLOCKS = 24  # Three for each of the eight parameters

_NORMAL_MAD = 1.4826
_NEIGHBOURHOOD = 7
_ROUNDS = 3
_ROUNDS_OF_WEIGHTS = 8
_RADIAL_DEGREE = 6
_MOST_NAMED = 3


class Quality(Record, kw_only=False):
    """Result of the inspection of a flat frame."""

    left_out: str  # "" for one that can be used, else what to do
    problem: Finding | None  # Why it was left out: None if it was not
    saturated_share: float  # Fraction of clipped pixels of the most clipped channel
    signal_share: float  # Median light of the weakest channel, as a fraction of its span
    strongest: str  # Channel with the strongest signal
    # Gradient of the light across the frame in the strongest channel, and its standard uncertainty; None if
    # it was not measured
    gradient_rel: float | None
    gradient_u_rel: float | None
    is_uneven: bool  # True if the gradient is more than 2 %, and not noise
    spots: tuple[Spot, ...]  # Spots that were found
    spots_share: float  # Fraction of blocks in spots
    spots_mask: NDArray[np.bool_] | None  # True for each block of a spot


def inspect_flat(light: FlatLight) -> Quality:
    """Check a flat frame, in the order in which one fault hides the next."""
    most_clipped = max(light.channels, key=lambda each: each.clipped_share)
    weakest = min(light.channels, key=lambda each: each.median_share)
    strongest = max(light.channels, key=lambda each: each.median_share)
    problem, left_out = _refuse_exposure(most_clipped, weakest)
    gradient = gradient_u = None
    is_uneven = False
    spots: NDArray[np.bool_] | None = None
    found: tuple[Spot, ...] = ()
    if not problem:
        solution, spots = _fit_without_spots(strongest)
        gradient, gradient_u = measure_gradient(solution, strongest.blocks)
        is_uneven = gradient > FLAGGED_GRADIENT_REL and solution.has_gradient
        found = _list_spots(solution, spots, strongest.blocks)
        refused = gradient if is_uneven and gradient > MOST_GRADIENT_REL else None
        problem, left_out = _refuse_shape(strongest.channel, solution, refused, spots)
    return Quality(
        left_out=left_out,
        problem=problem,
        saturated_share=most_clipped.clipped_share,
        signal_share=weakest.median_share,
        strongest=strongest.channel,
        gradient_rel=gradient,
        gradient_u_rel=gradient_u,
        is_uneven=is_uneven,
        spots=found,
        spots_share=float(spots.mean()) if spots is not None else 0.0,
        spots_mask=spots,
    )


def _refuse_exposure(clipped: ChannelLight, weakest: ChannelLight) -> tuple[Finding | None, str]:
    if clipped.clipped_share > MOST_CLIPPED_SHARE:
        return shared.CLIPPED, (
            f"{clipped.clipped_share:.2%} of channel {clipped.channel} is clipped, more than "
            f"{MOST_CLIPPED_SHARE:.1%}: expose less, so that the brightest part reaches 60 to 80 %"
        )
    if weakest.median_share < LEAST_SIGNAL_SHARE:
        return shared.TOO_DARK, (
            f"the light of channel {weakest.channel} is {weakest.median_share:.1%} of the span from black to "
            f"white, less than {LEAST_SIGNAL_SHARE:.0%}: expose longer or light the target better"
        )
    counted = min(int(np.isfinite(each.blocks.standard_error).sum()) for each in (clipped, weakest))
    if counted < FEWEST_BLOCKS:
        return shared.ROI_UNFIT, (
            f"only {counted} blocks can be used, {FEWEST_BLOCKS} are needed: leave the region out, so that "
            "the whole frame counts"
        )
    return None, ""


def _refuse_shape(
    channel: str, solution: Solution, gradient: float | None, spots: NDArray[np.bool_]
) -> tuple[Finding | None, str]:
    if gradient is not None:
        return shared.UNEVEN, (
            f"the light of channel {channel} changes by {gradient:.1%} across the frame, brighter "
            f"towards {name_direction(solution.gradient)}, more than {MOST_GRADIENT_REL:.0%}: even "
            "out the light, or use opal glass before the lens"
        )
    if spots.mean() > MOST_SPOTS_SHARE:
        return codes.DUST, (
            f"{spots.mean():.0%} of its blocks are spots, more than {MOST_SPOTS_SHARE:.0%}: something stands "
            "in the picture, or the target has a pattern"
        )
    return None, ""


def measure_gradient(solution: Solution, blocks: Blocks) -> tuple[float, float]:
    """Return the relative range of the light's plane across the frame, and its standard uncertainty."""
    extent = np.array([blocks.grid.height_px, blocks.grid.width_px]) / blocks.grid.half_diagonal_px
    signed = np.copysign(extent, solution.gradient)
    variance = float(signed @ solution.gradient_covariance @ signed)
    return float(signed @ np.array(solution.gradient)), math.sqrt(variance)


def name_direction(gradient: tuple[float, float]) -> str:
    """Return where the light is brighter, in words."""
    by_row, by_col = gradient
    if abs(by_row) > abs(by_col):
        return "the bottom" if by_row > 0.0 else "the top"
    return "the right" if by_col > 0.0 else "the left"


def _fit_without_spots(light: ChannelLight) -> tuple[Solution, NDArray[np.bool_]]:
    """Fit, leave out what stands apart from its surroundings, and fit again."""
    spots: NDArray[np.bool_] = np.zeros(light.blocks.light.shape, np.bool_)
    left = light
    solution = solve_falloff(left.blocks, terms=FEWEST_TERMS)
    for _ in range(_ROUNDS):
        known = np.isfinite(left.blocks.standard_error)
        found = _find_spots(solution, left.blocks, known)
        if not found.any() or (known & ~found).sum() < FEWEST_BLOCKS:
            break
        spots |= found
        left = leave_out(light, spots)
        solution = solve_falloff(left.blocks, terms=FEWEST_TERMS)
    return solution, spots


def _find_spots(solution: Solution, blocks: Blocks, known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which blocks differ from the median of their 7 x 7 surroundings by 1 % and six deviations.

    The deviation of a block grows with its own standard error: one that is cut by the border has fewer
    pixels, one in a corner less light.
    """
    noise = np.where(known, blocks.standard_error / solution.fitted, 1.0)
    residual = np.where(known, solution.residual - _follow_radius(solution, blocks, noise, known), 0.0)
    local = residual - scipy.ndimage.median_filter(residual, size=_NEIGHBOURHOOD, mode="nearest")
    usual = _NORMAL_MAD * float(np.median(np.abs(local[known]) / noise[known]))
    return np.asarray(known & (np.abs(local) > np.maximum(SPOT_REL, SPOT_DEVIATIONS * usual * noise)))


def _follow_radius(solution: Solution, blocks: Blocks, noise: Plane, known: NDArray[np.bool_]) -> Plane:
    """Return what a falloff has beyond three terms, which is steep in the corners of a wide lens and no spot.

    A polynomial in r^2 through the residuals, whose outliers lose their weight.
    """
    squared = sum(
        (place - at) ** 2 for place, at in zip(blocks.places, solution.parameters[CENTRE], strict=True)
    )
    x, y, weights = squared[known], solution.residual[known], 1.0 / noise[known]
    for _ in range(_ROUNDS_OF_WEIGHTS):
        curve = np.polynomial.Chebyshev.fit(x, y, _RADIAL_DEGREE, w=weights)
        apart = np.abs(y - curve(x)) / noise[known]
        spread = max(1.0, _NORMAL_MAD * float(np.median(apart)))
        weights = 1.0 / noise[known] / np.hypot(1.0, apart / (2.0 * spread))
    return np.asarray(curve(squared))


def _list_spots(solution: Solution, spots: NDArray[np.bool_], blocks: Blocks) -> tuple[Spot, ...]:
    fitted = solution.fitted
    return tuple(
        Spot(
            row_px=float(blocks.rows.means[row]),
            col_px=float(blocks.cols.means[col]),
            depth_rel=float(1.0 - blocks.light[row, col] / fitted[row, col]),
        )
        for row, col in np.argwhere(spots)
    )


def flag_frame(frame: str, quality: Quality) -> list[Raised]:
    where = f"frame {frame}"
    if quality.left_out:
        return [codes.FLAT_LEFT_OUT.at(where, f"{quality.left_out[:1].upper()}{quality.left_out[1:]}.")]
    flags = []
    if quality.signal_share < WEAK_SIGNAL_SHARE:
        detail = f"Its weakest channel has {quality.signal_share:.1%} of the span from black to white."
        flags.append(codes.WEAK_FLAT.at(where, detail))
    if quality.spots:
        flags.append(codes.DUST.at(where, describe_spots(quality.spots)))
    return flags


def describe_spots(spots: tuple[Spot, ...]) -> str:
    """Return how many spots there are, and where the deepest lie, in words."""
    deepest = sorted(spots, key=lambda spot: (-abs(spot.depth_rel), spot.row_px, spot.col_px))[:_MOST_NAMED]
    places = ", ".join(
        f"row {spot.row_px:.0f} column {spot.col_px:.0f} ({-spot.depth_rel:+.1%})" for spot in deepest
    )
    return f"Blocks that stand apart: {len(spots)}; {places}."


class Candidate(Record, kw_only=False):
    """Flat frame that may be used."""

    row: FrameRow  # Evidence of the frame
    light: FlatLight | None  # Light above dark; None without features
    quality: Quality | None  # Result of the inspection; None without features
    left_out: str  # "" if it counts, else the reason

    @property
    def channels(self) -> tuple[ChannelLight, ...]:
        """Light of every channel without the blocks of spots."""
        if self.light is None:
            return ()
        if self.quality is None or self.quality.spots_mask is None:
            return self.light.channels
        return tuple(leave_out(each, self.quality.spots_mask) for each in self.light.channels)


def missing(rows: Sequence[FrameRow], params: Params, *, unread: Sequence[str] = ()) -> tuple[str, ...]:
    excluded = {exclusion.frame for exclusion in params.exclude}
    flats = [row for row in rows if row.role == FLAT and row.frame not in excluded]
    waiting = [row.frame for row in rows if row.features is None and row.frame not in excluded]
    lacking: list[str] = [
        name_frames(what, group, finding)
        for group, what, finding in (
            (unread, "not read yet", shared.NOT_READ),
            (waiting, "not extracted yet", shared.NOT_EXTRACTED),
        )
        if group
    ]
    without = [row.frame for row in flats if row.exposure is None]
    if without:
        lacking.append(f"no exposure time, f-number and ISO: {name_few('frame', without)}")
    if not flats and not unread:
        lacking.append("no flat frame: photograph an even, format-filling surface at each f-number")
    return tuple(lacking)


def collect_candidates(rows: Sequence[FrameRow], params: Params) -> tuple[Candidate, ...]:
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
    """Check that all flat frames are of one lens: a falloff belongs to one."""
    lenses = {
        f"{header.lens_model or 'unnamed lens'} {header.lens_serial or ''}".strip()
        for header in (candidate.row.header for candidate in candidates if not candidate.left_out)
    }
    if len(lenses) > 1:
        raise codes.FLAT_UNUSABLE.reject(
            f"The flat frames are of several lenses: {', '.join(sorted(lenses))}. A falloff belongs to one "
            "lens: exclude the frames of the others."
        )


def describe_points(
    rows: Sequence[FrameRow], candidates: Sequence[Candidate], params: Params
) -> tuple[Point, ...]:
    """Return every flat and dark frame as it is stored, used or not."""
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
