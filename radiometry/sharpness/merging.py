"""Merging of the frames of one position into one result."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.fitting.repeats import merge_variances
from radiometry.sharpness.candidates import MTF50, RESOLVING_POWER, Candidate
from radiometry.sharpness.edges import JACKKNIFE_DOF
from radiometry.sharpness.features import Contrasts, EdgeResponse, Estimate, StarResponse
from radiometry.sharpness.resolution import convert_resolution, find_resolving_power, unresolved_diameter
from radiometry.sharpness.results import Coefficient, Curve, Direction, PositionFit
from radiometry.sharpness.rows import Params
from radiometry.sharpness.spectrum import list_frequencies

_CYCLES_PER_PIXEL = "cycles/px"


def merge_position(candidates: Sequence[Candidate], params: Params) -> PositionFit:
    """Return the result of one channel of one position from the frames that count.

    Parameters
    ----------
    candidates : sequence of Candidate
        Responses that count, at least one.
    params : Params
        Parameters of the fit.
    """
    first = candidates[0]
    edges = [each.response for each in candidates if isinstance(each.response, EdgeResponse)]
    stars = [each.response for each in candidates if isinstance(each.response, StarResponse)]
    height, width = first.features.height_px, first.features.width_px
    row = float(np.mean([each.region.row_px for each in candidates]))
    col = float(np.mean([each.region.col_px for each in candidates]))
    away = math.hypot(row + 0.5 - height / 2.0, col + 0.5 - width / 2.0)
    coefficients = _merge_edges(edges) if edges else _merge_stars(stars, params)
    return PositionFit(
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
    estimates: Sequence[Estimate], *, dof: float = math.inf
) -> tuple[float, float, float | None, float]:
    """Compute mean, its standard uncertainty, the standard deviation s of one frame, and degrees of freedom.

    Parameters
    ----------
    estimates : sequence of Estimate
        Estimate of each frame.
    dof : float, default: inf
        Degrees of freedom of the uncertainty of each.

    Returns
    -------
    tuple of (float, float, float or None, float)
        Mean, standard uncertainty, s (None for one frame), and degrees of freedom of the uncertainty.

    Notes
    -----
    u^2 = max(s^2, mean u_i^2) / n: the larger of the observed scatter and the one that noise predicts, the
    latter with n times the degrees of freedom of one frame. See `repeats.merge_variances`.
    """
    values = np.array([each.value for each in estimates])
    predicted = float(np.mean([each.standard_uncertainty**2 for each in estimates]))
    if values.size == 1:
        return float(values[0]), math.sqrt(predicted), None, dof
    seen = float(values.var(ddof=1))
    u, freedom = merge_variances(seen, predicted, values.size, dof=values.size * dof)
    return float(values.mean()), u, math.sqrt(seen), freedom


def _coefficient(
    name: str, unit: str, estimates: Sequence[Estimate | None], *, dof: float = math.inf
) -> list[Coefficient]:
    """Return the coefficient, or none where a frame lacks it."""
    present = [each for each in estimates if each is not None]
    if not present or len(present) < len(estimates):
        return []
    value, u, repeatability, freedom = merge_estimates(present, dof=dof)
    quantity = Quantity(value=value, standard_uncertainty=u, unit=unit)
    dof = min(freedom, MOST_DOF)
    return [Coefficient(name=name, quantity=quantity, repeatability=repeatability, effective_dof=dof)]


def _merge_edges(edges: Sequence[EdgeResponse]) -> list[Coefficient]:
    parts = (
        (MTF50, _CYCLES_PER_PIXEL, [edge.mtf50 for edge in edges]),
        ("edge_rise_10_90_px", "px", [edge.rise_px for edge in edges]),
        ("lsf_fwhm_px", "px", [edge.lsf_fwhm_px for edge in edges]),
        ("mtf_nyquist", "1", [edge.mtf_nyquist for edge in edges]),
        ("overshoot", "1", [edge.overshoot for edge in edges]),
        ("undershoot", "1", [edge.undershoot for edge in edges]),
    )
    return [found for part in parts for found in _coefficient(*part, dof=JACKKNIFE_DOF)]


def _merge_stars(stars: Sequence[StarResponse], params: Params) -> list[Coefficient]:
    powers = [
        find_resolving_power(star.frequency, star.whole, contrast=params.star_contrast) for star in stars
    ]
    halves = [find_resolving_power(star.frequency, star.whole, contrast=0.5) for star in stars]
    found = _coefficient(RESOLVING_POWER, _CYCLES_PER_PIXEL, powers)
    diameter = []
    for power in found:
        across_px = unresolved_diameter(power.quantity.value, cycles=stars[0].cycles)
        u = across_px * power.quantity.standard_uncertainty / power.quantity.value
        quantity = Quantity(value=across_px, standard_uncertainty=u, unit="px")
        diameter.append(replace(power, name="unresolved_diameter_px", quantity=quantity, repeatability=None))
    return [*found, *diameter, *_coefficient(MTF50, _CYCLES_PER_PIXEL, halves)]


def _convert(found: Sequence[Coefficient], picture_height_px: int, params: Params) -> list[Coefficient]:
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


def _scale(coefficient: Coefficient, name: str, unit: str, factor: float) -> Coefficient:
    old = coefficient.quantity
    scatter = coefficient.repeatability
    return replace(
        coefficient,
        name=name,
        quantity=Quantity(
            value=old.value * factor, standard_uncertainty=old.standard_uncertainty * factor, unit=unit
        ),
        repeatability=None if scatter is None else scatter * factor,
    )


def _merge_curves(edges: Sequence[EdgeResponse], stars: Sequence[StarResponse]) -> tuple[Curve, ...]:
    if edges:
        frequency = tuple(float(each) for each in list_frequencies())
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
    frequency: tuple[float, ...], star: StarResponse, curve: Contrasts
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    contrast = np.interp(frequency, star.frequency, curve.contrast)
    u = np.interp(frequency, star.frequency, curve.contrast_u)
    return tuple(float(each) for each in contrast), tuple(float(each) for each in u)


def _merge_curve(
    direction_deg: float | None,
    frequency: tuple[float, ...],
    pairs: Sequence[tuple[tuple[float, ...], tuple[float, ...]]],
) -> Curve:
    merged = [
        merge_estimates([Estimate(value=value[k], standard_uncertainty=u[k]) for value, u in pairs])
        for k in range(len(frequency))
    ]
    return Curve(
        direction_deg=direction_deg,
        frequency=frequency,
        response=tuple(each[0] for each in merged),
        response_u=tuple(each[1] for each in merged),
    )


def _merge_directions(stars: Sequence[StarResponse], params: Params) -> tuple[Direction, ...]:
    found = []
    for curves in zip(*(star.sectors for star in stars), strict=True):
        powers = [
            find_resolving_power(star.frequency, curve, contrast=params.star_contrast)
            for star, curve in zip(stars, curves, strict=True)
        ]
        merged = _coefficient(RESOLVING_POWER, _CYCLES_PER_PIXEL, powers)
        found.append(
            Direction(
                direction_deg=float(curves[0].direction_deg or 0.0),
                resolving_power=merged[0].quantity if merged else None,
            )
        )
    return tuple(found)
