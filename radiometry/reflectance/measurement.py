"""Measurement of a region: the reflectance or radiance of a band, or an index, with its uncertainty."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Raised, shared
from radiometry.fitting.evidence import Quantity
from radiometry.frame import Frame, FrameHeader, multispectral, roi
from radiometry.frame.exposure import Exposure
from radiometry.records import Record, later
from radiometry.reflectance import codes, imaging, indices, method, points, results
from radiometry.reflectance.results import REFLECTANCE_UNIT, AppliedReflectance, Coefficient, Effect
from radiometry.specification.application import Summary

PERCENTILES = (5, 10, 90, 95)
_OUTLIER_SIGMAS = 5.0
_MAD_TO_SIGMA = 1.4826
PANEL, ALIGNMENT = "panel", "alignment"
_K: Final = "K"
_NOISE: Final = "pixel noise"
_ANGLE: Final = "panel angle"
_COMMON: Final = ("sunshine tilt", _ANGLE)
"""One tilt of one sensor, and of one panel: the same sign and size in every band."""

_UNKNOWN: Final = (PANEL, "drift", "sunshine gain")
"""The same panel, light and sensor, but nothing states how their errors correlate from band to band."""


class Share(Record):
    """Contribution of one source to the mean's uncertainty."""

    source: str
    shared: bool  # the same error in every pixel
    standard_uncertainty: float
    variance_share: float


class Percentile(Record):
    """A percentile of the region's pixels."""

    percent: int
    reflectance: Quantity


class MeasuredReflectance(Record):
    """Reflectance of a region with its whole budget; nothing is clipped to [0, 1]."""

    band: str
    pixels: int
    mean: Quantity  # of the region's signal, as K was made
    shared_u: float
    noise_u: float
    smallest: Quantity  # of single pixels, with a single pixel's noise, as the percentiles
    largest: Quantity
    median: Quantity  # with the median's own noise
    percentiles: tuple[Percentile, ...]
    budget: tuple[Share, ...]  # the largest first
    i_sq: float
    i_ss: float | None  # None for a panel-only K
    reflectance_k: float  # at the frame's time
    incidence_angle_deg: float
    below_zero_share: float  # of the region's pixels
    above_one_share: float
    saturated_share: float
    flags: tuple[Raised, ...]
    i_ss_oriented: float | None = later()
    i_ss_basis: multispectral.LightBasis | None = later()
    effective_dof: float | None = later()  # of the mean's variance; None if infinite
    coverage_factor: float | None = later()  # for a coverage probability of 95 %
    expanded_uncertainty: float | None = later()


def _expand(mean: Quantity, doubt: results.Doubt | None) -> dict[str, Any]:
    """Return k and U of a mean, and the degrees of freedom that have them."""
    if doubt is None:
        return {}
    k, dof = doubt.expand(mean.standard_uncertainty**2)
    return {
        "effective_dof": dof if math.isfinite(dof) else None,
        "coverage_factor": k,
        "expanded_uncertainty": k * mean.standard_uncertainty,
    }


