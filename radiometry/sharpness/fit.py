"""Extraction of the regions of a frame, and the fit of a campaign: falloff, colour, flags, coefficients."""

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final, TypeVar

import numpy as np

from radiometry.findings import InputRejected, Raised, shared
from radiometry.fitting import evidence
from radiometry.fitting.evidence import CoefficientValue, Extracted, Quantity, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Window, bounding_window
from radiometry.frame.statistics import compute_statistics
from radiometry.sharpness import codes, results
from radiometry.sharpness.edges import measure_edge
from radiometry.sharpness.positions import (
    MTF50,
    RESOLVING_POWER,
    Candidate,
    collect_candidates,
    merge_estimates,
    merge_position,
    missing,
)
from radiometry.sharpness.sampling import LUMINANCE, Plane, Tone, average_sites, read_planes
from radiometry.sharpness.stars import guess_centre, measure_star, refine_centre

R = TypeVar("R")

_MAIN_CHANNELS = (LUMINANCE, "G", "grey")


def extract(
    frame: Frame,
    regions: Sequence[Region],
    *,
    header: FrameHeader,
    exposure: Exposure | None,  # noqa: ARG001  a chart needs none
    target: results.Target,
) -> Extracted[results.Features]:
    """Measure every region of a frame.

    A region is the box about its polygon: an edge must run from one side to the other. Channels that cannot
    be used are stored with the reason.
    """
    windows = [
        bounding_window(region.polygon, height_px=frame.height_px, width_px=frame.width_px)
        for region in regions
    ]
    tone = Tone(curve=target.tone_curve, gamma=target.gamma) if header.rendered else None
    inside = np.zeros(frame.samples_dn.shape[:2], np.bool_)
    found = []
    for region, window in zip(regions, windows, strict=True):
        found.append(_measure_region(frame, region, window, target=target, tone=tone))
        row0, col0 = window.row0 - frame.row0, window.col0 - frame.col0
        inside[row0 : row0 + window.height, col0 : col0 + window.width] = True
    if not any(each.edges or each.stars for each in found):
        raise _explain(found)
    features = results.Features(
        kind=target.kind,
        height_px=frame.height_px,
        width_px=frame.width_px,
        rendered=header.rendered,
        regions=tuple(found),
    )
    return Extracted(statistics=compute_statistics(frame, inside), features=features)


def _measure_region(
    frame: Frame, region: Region, window: Window, *, target: results.Target, tone: Tone | None
) -> results.RegionResponse:
    edges: list[results.EdgeResponse] = []
    stars: list[results.StarResponse] = []
    turned = target.kind == "slanted_edge" and _runs_along_rows(frame, window, tone)
    planes = read_planes(frame, window, tone=tone, transposed=turned)
    if target.kind == "slanted_edge":
        rows = (window.row0, window.row0 + window.height - 1.0)
        cols = (window.col0, window.col0 + window.width - 1.0)
        orientation, box = ("horizontal", (*cols, *rows)) if turned else ("vertical", (*rows, *cols))
        edge = partial(measure_edge, order=target.edge_order, orientation=orientation, box=box)
        refused = _try(edges, planes, edge)
    else:
        centre, radius_px = _find_star(frame, region, window, planes, target=target, tone=tone)
        star = partial(measure_star, cycles=target.cycles, centre=centre, radius_px=radius_px)
        refused = _try(stars, planes, star)
    return results.RegionResponse(
        name=region.name,
        row_px=window.row0 + (window.height - 1) / 2.0,
        col_px=window.col0 + (window.width - 1) / 2.0,
        edges=tuple(edges),
        stars=tuple(stars),
        refused=tuple(refused),
    )


def _try(found: list[R], planes: Sequence[Plane], measure: Callable[[Plane], R]) -> list[results.Refusal]:
    refused = []
    for plane in planes:
        try:
            found.append(measure(plane))
        except InputRejected as refusal:
            refused.append(
                results.Refusal(channel=plane.channel, code=str(refusal.code), message=refusal.message)
            )
    return refused


