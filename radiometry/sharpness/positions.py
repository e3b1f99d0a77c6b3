"""Responses of a campaign: which are used, which are left out, and the frames of one position as one."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from radiometry.findings import grouping, shared
from radiometry.fitting import evidence
from radiometry.fitting.curve import coverage_factor, find_dof
from radiometry.records import Record
from radiometry.sharpness import profile, results
from radiometry.sharpness.edges import JACKKNIFE_DOF

SMALL_FORMAT_HEIGHT_MM = 24.0

_NEIGHBOURS = 3
_LEAST_CONTRAST = 1e-4


class Resolution(Record):
    """One frequency in every unit."""

    cycles_per_pixel: float  # Frequency [cycles per pixel]
    lp_per_mm: float | None  # Line pairs per millimetre on the sensor itself; None without its pitch
    lp_per_ph: float  # Line pairs, and line widths, per picture height
    lw_per_ph: float
    lp_per_mm_small_format: float  # Line pairs per millimetre on a picture enlarged to 24 mm height


def convert_resolution(
    cycles_per_pixel: float, *, picture_height_px: int, pixel_pitch_um: float | None = None
) -> Resolution:
    """Compute a frequency in line pairs and line widths.

    lp/mm = f / p,   LP/PH = f N,   LW/PH = 2 f N,   small format: f N / 24 mm

    A line pair is one cycle, a line WIDTH half of one. Equation 3 of the source multiplies by 2, divides
    by 24 mm and calls the result lp/mm: it is line widths per millimetre of a 24 mm picture. Its 26.1 for
    N = 1024 is 0.3059 cycles per pixel and 13.05 lp/mm.
    """
    pairs = cycles_per_pixel * picture_height_px
    return Resolution(
        cycles_per_pixel=cycles_per_pixel,
        lp_per_mm=None if pixel_pitch_um is None else cycles_per_pixel / pixel_pitch_um * 1000.0,
        lp_per_ph=pairs,
        lw_per_ph=2.0 * pairs,
        lp_per_mm_small_format=pairs / SMALL_FORMAT_HEIGHT_MM,
    )


def unresolved_diameter(resolving_power: float, *, cycles: int) -> float:
    """Compute the diameter of the disc in which a star is not resolved, d = n / (pi RP) [px].

    The source calls d the distance from the centre to the unresolved circle's edge; with that radius its
    equation 2 gives twice the resolving power. 48 cycles and 0.5 cycles per pixel: 30.56 px across.
    """
    return cycles / (math.pi * resolving_power)


def find_resolving_power(
    frequency: tuple[float, ...], curve: results.Contrasts, *, contrast: float
) -> results.Estimate | None:
    """Find the frequency at which a star's contrast first falls below a level.

    Between the last ring above the level and the first below, ln(contrast) is interpolated over f^2, where
    a Gaussian blur is a straight line. The difference from a straight line in contrast over f is the
    standard uncertainty of the model; that of the rings is u(contrast at the root) / |slope|, with the mean
    slope over three rings on either side, since noise chooses the steepest pair to cross. Neighbouring rings
    share most of their samples: their noise adds.
    """
    values, u = np.array(curve.contrast), np.array(curve.contrast_u)
    below = np.flatnonzero(values < contrast)
    if not below.size or below[0] == 0:
        return None
    pair = slice(int(below[0]) - 1, int(below[0]) + 1)
    f, ring_u = np.array(frequency)[pair], u[pair]
    # a contrast within its noise has no logarithm of meaning
    logs = np.log(np.maximum(values[pair], np.maximum(ring_u, _LEAST_CONTRAST)))
    line, curved = (
        float((start - level) / (start - end))
        for start, end, level in ((*values[pair], contrast), (*logs, math.log(contrast)))
    )
    root = math.sqrt(f[0] ** 2 + min(curved, 1.0) * (f[1] ** 2 - f[0] ** 2))
    straight = f[0] + line * (f[1] - f[0])
    around = slice(max(0, pair.stop - 1 - _NEIGHBOURS), pair.stop - 1 + _NEIGHBOURS)
    fall = values[around][0] - values[around][-1]
    span = np.array(frequency)[around][-1] - np.array(frequency)[around][0]
    if fall <= 0.0:
        fall, span = values[pair][0] - values[pair][1], f[1] - f[0]
    noise_u = ((1.0 - line) * ring_u[0] + line * ring_u[1]) * span / fall
    return results.Estimate(value=root, standard_uncertainty=math.hypot(float(noise_u), straight - root))


MTF50 = "mtf50_cycles_per_pixel"
RESOLVING_POWER = "resolving_power_cycles_per_pixel"


Key = tuple[str, str, str, float]


class Candidate(Record):
    """One channel of one region of one frame."""

    frame: str
    features: results.Features
    region: results.RegionResponse  # Responses of the region
    channel: str
    f_number: float | None
    response: (
        results.EdgeResponse | results.StarResponse | None
    )  # Response of the channel; None if the channel was refused
    left_out: str  # "" if it counts, else the reason

    @property
    def kind(self) -> str:
        return self.features.kind

    @property
    def key(self) -> Key:
        """Key that repeats of one another share."""
        return self.kind, self.region.name, self.channel, self.f_number or 0.0

    @property
    def figure(self) -> str:
        """Name of the coefficient that is compared between frames and positions."""
        return MTF50 if self.kind == "slanted_edge" else RESOLVING_POWER

    def measure(self, params: results.Params) -> results.Estimate | None:
        """Return the coefficient that is compared between frames and positions."""
        match self.response:
            case results.EdgeResponse():
                return self.response.mtf50
            case results.StarResponse():
                return find_resolving_power(
                    self.response.frequency, self.response.whole, contrast=params.star_contrast
                )
            case _:
                return None


def collect_candidates(rows: Sequence[results.FrameRow], params: results.Params) -> tuple[Candidate, ...]:
    excluded = {exclusion.frame: exclusion for exclusion in params.exclude}
    found = []
    for row in rows:
        if row.features is None:
            continue
        exclusion = excluded.get(row.frame)
        left_out = f"excluded by {exclusion.by}: {exclusion.reason}" if exclusion else ""
        f_number = row.exposure.f_number if row.exposure is not None else None
        for region in row.features.regions:
            responses: tuple[results.EdgeResponse | results.StarResponse, ...] = (
                *region.edges,
                *region.stars,
            )
            outcomes = [
                *((each.channel, each, left_out) for each in responses),
                *((each.channel, None, left_out or each.message) for each in region.refused),
            ]
            found += [
                Candidate(
                    frame=row.frame,
                    features=row.features,
                    region=region,
                    channel=channel,
                    f_number=f_number,
                    response=response,
                    left_out=reason,
                )
                for channel, response, reason in outcomes
            ]
    return tuple(sorted(found, key=lambda each: (each.key, each.frame)))


def missing(
    rows: Sequence[results.FrameRow], params: results.Params, *, unread: Sequence[str] = ()
) -> tuple[str, ...]:
    excluded = {exclusion.frame for exclusion in params.exclude}
    wanted = [row for row in rows if row.role == "chart" and row.frame not in excluded]
    found = []
    if not wanted and not unread:
        found.append("no chart frame that can be used: photograph edges or stars in role chart")
    if unread:
        found.append(grouping.name_frames("not read yet", unread, shared.NOT_READ))
    undrawn = [row.frame for row in wanted if row.features is None and not row.has_region]
    waiting = [row.frame for row in wanted if row.features is None and row.has_region]
    if undrawn:
        found.append(grouping.name_frames("no region", undrawn, shared.NO_REGION))
    if waiting:
        found.append(grouping.name_frames("not extracted yet", waiting, shared.NOT_EXTRACTED))
    return tuple(found)


_CYCLES_PER_PIXEL = "cycles/px"


def merge_position(candidates: Sequence[Candidate], params: results.Params) -> results.PositionFit:
    """Return the result of one channel of one position from the frames that count."""
    first = candidates[0]
    edges = [each.response for each in candidates if isinstance(each.response, results.EdgeResponse)]
    stars = [each.response for each in candidates if isinstance(each.response, results.StarResponse)]
    height, width = first.features.height_px, first.features.width_px
    row = float(np.mean([each.region.row_px for each in candidates]))
    col = float(np.mean([each.region.col_px for each in candidates]))
    away = math.hypot(row + 0.5 - height / 2.0, col + 0.5 - width / 2.0)
    coefficients = _merge_edges(edges) if edges else _merge_stars(stars, params)
    return results.PositionFit(
        kind=first.kind,
        position=first.region.name,
        channel=first.channel,
        f_number=first.f_number,
        row_px=row,
        col_px=col,
        radius_rel=away / (math.hypot(height, width) / 2.0),
        frames=len(candidates),
        orientation=edges[0].orientation if edges else None,
        angle_deg=float(np.mean([edge.angle_deg for edge in edges])) if edges else None,
        departure_px=max(edge.departure_px for edge in edges) if edges else None,
        cycles=stars[0].cycles if stars else None,
        coefficients=(*coefficients, *_convert(coefficients, min(height, width), params)),
        curves=_merge_curves(edges, stars),
        directions=_merge_directions(stars, params),
    )


def merge_estimates(
    estimates: Sequence[results.Estimate], *, dof: float = math.inf
) -> tuple[float, float, float | None, float]:
    """Compute mean, its standard uncertainty, the standard deviation s of one frame, and degrees of freedom.

    u^2 = max(s^2, mean u_i^2) / n: the larger of the observed scatter and the one that noise predicts, the
    latter with n times the degrees of freedom of one frame.
    """
    values = np.array([each.value for each in estimates])
    predicted = float(np.mean([each.standard_uncertainty**2 for each in estimates]))
    if values.size == 1:
        return float(values[0]), math.sqrt(predicted), None, dof
    seen = float(values.var(ddof=1))
    u, freedom = _merge_variances(seen, predicted, values.size, dof=values.size * dof)
    return float(values.mean()), u, math.sqrt(seen), freedom


_LEVEL, _LEVEL_OF_TWO = 0.60, 0.35
_KNOWN_DOF = 1e9


def _merge_variances(observed: float, predicted: float, count: int, *, dof: float) -> tuple[float, float]:
    """Compute the standard uncertainty of a mean, and degrees of freedom that give it its expanded one.

    How much sharpness scatters is not expected by anything but noise: the observed variance counts where it
    exceeds a quantile of that of noise.
    """
    u = math.sqrt(max(observed, predicted) / count)
    level = _LEVEL_OF_TWO if count == 2 else _LEVEL
    known = min(dof, _KNOWN_DOF)
    if u == 0.0 or observed <= predicted * float(scipy.special.fdtri(count - 1, known, level)):
        return u, dof
    by_noise, by_scatter = (
        coverage_factor(freedom) * math.sqrt(variance / count)
        for freedom, variance in ((known, predicted), (count - 1.0, observed))
    )
    if by_noise >= by_scatter:
        return u, dof
    return u, find_dof(by_scatter / u)


def _coefficient(
    name: str, unit: str, estimates: Sequence[results.Estimate | None], *, dof: float = math.inf
) -> list[results.Coefficient]:
    """Return the coefficient, or none where a frame lacks it."""
    present = [each for each in estimates if each is not None]
    if not present or len(present) < len(estimates):
        return []
    value, u, repeatability, freedom = merge_estimates(present, dof=dof)
    quantity = evidence.Quantity(value, u, unit)
    dof = min(freedom, evidence.MOST_DOF)
    return [results.Coefficient(name=name, quantity=quantity, repeatability=repeatability, effective_dof=dof)]


def _merge_edges(edges: Sequence[results.EdgeResponse]) -> list[results.Coefficient]:
    parts = (
        (MTF50, _CYCLES_PER_PIXEL, [edge.mtf50 for edge in edges]),
        ("edge_rise_10_90_px", "px", [edge.rise_px for edge in edges]),
        ("lsf_fwhm_px", "px", [edge.lsf_fwhm_px for edge in edges]),
        ("mtf_nyquist", "1", [edge.mtf_nyquist for edge in edges]),
        ("overshoot", "1", [edge.overshoot for edge in edges]),
        ("undershoot", "1", [edge.undershoot for edge in edges]),
    )
    return [found for part in parts for found in _coefficient(*part, dof=JACKKNIFE_DOF)]


def _merge_stars(stars: Sequence[results.StarResponse], params: results.Params) -> list[results.Coefficient]:
    powers = [
        find_resolving_power(star.frequency, star.whole, contrast=params.star_contrast) for star in stars
    ]
    halves = [find_resolving_power(star.frequency, star.whole, contrast=0.5) for star in stars]
    found = _coefficient(RESOLVING_POWER, _CYCLES_PER_PIXEL, powers)
    diameter = []
    for power in found:
        across_px = unresolved_diameter(power.quantity.value, cycles=stars[0].cycles)
        u = across_px * power.quantity.standard_uncertainty / power.quantity.value
        quantity = evidence.Quantity(across_px, u, "px")
        diameter.append(replace(power, name="unresolved_diameter_px", quantity=quantity, repeatability=None))
    return [*found, *diameter, *_coefficient(MTF50, _CYCLES_PER_PIXEL, halves)]


def _convert(
    found: Sequence[results.Coefficient], picture_height_px: int, params: results.Params
) -> list[results.Coefficient]:
    """Return the frequencies in line pairs and line widths too."""
    more = []
    for each in found:
        if each.name not in (MTF50, RESOLVING_POWER):
            continue
        one = convert_resolution(
            1.0, picture_height_px=picture_height_px, pixel_pitch_um=params.pixel_pitch_um
        )
        stem = each.name.removesuffix("_cycles_per_pixel")
        for suffix, unit, factor in (
            ("lp_per_mm", "lp/mm", one.lp_per_mm),
            ("lp_per_ph", "LP/PH", one.lp_per_ph),
            ("lw_per_ph", "LW/PH", one.lw_per_ph),
        ):
            if factor is not None:
                more.append(_scale(each, f"{stem}_{suffix}", unit, factor))
    return more


def _scale(coefficient: results.Coefficient, name: str, unit: str, factor: float) -> results.Coefficient:
    old = coefficient.quantity
    scatter = coefficient.repeatability
    return replace(
        coefficient,
        name=name,
        quantity=evidence.Quantity(old.value * factor, old.standard_uncertainty * factor, unit),
        repeatability=None if scatter is None else scatter * factor,
    )


def _merge_curves(
    edges: Sequence[results.EdgeResponse], stars: Sequence[results.StarResponse]
) -> tuple[results.Curve, ...]:
    if edges:
        frequency = tuple(float(each) for each in profile.list_frequencies())
        return (_merge_curve(None, frequency, [(edge.mtf, edge.mtf_u) for edge in edges]),)
    # rings of several frames differ: what they share is the frequency range of the first, read off by lines
    frequency = stars[0].frequency
    groups = zip(*((star.whole, *star.sectors) for star in stars), strict=True)
    return tuple(
        _merge_curve(
            group[0].direction_deg,
            frequency,
            [_resample(frequency, star, curve) for star, curve in zip(stars, group, strict=True)],
        )
        for group in groups
    )


def _resample(
    frequency: tuple[float, ...], star: results.StarResponse, curve: results.Contrasts
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    contrast = np.interp(frequency, star.frequency, curve.contrast)
    u = np.interp(frequency, star.frequency, curve.contrast_u)
    return tuple(float(each) for each in contrast), tuple(float(each) for each in u)


def _merge_curve(
    direction_deg: float | None,
    frequency: tuple[float, ...],
    pairs: Sequence[tuple[tuple[float, ...], tuple[float, ...]]],
) -> results.Curve:
    merged = [
        merge_estimates([results.Estimate(value=value[k], standard_uncertainty=u[k]) for value, u in pairs])
        for k in range(len(frequency))
    ]
    return results.Curve(
        direction_deg=direction_deg,
        frequency=frequency,
        response=tuple(each[0] for each in merged),
        response_u=tuple(each[1] for each in merged),
    )


def _merge_directions(
    stars: Sequence[results.StarResponse], params: results.Params
) -> tuple[results.Direction, ...]:
    found = []
    for curves in zip(*(star.sectors for star in stars), strict=True):
        powers = [
            find_resolving_power(star.frequency, curve, contrast=params.star_contrast)
            for star, curve in zip(stars, curves, strict=True)
        ]
        merged = _coefficient(RESOLVING_POWER, _CYCLES_PER_PIXEL, powers)
        found.append(
            results.Direction(
                direction_deg=float(curves[0].direction_deg or 0.0),
                resolving_power=merged[0].quantity if merged else None,
            )
        )
    return tuple(found)
