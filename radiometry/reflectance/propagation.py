"""Uncertainty of an index of reflectances that share errors."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, Raised
from radiometry.fitting.evidence import Quantity
from radiometry.frame.multispectral import Alignment
from radiometry.reflectance import codes
from radiometry.reflectance.formula import Formula, compute
from radiometry.reflectance.indices import spread_plane
from radiometry.reflectance.measurement import Share, estimate_noise
from radiometry.reflectance.results import REFLECTANCE_UNIT, AppliedReflectance, Coefficient
from radiometry.reflectance.scale import choose_coefficient
from radiometry.specification.stored import LATER

PANEL, ALIGNMENT = "panel", "alignment"
_K: Final = "K"
_NOISE: Final = "pixel noise"
_COMMON: Final = ("sunshine tilt",)
"""One tilt of one sensor: the same sign in every band."""
_UNKNOWN: Final = (PANEL, "drift", "sunshine gain")
"""The same panel, light and sensor, but nothing states how their errors correlate from band to band."""


@dataclass(frozen=True, kw_only=True)
class MeasuredIndex:
    """Index of a region's mean reflectances.

    Attributes
    ----------
    index : str
        Name of the index, or the formula.
    value : Quantity
        Index with its standard uncertainty.
    bands : tuple of AppliedReflectance
        Mean reflectances, that of the first band first.
    flags : tuple of Raised
        Flags of the bands.
    formula : str
        Formula of the index.
    alignment : tuple of Alignment
        How the other bands were aligned onto the first.
    budget : tuple of Share
        Contributions to the uncertainty, the largest first.
    """

    index: str
    value: Quantity
    bands: tuple[AppliedReflectance, ...]
    flags: tuple[Raised, ...]
    formula: str = field(default="", metadata=LATER)
    alignment: tuple[Alignment, ...] = field(default=(), metadata=LATER)
    budget: tuple[Share, ...] = field(default=(), metadata=LATER)


def list_effects(
    applied: AppliedReflectance, coefficients: Sequence[Coefficient], *, displaced: float = 0.0
) -> dict[str, float]:
    """List the effects on a band's reflectance with the panel's part of K apart.

    Parameters
    ----------
    applied : AppliedReflectance
        Reflectance of the band.
    coefficients : sequence of Coefficient
        Coefficients of the version, one per band.
    displaced : float, default: 0.0
        Effect of what remains of the band's displacement [1].

    Returns
    -------
    dict of str to float
        Effects by source [1].
    """
    effects = {each.source: abs(each.effect) for each in applied.effects}
    shared_u_rel = choose_coefficient(coefficients, band=applied.band).shared_u_rel
    whole = effects.get(_K, 0.0)
    panel = min(whole, shared_u_rel * abs(applied.reflectance.value))
    return effects | {_K: math.sqrt(whole**2 - panel**2), PANEL: panel, ALIGNMENT: displaced}


def combine(
    slopes: Mapping[str, NDArray[np.floating]], effects: Mapping[str, Mapping[str, NDArray[np.floating]]]
) -> dict[str, NDArray[np.floating]]:
    """Combine effects on bands into variances of an index, source by source.

    Parameters
    ----------
    slopes : mapping of str to ndarray
        Derivatives of the index by band.
    effects : mapping of str to mapping
        Effects on each band by source.

    Returns
    -------
    dict of str to ndarray
        Variance of the index by source.

    Notes
    -----
    With c_i the derivative by band i and u_i the effect of a source on it, its variance is::

        own to each band    V_0 = sum (c_i u_i)^2
        common              V_1 = (sum c_i u_i)^2
        correlation r       V_r = (1 - r) V_0 + r V_1

    K's scatter between captures, light readings, noise and alignment are a band's own; the tilt of the light
    sensor is common. Panel, drift of K and sensor gains have an unknown r, equal for all pairs: V_r is linear
    in it, so the larger of V_0 and V_1 bounds it for every r from 0 to 1. For a ratio that is V_0, for a sum
    V_1.
    """
    sources = dict.fromkeys(source for of_band in effects.values() for source in of_band)
    found: dict[str, NDArray[np.floating]] = {}
    for source in sources:
        parts = [np.asarray(slopes[band] * of_band.get(source, 0.0)) for band, of_band in effects.items()]
        own, common = sum(part**2 for part in parts), sum(parts) ** 2
        variance = common if source in _COMMON else np.maximum(own, common) if source in _UNKNOWN else own
        found[source] = np.asarray(variance)
    return found


def measure_index(
    formula: Formula,
    bands: Sequence[AppliedReflectance],
    *,
    coefficients: Sequence[Coefficient],
    alignment: Sequence[Alignment] = (),
    displaced: Mapping[str, float] | None = None,
) -> MeasuredIndex:
    """Compute an index of a region's reflectances with its uncertainty.

    Parameters
    ----------
    formula : Formula
        Index.
    bands : sequence of AppliedReflectance
        Reflectance of the region in each band.
    coefficients : sequence of Coefficient
        Coefficients of the version, one per band.
    alignment : sequence of Alignment, default: ()
        How the other bands were aligned onto the first.
    displaced : mapping of str to float or None, default: None
        Effects of what remains of their displacement, by band [1].

    Returns
    -------
    MeasuredIndex
        Index with its budget, as `combine` adds it up.

    Raises
    ------
    InputRejected
        `index_undefined` if it is not defined for these reflectances.
    """
    values = {each.band: np.asarray(each.reflectance.value) for each in bands}
    value, slopes = compute(formula, values)
    if np.isnan(value):
        told = ", ".join(f"{band} {float(reflectance):.4g}" for band, reflectance in values.items())
        raise InputRejected(
            codes.INDEX_UNDEFINED,
            f"{formula.name.upper()} does not exist here: with the reflectances {told} a divisor is not "
            "above zero. Draw the region on something that reflects.",
        )
    effects = {
        each.band: {
            source: np.asarray(effect)
            for source, effect in list_effects(
                each, coefficients, displaced=(displaced or {}).get(each.band, 0.0)
            ).items()
        }
        for each in bands
    }
    variances = {source: float(found) for source, found in combine(slopes, effects).items()}
    total = math.fsum(variances.values())
    shares = [
        Share(
            source=source,
            shared=source not in (_NOISE, ALIGNMENT),
            standard_uncertainty=math.sqrt(variance),
            variance_share=variance / total if total > 0.0 else 0.0,
        )
        for source, variance in variances.items()
    ]
    raised = [
        Raised(flag=each.flag, where=f"band {band.band}", detail=each.detail)
        for band in bands
        for each in band.flags
    ]
    return MeasuredIndex(
        index=formula.name,
        value=Quantity(value=float(value), standard_uncertainty=math.sqrt(total), unit=REFLECTANCE_UNIT),
        bands=tuple(bands),
        flags=(*raised, *flag_alignment(alignment)),
        formula=formula.text,
        alignment=tuple(alignment),
        budget=tuple(sorted(shares, key=lambda share: (-share.variance_share, share.source))),
    )


def map_uncertainty(
    formula: Formula,
    planes: Mapping[str, NDArray[np.float32]],
    bands: Sequence[AppliedReflectance],
    *,
    coefficients: Sequence[Coefficient],
    alignment: Sequence[Alignment],
) -> NDArray[np.float32]:
    """Compute the standard uncertainty of an index in every pixel.

    Parameters
    ----------
    formula : Formula
        Index.
    planes : mapping of str to ndarray of float32
        Reflectance by band on the same pixels.
    bands : sequence of AppliedReflectance
        Reflectance of a region in each band, whose shared effects are proportional to reflectance.
    coefficients : sequence of Coefficient
        Coefficients of the version, one per band.
    alignment : sequence of Alignment
        How the other bands were aligned onto the first.

    Returns
    -------
    ndarray of float32
        Standard uncertainty, (row, col), with one pixel's noise as found in the whole frame.
    """
    _, slopes = compute(formula, planes)
    left = {each.band: each.residual_px for each in alignment}
    effects: dict[str, dict[str, NDArray[np.floating]]] = {}
    for each in bands:
        plane = planes[each.band]
        shares = list_effects(each, coefficients)
        scale = np.abs(plane) / max(abs(each.reflectance.value), 1e-12)
        of_band: dict[str, NDArray[np.floating]] = {
            source: scale * np.float32(effect) for source, effect in shares.items() if source != _NOISE
        }
        noise = estimate_noise(plane.astype(np.float64), np.isfinite(plane))
        of_band[_NOISE] = np.asarray(np.float32(noise))
        of_band[ALIGNMENT] = spread_plane(plane, residual_px=left.get(each.band, 0.0))
        effects[each.band] = of_band
    return np.asarray(np.sqrt(sum(combine(slopes, effects).values())), np.float32)


def flag_alignment(alignment: Sequence[Alignment]) -> list[Raised]:
    """Flag bands that were aligned by lens data alone.

    Parameters
    ----------
    alignment : sequence of Alignment
        How the other bands were aligned onto the first.

    Returns
    -------
    list of Raised
        `alignment_not_refined`, one per band.
    """
    return [
        codes.ALIGNMENT_NOT_REFINED.at(
            f"band {each.band}", f"{each.patches} of {each.tried} patches agree with the first band."
        )
        for each in alignment
        if each.by == "lens_data"
    ]