def measure_region(
    frame: Frame,
    polygon: roi.Polygon,
    *,
    header: FrameHeader,
    exposure: Exposure,
    coefficients: Sequence[Coefficient],
    incidence_angle_deg: float | None = None,
) -> MeasuredReflectance:
    """Measure the reflectance of a region.

    The mean is `apply_features` of the region's signal: measured as it was calibrated. A single pixel's noise
    is estimated from second differences a - 2 b + c of neighbours, of variance 6 times a pixel's, without
    outliers beyond 5 sigma, so that texture has little effect.
    """
    features = imaging.extract_features(frame, polygon, header=header, exposure=exposure)
    applied = method.apply_features(
        features, header=header, coefficients=coefficients, incidence_angle_deg=incidence_angle_deg
    )
    signal = imaging.compute_signal(frame, header=header, settings=exposure.on_basis("nominal"))
    inside = roi.mask(polygon, frame.window)
    factor = applied.reflectance.value / features.i_sq if features.i_sq else 0.0
    values = signal[inside] * factor
    noise = estimate_noise(signal * factor, inside)
    shared_rel = _part(applied.effects, shared=True) / abs(applied.reflectance.value or 1.0)

    return MeasuredReflectance(
        band=features.band,
        mean=applied.reflectance,
        shared_u=_part(applied.effects, shared=True),
        noise_u=_part(applied.effects, shared=False),
        **describe_pixels(values, noise=noise, shared_rel=shared_rel, unit=REFLECTANCE_UNIT),
        budget=_share_out(
            ((each.source, each.shared, each.effect**2) for each in applied.effects),
            applied.reflectance.standard_uncertainty**2,
        ),
        i_sq=applied.i_sq,
        i_ss=applied.i_ss,
        reflectance_k=applied.reflectance_k,
        incidence_angle_deg=method.choose_angle(coefficients, band=features.band, stated=incidence_angle_deg),
        below_zero_share=float(np.mean(values < 0.0)),
        above_one_share=float(np.mean(values > 1.0)),
        saturated_share=features.statistics.saturated_share,
        flags=applied.flags,
        i_ss_oriented=applied.i_ss_oriented,
        i_ss_basis=applied.i_ss_basis,
        **_expand(applied.reflectance, applied.doubt),
    )


def describe_pixels(
    values: NDArray[np.float64], *, noise: float, shared_rel: float, unit: str
) -> dict[str, Any]:
    """Return the statistics of a region's pixels by their names in a measurement."""

    def pixel(value: float, own: float = noise) -> Quantity:
        return Quantity(value, math.hypot(value * shared_rel, own), unit)

    middle, *ranks = np.percentile(values, [50, *PERCENTILES]).tolist()
    return {
        "pixels": int(values.size),
        "smallest": pixel(float(values.min())),
        "largest": pixel(float(values.max())),
        # the median of n has sqrt(pi / 2) times a mean's noise
        "median": pixel(middle, noise * math.sqrt(math.pi / 2 / values.size)),
        "percentiles": tuple(
            Percentile(percent=percent, reflectance=pixel(value))
            for percent, value in zip(PERCENTILES, ranks, strict=True)
        ),
    }


def estimate_noise(values: NDArray[np.float64], inside: NDArray[np.bool_]) -> float:
    found = []
    for axis in (0, 1):
        size = values.shape[axis] - 2
        if size <= 0:
            continue
        places = [(slice(None),) * axis + (slice(at, at + size),) for at in range(3)]
        chosen = np.logical_and.reduce([inside[place] for place in places])
        a, b, c = (values[place][chosen] for place in places)
        found.append(a - 2.0 * b + c)
    differences = np.concatenate(found) if found else np.empty(0)
    if not differences.size:
        return 0.0
    spread = _MAD_TO_SIGMA * float(np.median(np.abs(differences)))
    kept = differences[np.abs(differences) <= _OUTLIER_SIGMAS * spread] if spread > 0.0 else differences
    return math.sqrt(float(np.mean(kept**2)) / 6.0)


def _part(effects: Sequence[Effect], *, shared: bool) -> float:
    return math.hypot(*(effect.effect for effect in effects if effect.shared == shared))


def _share_out(parts: Iterable[tuple[str, bool, float]], total: float) -> tuple[Share, ...]:
    """Return sources, each with its variance, as shares of the total, the largest first."""
    shares = [
        Share(
            source=source,
            shared=is_shared,
            standard_uncertainty=math.sqrt(variance),
            variance_share=variance / total if total > 0.0 else 0.0,
        )
        for source, is_shared, variance in parts
    ]
    return tuple(sorted(shares, key=lambda share: (-share.variance_share, share.source)))