def _runs_along_rows(frame: Frame, window: Window, tone: Tone | None) -> bool:
    """Return True if the signal changes more from top to bottom than from left to right."""
    picture, _ = average_sites(frame, window, tone=tone)
    rows, cols = (max(1, size // 4) for size in picture.shape)
    down = abs(float(picture[:rows].mean() - picture[-rows:].mean()))
    across = abs(float(picture[:, :cols].mean() - picture[:, -cols:].mean()))
    return down > across


def _find_star(
    frame: Frame,
    region: Region,
    window: Window,
    planes: Sequence[Plane],
    *,
    target: results.Target,
    tone: Tone | None,
) -> tuple[tuple[float, float], float]:
    """Return a star's centre, (row, col) indices, and the radius [px] of the largest ring in its window."""
    given = {each.region: (each.y_px - 0.5, each.x_px - 0.5) for each in target.centres}
    if region.name in given:
        centre = given[region.name]
        return centre, _room(centre, window)
    picture, pitch_px = average_sites(frame, window, tone=tone)
    row, col = guess_centre(picture)
    inset = (pitch_px - 1.0) / 2.0
    first = (window.row0 + inset + pitch_px * row, window.col0 + inset + pitch_px * col)
    main = next(plane for name in _MAIN_CHANNELS for plane in planes if plane.channel == name)
    centre = refine_centre(main, start=first, cycles=target.cycles, radius_px=_room(first, window))
    return centre, _room(centre, window)


def _room(centre: tuple[float, float], window: Window) -> float:
    """Return the radius of the largest circle in a window."""
    row, col = centre[0] - window.row0, centre[1] - window.col0
    return max(1.0, min(row, col, window.height - 1 - row, window.width - 1 - col))


def _explain(found: Sequence[results.RegionResponse]) -> InputRejected:
    first = next(refusal for region in found for refusal in region.refused)
    where = f"Region {found[0].name}: " if found[0].name else ""
    entry = next(each for each in (*codes.FINDINGS, *shared.FINDINGS) if each == first.code)
    return entry.reject(f"{where}{first.message}")


CENTRE_RADIUS_REL = 0.25
CORNER_RADIUS_REL = 0.6


def compare_positions(positions: Sequence[results.PositionFit]) -> tuple[results.FalloffTable, ...]:
    """Compute the falloff of every channel and f-number that has a position in the middle and one elsewhere.

    ratio = m / m_c, m_c the mean over positions within a quarter of the half diagonal; the corner's is the
    mean over positions beyond 0.6 of it. Uncertainties of different positions are taken as independent: the
    focus, which positions of one frame share, is in the repeatability of each.
    """

    def group_of(each: results.PositionFit) -> tuple[str, str, float]:
        return each.kind, each.channel, each.f_number or 0.0

    tables = []
    for _, found in itertools.groupby(sorted(positions, key=group_of), key=group_of):
        table = _compare(list(found))
        if table is not None:
            tables.append(table)
    return tuple(tables)


def _compare(positions: Sequence[results.PositionFit]) -> results.FalloffTable | None:
    figure = MTF50 if positions[0].kind == "slanted_edge" else RESOLVING_POWER
    measured = [
        (each, coefficient)
        for each in sorted(positions, key=lambda one: (one.radius_rel, one.position))
        if (coefficient := each.find(figure)) is not None
    ]
    centre = [pair for pair in measured if pair[0].radius_rel <= CENTRE_RADIUS_REL]
    others = [pair for pair in measured if pair[0].radius_rel > CENTRE_RADIUS_REL]
    corners = [pair for pair in others if pair[0].radius_rel >= CORNER_RADIUS_REL]
    if not centre or not others:
        return None
    middle = _average([coefficient.quantity for _, coefficient in centre])
    corner_falloff = dof = None
    if corners:
        ratio = _divide(_average([coefficient.quantity for _, coefficient in corners]), middle)
        corner_falloff = Quantity(1.0 - ratio.value, ratio.standard_uncertainty, "1")
        dof = _find_dof(centre, corners)
    return results.FalloffTable(
        kind=positions[0].kind,
        channel=positions[0].channel,
        f_number=positions[0].f_number,
        figure=figure,
        centre=tuple(each.position for each, _ in centre),
        corners=tuple(each.position for each, _ in corners),
        rows=tuple(
            results.Falloff(
                position=each.position,
                radius_rel=each.radius_rel,
                ratio=_divide(coefficient.quantity, middle),
            )
            for each, coefficient in others
        ),
        corner_falloff=corner_falloff,
        corner_falloff_dof=dof,
    )


def _find_dof(*groups: Sequence[tuple[results.PositionFit, results.Coefficient]]) -> float:
    """Compute the effective degrees of freedom of a ratio of means (Welch and Satterthwaite)."""
    variance = restless = 0.0
    for group in groups:
        total = math.fsum(each.quantity.value for _, each in group)
        for _, each in group:
            part = (each.quantity.standard_uncertainty / total) ** 2
            variance += part
            restless += part**2 / (each.effective_dof or evidence.MOST_DOF)
    return min(evidence.MOST_DOF, variance**2 / restless) if restless else evidence.MOST_DOF


def _average(quantities: Sequence[Quantity]) -> Quantity:
    count = len(quantities)
    return Quantity(
        math.fsum(each.value for each in quantities) / count,
        math.sqrt(math.fsum(each.standard_uncertainty**2 for each in quantities)) / count,
        quantities[0].unit,
    )


def _divide(upper: Quantity, lower: Quantity) -> Quantity:
    ratio = upper.value / lower.value
    u_rel = math.hypot(upper.standard_uncertainty / upper.value, lower.standard_uncertainty / lower.value)
    return Quantity(ratio, ratio * u_rel, "1")


LATERAL_COLOUR: Final = "lateral_colour_px"
_REFERENCE: Final = "G"
_COLOURS: Final = ("R", "B")
_LEAST_COSINE: Final = 0.5
_LEAST_RADIUS_REL: Final = 0.1


def measure_colours(candidates: Sequence[Candidate]) -> tuple[results.EdgeColour, ...]:
    """Compare the places of every position's edge in red and blue with that in green.

    With p the mean place of the edge along its normal n, over the same lines in every colour, and r the
    vector from the middle of the frame::

        shift = (p_colour - p_G) sign(n r),   radial = shift |r| / |n r|

    A displacement that all positions share, such as a tilted window before the sensor makes, is in both. u of
    one frame is that of the mean of the polynomials through the centroids of the lines, of repeats as for the
    other coefficients.
    """
    shown = [
        each for each in candidates if isinstance(each.response, results.EdgeResponse) and each.response.place
    ]
    found = []
    for (position, f_number), group in itertools.groupby(
        sorted(shown, key=lambda each: (each.region.name, each.f_number or 0.0, each.frame)),
        key=lambda each: (each.region.name, each.f_number or 0.0),
    ):
        mine = {(each.frame, each.channel): each for each in group}
        for colour in _COLOURS:
            pairs = [
                (each, mine[frame, _REFERENCE])
                for (frame, channel), each in mine.items()
                if channel == colour and (frame, _REFERENCE) in mine
            ]
            if pairs:
                found.append(_compare_colours(pairs, f"{colour}-{_REFERENCE}", position, f_number or None))
    return tuple(found)


def _compare_colours(
    pairs: Sequence[tuple[Candidate, Candidate]], channels: str, position: str, f_number: float | None
) -> results.EdgeColour:
    features, region = pairs[0][1].features, pairs[0][1].region
    half = np.array([features.height_px - 1.0, features.width_px - 1.0]) / 2.0
    away = np.array([region.row_px, region.col_px]) - half
    shifts, along, dof = [], [], evidence.MOST_DOF
    for one, other in pairs:
        assert isinstance(one.response, results.EdgeResponse)  # noqa: S101  narrows the type
        assert isinstance(other.response, results.EdgeResponse)  # noqa: S101
        first, second = one.response.place, other.response.place
        assert first is not None  # noqa: S101
        assert second is not None  # noqa: S101
        towards = float(np.array(second.normal) @ away)
        shifts.append(
            results.Estimate(
                value=math.copysign(1.0, towards) * (first.place_px - second.place_px),
                standard_uncertainty=math.hypot(first.place_u_px, second.place_u_px),
            )
        )
        along.append(abs(towards))
        dof = min(dof, first.dof, second.dof)
    value, u, _, freedom = merge_estimates(shifts, dof=dof)
    radius = float(np.hypot(*away))
    cosine = float(np.mean(along)) / radius if radius else 0.0
    near = radius < _LEAST_RADIUS_REL * float(np.hypot(*half))
    return results.EdgeColour(
        channels=channels,
        position=position,
        f_number=f_number,
        radius_px=radius,
        radius_rel=radius / float(np.hypot(*half)),
        shift=Quantity(value, u, "px"),
        radial=None if near or cosine < _LEAST_COSINE else Quantity(value / cosine, u / cosine, "px"),
        frames=len(pairs),
        effective_dof=min(freedom, evidence.MOST_DOF),
    )


LARGEST_OVERSHOOT = 0.05
LARGEST_DEPARTURE_PX = 0.25
SCATTER_RATIO = 4.0
LARGEST_COLOUR_PX = 1.0
_OVERSHOOT_ERRORS = 3.0


def name_position(name: str) -> str:
    """Return the place to which a flag applies."""
    return f"position {name}" if name else ""


def check_positions(positions: Sequence[results.PositionFit]) -> list[Raised]:
    raised: list[Raised] = []
    for each in positions:
        where = name_position(each.position)
        if each.frames == 1:
            raised.append(codes.SHARPNESS_ONCE.at(where, f"Channel {each.channel}: one frame."))
        halo = each.find("overshoot")
        if halo is not None:
            sure = halo.quantity.value - _OVERSHOOT_ERRORS * halo.quantity.standard_uncertainty
            if sure > LARGEST_OVERSHOOT:
                detail = f"Channel {each.channel}: {halo.quantity.value:.1%} of the step."
                raised.append(codes.SHARPENING_SUSPECTED.at(where, detail))
        if each.departure_px is not None and each.departure_px > LARGEST_DEPARTURE_PX:
            detail = f"Channel {each.channel}: {each.departure_px:.2f} px off a straight line."
            raised.append(codes.EDGE_CURVED.at(where, detail))
        main = "mtf50_cycles_per_pixel" if each.cycles is None else "resolving_power_cycles_per_pixel"
        if each.find(main) is None:
            detail = f"Channel {each.channel}: the response stays above the level."
            raised.append(codes.SHARPNESS_BEYOND_CURVE.at(where, detail))
    return raised


def check_candidates(candidates: Sequence[Candidate], params: results.Params) -> list[Raised]:
    raised: list[Raised] = []
    rendered = sorted({each.frame for each in candidates if each.features.rendered and not each.left_out})
    if rendered:
        raised.append(shared.RENDERED.at("", f"Rendered frames: {len(rendered)}."))
    for each in candidates:
        if each.response is None:
            detail = f"Region {each.region.name}, channel {each.channel}: {each.left_out}"
            raised.append(codes.REGION_LEFT_OUT.at(f"frame {each.frame}", detail))
    for key in sorted({each.key for each in candidates if not each.left_out}):
        raised += _check_repeats(
            [each for each in candidates if each.key == key and not each.left_out], params
        )
    return raised


def _check_repeats(repeats: Sequence[Candidate], params: results.Params) -> list[Raised]:
    """Compare the range of repeats with what their own uncertainties allow."""
    found = [estimate for each in repeats if (estimate := each.measure(params)) is not None]
    if len(found) < 2:
        return []
    values = [each.value for each in found]
    u = max(each.standard_uncertainty for each in found)
    mean = sum(values) / len(values)
    scatter = (sum((value - mean) ** 2 for value in values) / (len(values) - 1)) ** 0.5
    if scatter <= SCATTER_RATIO * u or scatter <= 0.02 * mean:
        return []
    detail = f"Channel {repeats[0].channel}: from {min(values):.3f} to {max(values):.3f} cycles per pixel."
    return [codes.SHARPNESS_REPEATS_DIFFER.at(name_position(repeats[0].region.name), detail)]


def check_falloff(
    positions: Sequence[results.PositionFit], tables: Sequence[results.FalloffTable]
) -> list[Raised]:
    """Check whether there are several positions and no middle to compare with."""
    if tables or len({each.position for each in positions}) < 2:
        return []
    detail = f"No position lies within {CENTRE_RADIUS_REL:g} of the half diagonal."
    return [codes.SHARPNESS_CENTRE_MISSING.at("", detail)]


def check_colours(colours: Sequence[results.EdgeColour]) -> list[Raised]:
    """Check how far red and blue lie from green."""
    return [
        shared.LATERAL_COLOUR_LARGE.at(
            name_position(each.position),
            f"{each.channels} is {each.shift.value:+.2f} px along the edge's normal, {each.radius_px:.0f} px "
            f"from the middle of the frame (u {each.shift.standard_uncertainty:.2f} px).",
        )
        for each in colours
        if abs(each.shift.value) - 2.0 * each.shift.standard_uncertainty > LARGEST_COLOUR_PX
    ]


def fit(rows: Sequence[results.FrameRow], params: results.Params) -> results.Fit:
    """Merge the frames of every position, and compare the positions.

    The same input in any order gives the same result to the last bit.
    """
    evidence.require_complete(missing(rows, params))
    candidates = collect_candidates(rows, params)
    used = [each for each in candidates if not each.left_out]
    if not used:
        raise shared.FIT_INCOMPLETE.reject("No edge or star of the chart frames can be used.")
    colours = measure_colours(used)
    positions = tuple(
        merge_position(list(group), params) for _, group in itertools.groupby(used, key=lambda each: each.key)
    )
    falloff = compare_positions(positions)
    return results.Fit(
        positions=positions,
        falloff=falloff,
        points=tuple(_describe_point(each, positions, params) for each in candidates),
        flags=(
            *check_candidates(candidates, params),
            *check_positions(positions),
            *check_falloff(positions, falloff),
            *check_colours(colours),
        ),
        lateral_colour=colours or None,
    )


def list_coefficients(fitted: results.Fit) -> tuple[CoefficientValue, ...]:
    def state(
        name: str,
        quantity: Quantity,
        of: results.PositionFit | results.EdgeColour | results.FalloffTable,
        channel: str,
        dof: float | None,
    ) -> CoefficientValue:
        place = "" if isinstance(of, results.FalloffTable) else of.position
        kind = "slanted_edge" if isinstance(of, results.EdgeColour) else of.kind
        return CoefficientValue(
            name=name,
            value=quantity.value,
            standard_uncertainty=quantity.standard_uncertainty,
            unit=quantity.unit,
            model=f"{kind}:{place}" if place else kind,
            f_number=of.f_number,
            channel=channel,
            flags=_flags_at(fitted, name_position(place)),
            effective_dof=dof,
        )

    return (
        *(
            state(each.name, each.quantity, of, of.channel, each.effective_dof)
            for of in fitted.positions
            for each in of.coefficients
        ),
        *(
            state(LATERAL_COLOUR, of.radial, of, of.channels, of.effective_dof)
            for of in fitted.lateral_colour or ()
            if of.radial is not None
        ),
        *(
            state("corner_falloff", of.corner_falloff, of, of.channel, of.corner_falloff_dof)
            for of in fitted.falloff
            if of.corner_falloff is not None
        ),
    )


def _flags_at(fitted: results.Fit, where: str) -> tuple[str, ...]:
    return tuple(sorted({raised.flag for raised in fitted.flags if raised.where in ("", where)}))


def _describe_point(
    candidate: Candidate, positions: Sequence[results.PositionFit], params: results.Params
) -> results.Point:
    """Return one channel of one region with its distance from its position's mean."""
    estimate = candidate.measure(params)
    residual = None
    if estimate is not None and not candidate.left_out:
        at = next(each for each in positions if _key(each) == candidate.key)
        mean = at.find(candidate.figure)
        residual = None if mean is None else estimate.value / mean.quantity.value - 1.0
    return results.Point(
        frame=candidate.frame,
        position=candidate.region.name,
        channel=candidate.channel,
        f_number=candidate.f_number,
        used=not candidate.left_out,
        left_out=candidate.left_out,
        figure=candidate.figure,
        value=None if estimate is None else estimate.value,
        standard_uncertainty=None if estimate is None else estimate.standard_uncertainty,
        residual_rel=residual,
    )


def _key(position: results.PositionFit) -> tuple[str, str, str, float]:
    return position.kind, position.position, position.channel, position.f_number or 0.0
