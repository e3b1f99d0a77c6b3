"""One slanted edge in one channel: refused with the reason, or its whole response with uncertainties."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.sharpness import codes, results, sampling
from radiometry.sharpness.profile import (
    BINS_PER_PIXEL,
    NYQUIST_CYCLES_PER_PIXEL,
    Edge,
    Profile,
    compute_mtfs,
    find_crossing,
    form_profile,
    gather,
    list_frequencies,
    locate_edge,
    measure_lengths,
)

Vector = NDArray[np.float64]

MOST_CLIPPED_SHARE = 0.001
LEAST_CONTRAST = 0.2
MOST_NOISE_REL = 0.1
ANGLES_DEG = (2.0, 40.0)
FEWEST_LINES = 20
FEWEST_PERIODS = 2.0
LEAST_REACH_PX = 8.0

_BLOCKS = 8
JACKKNIFE_DOF = _BLOCKS - 1
_AROUND_CROSSING = np.array([0.8, 1.2])
_MOST_RESIDUAL_PX = 2.0
_WIDEST_GAP_PX = 0.45
_INNER = 0.9  # of the region: lines that every channel has


def measure_edge(
    plane: sampling.Plane, *, order: int, orientation: str, box: tuple[float, float, float, float]
) -> results.EdgeResponse:
    """Measure an edge that crosses the plane's lines.

    The uncertainties are a delete-one jackknife over eight blocks of neighbouring lines, u^2 = 7/8 sum (t_i
    - mean t)^2: they include the noise, and what differs along the edge. They do not include what all lines
    share: uneven light across the edge, a soft or ragged target. That of MTF50 is u(MTF) there over the mean
    slope between 0.8 and 1.2 MTF50: noise bends the curve at a crossing, and a jackknife of the crossing
    takes the slope of the bend.
    """
    contrast, noise_rel = _require_signal(plane)
    edge = locate_edge(plane, order=order)
    low_px, high_px = _require_edge(plane, edge)
    _require_phases(plane, edge)
    lines = _count_whole_periods(plane, edge)
    distance = plane.positions_px[:lines] - edge.curve(plane.line_px[:lines])[:, None]
    bins = 2 * int(plane.values.shape[1] * plane.pitch_px * BINS_PER_PIXEL / 2)
    parts = [
        gather(distance[block].ravel(), plane.values[:lines][block].ravel(), bins=bins)
        for block in np.array_split(np.arange(lines), _BLOCKS)
    ]
    whole = gather(distance.ravel(), plane.values[:lines].ravel(), bins=bins)
    sums = [whole, *(whole.without(part) for part in parts)]
    best, *left = _measure(
        [form_profile(each, slope=edge.slope, low_px=low_px, high_px=high_px) for each in sums]
    )
    spread = np.sqrt((_BLOCKS - 1) / _BLOCKS * np.sum((left - np.mean(left, axis=0)) ** 2, axis=0))
    spread[0] = _propagate_crossing(best[0], best[6:], spread[6:])
    figures = [_estimate(value, u) for value, u in zip(best[:6], spread[:6], strict=True)]
    span_px = float(plane.line_px[lines - 1] - plane.line_px[0]) + _line_step(plane)
    return results.EdgeResponse(
        channel=plane.channel,
        orientation=orientation,
        angle_deg=math.degrees(math.atan(abs(edge.slope))),
        lines=lines,
        periods=span_px * abs(edge.slope) / plane.pitch_px,
        departure_px=edge.departure_px,
        contrast=contrast,
        noise_rel=noise_rel,
        mtf=tuple(float(value) for value in best[6:]),
        mtf_u=tuple(float(value) for value in spread[6:]),
        mtf50=figures[0],
        mtf_nyquist=figures[1],
        rise_px=figures[2],
        lsf_fwhm_px=figures[3],
        overshoot=figures[4],
        undershoot=figures[5],
        place=_place(plane, edge, order=order, vertical=orientation == "vertical", box=box),
    )


def _place(
    plane: sampling.Plane, edge: Edge, *, order: int, vertical: bool, box: tuple[float, float, float, float]
) -> results.EdgePlace:
    """Return the mean of the curve over the lines of the box, less its middle, with its uncertainty."""
    first, last, low, high = box
    middle, half = (first + last) / 2.0, (last - first) / 2.0
    every = middle + half * _INNER * np.linspace(-1.0, 1.0, 2 * FEWEST_LINES + 1)
    mean = np.polynomial.polynomial.polyvander((every - middle) / half, order).mean(axis=0)
    basis = np.polynomial.polynomial.polyvander((plane.line_px - middle) / half, order)
    dof = plane.line_px.size - order - 1
    scale2 = edge.residual_px**2 * plane.line_px.size / dof
    cosine = 1.0 / math.hypot(1.0, edge.slope)
    normal = (cosine, -edge.slope * cosine)  # across the lines, and along them
    return results.EdgePlace(
        normal=normal[::-1] if vertical else normal,
        place_px=(float(edge.curve(every).mean()) - (low + high) / 2.0) * cosine,
        place_u_px=math.sqrt(scale2 * float(mean @ np.linalg.solve(basis.T @ basis, mean))) * cosine,
        dof=float(dof),
    )


def _measure(profiles: Sequence[Profile]) -> list[Vector]:
    """Return, per profile, MTF50, MTF at Nyquist, rise, width, over- and undershoot, then the whole MTF."""
    frequency = list_frequencies()
    found = []
    for profile, mtf in zip(profiles, compute_mtfs(profiles, frequency=frequency), strict=True):
        lengths = measure_lengths(profile)
        figures = (
            find_crossing(frequency, mtf, 0.5),
            np.interp(NYQUIST_CYCLES_PER_PIXEL, frequency, mtf),
            lengths.rise_px,
            lengths.lsf_fwhm_px,
            lengths.overshoot,
            lengths.undershoot,
        )
        found.append(np.array([*figures, *mtf]))
    return found


def _propagate_crossing(crossing: float, mtf: Vector, mtf_u: Vector) -> float:
    """Return the standard uncertainty of the frequency of a crossing; NaN where the curve does not fall."""
    frequency = list_frequencies()
    ends = np.clip(crossing * _AROUND_CROSSING, 0.0, frequency[-1])
    before, after = np.interp(ends, frequency, mtf)
    if not before > after:
        return math.nan
    return float(np.interp(crossing, frequency, mtf_u) * (ends[1] - ends[0]) / (before - after))


def _estimate(value: float, u: float) -> results.Estimate | None:
    """Return an estimate, or None where it or one of its parts does not exist."""
    if not (math.isfinite(value) and math.isfinite(u)):
        return None
    return results.Estimate(value=float(value), standard_uncertainty=float(u))


def _line_step(plane: sampling.Plane) -> float:
    return float(plane.line_px[-1] - plane.line_px[0]) / (plane.line_px.size - 1)


def _count_whole_periods(plane: sampling.Plane, edge: Edge) -> int:
    """Return how many lines contain whole passes of the edge over a sample: every phase equally often."""
    per_line = abs(edge.slope) * _line_step(plane) / plane.pitch_px
    return min(plane.line_px.size, round(math.floor(plane.line_px.size * per_line) / per_line))


def _require_signal(plane: sampling.Plane) -> tuple[float, float]:
    """Refuse what no edge can be found in; give the contrast, and the noise relative to the step."""
    lines, samples = plane.values.shape
    if lines < FEWEST_LINES or samples * plane.pitch_px < 2.0 * LEAST_REACH_PX + 4.0 or samples < 10:
        raise codes.EDGE_TOO_SHORT.reject(
            f"The region holds {lines} lines of {samples} samples of channel {plane.channel}: at least "
            f"{FEWEST_LINES} lines and {2.0 * LEAST_REACH_PX + 4.0:g} pixels across the edge are needed. "
            "Draw it larger."
        )
    if plane.clipped_share > MOST_CLIPPED_SHARE:
        raise codes.CHART_CLIPPED.reject(
            f"{plane.clipped_share:.2%} of channel {plane.channel} in the region is at white or at zero, "
            "more than "
            f"{MOST_CLIPPED_SHARE:.1%}: a clipped edge looks sharper than it is. Change the exposure."
        )
    side = max(3, samples // 5)
    ends = plane.values[:, :side], plane.values[:, -side:]
    low, high = sorted(float(end.mean()) for end in ends)
    contrast = (high - low) / (high + low) if high + low > 0.0 else 0.0
    if contrast < LEAST_CONTRAST:
        raise codes.CHART_CONTRAST_TOO_LOW.reject(
            f"Contrast {contrast:.1%} in channel {plane.channel}, less than {LEAST_CONTRAST:.0%}: the "
            "region shows no edge "
            "from one side to the other, or a faint one. Draw it so that the edge runs through its middle."
        )
    bends = [end[:, 2:] - 2.0 * end[:, 1:-1] + end[:, :-2] for end in ends]
    noise = math.sqrt(sum(float(np.mean(bend**2)) for bend in bends) / 12.0) / (high - low)
    if noise > MOST_NOISE_REL:
        raise codes.EDGE_TOO_NOISY.reject(
            f"A pixel's noise is {noise:.1%} of the edge's step in channel {plane.channel}, more than "
            f"{MOST_NOISE_REL:.0%}: "
            "take it at a lower ISO, with more light, or with a chart of more contrast."
        )
    return contrast, noise


def _require_edge(plane: sampling.Plane, edge: Edge) -> tuple[float, float]:
    """Refuse an edge that is none, lies badly or ends too soon; give the range that all lines reach [px]."""
    if edge.residual_px > _MOST_RESIDUAL_PX:
        raise codes.EDGE_NOT_FOUND.reject(
            f"Places of the edge scatter by {edge.residual_px:.1f} px about a smooth line: the region "
            "holds more than one "
            "edge, or none. Draw it about a single edge."
        )
    angle_deg = math.degrees(math.atan(abs(edge.slope)))
    if not ANGLES_DEG[0] <= angle_deg <= ANGLES_DEG[1]:
        raise codes.EDGE_ANGLE_UNSUITABLE.reject(
            f"The edge leans {angle_deg:.1f} degrees from the pixel rows or columns: between "
            f"{ANGLES_DEG[0]:g} and "
            f"{ANGLES_DEG[1]:g} are needed, 5 are best. Turn the chart or the camera."
        )
    places = edge.curve(plane.line_px)
    last_px = plane.first_px + plane.pitch_px * (plane.values.shape[1] - 1)
    low, high = float(np.max(plane.first_px - places)), float(np.min(last_px - places))
    if min(-low, high) < LEAST_REACH_PX:
        raise codes.EDGE_NOT_FOUND.reject(
            f"The edge comes within {min(-low, high):.1f} px of the region's side: it must keep "
            f"{LEAST_REACH_PX:g} px away "
            "on every line. Draw the region wider across the edge, or shorter along it."
        )
    periods = plane.line_px.size * _line_step(plane) * abs(edge.slope) / plane.pitch_px
    if periods < FEWEST_PERIODS:
        raise codes.EDGE_TOO_SHORT.reject(
            f"Along the region the edge moves by {periods:.1f} samples of channel {plane.channel}: "
            f"{FEWEST_PERIODS:g} are needed. Draw the region longer, or lean the edge more."
        )
    return low, high


def _require_phases(plane: sampling.Plane, edge: Edge) -> None:
    """Refuse an edge whose slope leaves places between the pixels unseen.

    A line sees the profile at one place of a sample's pitch; between the places of all lines no gap may be
    too wide for 1 cycle per pixel.
    """
    places = np.sort(np.mod(plane.first_px - edge.curve(plane.line_px), plane.pitch_px))
    gap_px = float(np.max(np.diff(places, append=places[0] + plane.pitch_px)))
    if gap_px > _WIDEST_GAP_PX:
        raise codes.EDGE_ANGLE_UNSUITABLE.reject(
            f"At a slope of {abs(edge.slope):.3f} the edge passes the samples of channel {plane.channel} at "
            f"the same places again and again: {gap_px:.2f} px between them stay unseen. Turn the chart by a "
            "degree or two, or draw the region longer."
        )