class MeasuredRadiance(Record):
    """Radiance of a region by the manufacturer's calibration; nothing is clipped."""

    radiance: str  # name of the band
    pixels: int
    mean: Quantity  # with its noise alone as uncertainty
    smallest: Quantity
    largest: Quantity
    median: Quantity
    percentiles: tuple[Percentile, ...]
    saturated_share: float
    flags: tuple[Raised, ...]


def require_radiance(header: FrameHeader) -> None:
    """Refuse a band whose file states no absolute calibration."""
    band = imaging.require_band(header)
    if imaging.signal_unit(band) != imaging.RADIANCE_UNIT:
        raise codes.RADIANCE_UNKNOWN.refuse(
            f"Band {band.band_name} of {header.model or 'this camera'} has a signal of unknown scale."
        )


def measure_radiance(
    frame: Frame, polygon: roi.Polygon, *, header: FrameHeader, exposure: Exposure
) -> MeasuredRadiance:
    """Measure the radiance of a region, L = V(x, y) a1 / (g (t + a2 y - a3 t y)) (p - B) [1].

    [1] MicaSense, "RedEdge Camera Radiometric Calibration Model"
    """
    require_radiance(header)
    features = imaging.extract_features(frame, polygon, header=header, exposure=exposure)
    signal = imaging.compute_signal(frame, header=header, settings=exposure.on_basis("nominal"))
    inside = roi.mask(polygon, frame.window)
    flags = [codes.RADIANCE_UNCERTAINTY_UNKNOWN.at("", "Only the noise of the pixels is stated.")]
    share = features.statistics.saturated_share
    if share > points.MOST_SATURATED_SHARE:
        flags.append(shared.SATURATED.at("", f"{share:.2%} of the samples."))
    noise = estimate_noise(signal, inside)
    return MeasuredRadiance(
        radiance=features.band,
        mean=Quantity(features.i_sq, features.i_sq_standard_uncertainty, imaging.RADIANCE_UNIT),
        **describe_pixels(signal[inside], noise=noise, shared_rel=0.0, unit=imaging.RADIANCE_UNIT),
        saturated_share=share,
        flags=tuple(flags),
    )


class MeasuredIndex(Record):
    """Index of a region's mean reflectances."""

    index: str
    value: Quantity
    bands: tuple[AppliedReflectance, ...]  # that of the first band first
    flags: tuple[Raised, ...]
    formula: str = ""
    alignment: tuple[multispectral.Alignment, ...] = ()
    budget: tuple[Share, ...] = ()  # the largest first
    effective_dof: float | None = later()  # as of a reflectance
    coverage_factor: float | None = later()
    expanded_uncertainty: float | None = later()


def list_effects(
    applied: AppliedReflectance, coefficients: Sequence[Coefficient], *, displaced: float = 0.0
) -> dict[str, float]:
    """List the effects on a band's reflectance with the panel's part of K apart, and its angle's of that."""
    effects = {each.source: abs(each.effect) for each in applied.effects}
    coefficient = method.choose_coefficient(coefficients, band=applied.band)
    whole, value = effects.get(_K, 0.0), abs(applied.reflectance.value)
    panel = min(whole, coefficient.shared_u_rel * value)
    angle = min(panel, (coefficient.angle_u_rel or 0.0) * value)
    return effects | {
        _K: math.sqrt(whole**2 - panel**2),
        PANEL: math.sqrt(panel**2 - angle**2),
        _ANGLE: angle,
        ALIGNMENT: displaced,
    }


def combine(
    slopes: Mapping[str, NDArray[np.floating]], effects: Mapping[str, Mapping[str, NDArray[np.floating]]]
) -> dict[str, NDArray[np.floating]]:
    """Combine effects on bands into variances of an index, source by source.

    With c_i the derivative by band i and u_i the effect of a source on it, its variance is::

        own to each band    V_0 = sum (c_i u_i)^2
        common              V_1 = (sum c_i u_i)^2
        correlation r       V_r = (1 - r) V_0 + r V_1

    K's scatter between captures, light readings, noise and alignment are a band's own; the tilts of light
    sensor and panel are common. Panel, drift of K and sensor gains have an unknown r, equal for all pairs:
    V_r is linear in it, so the larger of V_0 and V_1 bounds it for every r from 0 to 1. For a ratio that is
    V_0, for a sum V_1.
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
    formula: indices.Formula,
    bands: Sequence[AppliedReflectance],
    *,
    coefficients: Sequence[Coefficient],
    alignment: Sequence[multispectral.Alignment] = (),
    displaced: Mapping[str, float] | None = None,
) -> MeasuredIndex:
    values = {each.band: np.asarray(each.reflectance.value) for each in bands}
    value, slopes = indices.compute(formula, values)
    if np.isnan(value):
        told = ", ".join(f"{band} {float(reflectance):.4g}" for band, reflectance in values.items())
        raise codes.INDEX_UNDEFINED.reject(
            f"{formula.name.upper()} does not exist here: with the reflectances {told} a divisor is not "
            "above zero. Draw the region on something that reflects."
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
    parts = [(source, source not in (_NOISE, ALIGNMENT), each) for source, each in variances.items()]
    raised = [
        Raised(flag=each.flag, where=f"band {band.band}", detail=each.detail)
        for band in bands
        for each in band.flags
    ]
    found = Quantity(float(value), math.sqrt(total), REFLECTANCE_UNIT)
    doubts = [each.doubt.scale(float(slopes[each.band])) for each in bands if each.doubt]
    doubt = results.Doubt(
        math.fsum(each.single for each in doubts),
        math.fsum(each.restless for each in doubts),
        min((each.dof for each in doubts), default=math.inf),
    )
    return MeasuredIndex(
        index=formula.name,
        value=found,
        bands=tuple(bands),
        flags=(*raised, *flag_alignment(alignment)),
        formula=formula.text,
        alignment=tuple(alignment),
        budget=_share_out(parts, total),
        **_expand(found, doubt),
    )


def map_uncertainty(
    formula: indices.Formula,
    planes: Mapping[str, NDArray[np.float32]],
    bands: Sequence[AppliedReflectance],
    *,
    coefficients: Sequence[Coefficient],
    alignment: Sequence[multispectral.Alignment],
) -> NDArray[np.float32]:
    _, slopes = indices.compute(formula, planes)
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
        of_band[ALIGNMENT] = indices.spread_plane(plane, residual_px=left.get(each.band, 0.0))
        effects[each.band] = of_band
    return np.asarray(np.sqrt(sum(combine(slopes, effects).values())), np.float32)


def flag_alignment(alignment: Sequence[multispectral.Alignment]) -> list[Raised]:
    """Flag bands that were aligned by lens data alone."""
    return [
        codes.ALIGNMENT_NOT_REFINED.at(
            f"band {each.band}", f"{each.patches} of {each.tried} patches agree with the first band."
        )
        for each in alignment
        if each.by == "lens_data"
    ]


_EXPANDED = ("effective_dof", "coverage_factor", "expanded_uncertainty")


def summarise(result: Mapping[str, Any]) -> Summary:
    """Return a stored result of a band, an index or a radiance in figures."""
    expanded = {name: result.get(name) for name in _EXPANDED}
    if "index" in result:
        name = result["index"]
        index = {"name": name, "formula": result.get("formula") or None, "bands": result["bands"]}
        figures = {"mean": result["value"], "index": index} | expanded
        return Summary(signal=name, measured=name, column="index_value", figures=figures)
    region = {name: result[name] for name in ("pixels", "mean", "median", "saturated_share")}
    region |= {"min": result["smallest"], "max": result["largest"]} | expanded
    if "radiance" in result:
        band = result["radiance"]
        figures = {**region, "radiance": band}
        return Summary(signal=band, measured=f"radiance of {band}", column=None, figures=figures)
    band, figures = result["band"], {**region, "reflected": result}
    return Summary(signal=band, measured=band, column="reflectance", figures=figures)
