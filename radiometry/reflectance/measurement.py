"""Measurement of a band's frame: a region and its pixels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.light import LightBasis
from radiometry.frame.roi import Polygon, Window, mask
from radiometry.reflectance.application import apply_features
from radiometry.reflectance.features import extract_features
from radiometry.reflectance.imaging import compute_signal
from radiometry.reflectance.results import REFLECTANCE_UNIT, AppliedReflectance, Coefficient, Effect
from radiometry.reflectance.scale import choose_angle
from radiometry.specification.stored import LATER

PERCENTILES = (5, 10, 90, 95)
_OUTLIER_SIGMAS = 5.0
_MAD_TO_SIGMA = 1.4826


@dataclass(frozen=True, kw_only=True)
class Share:
    """Contribution of one source to the mean's uncertainty.

    Attributes
    ----------
    source : str
        Name of the source.
    shared : bool
        True for the same error in every pixel.
    standard_uncertainty : float
        Contribution [1].
    variance_share : float
        Fraction of the variance, 0 to 1.
    """

    source: str
    shared: bool
    standard_uncertainty: float
    variance_share: float


@dataclass(frozen=True, kw_only=True)
class Percentile:
    """A percentile of the region's pixels.

    Attributes
    ----------
    percent : int
        Percentage of the pixels that do not reflect more than `reflectance`.
    reflectance : Quantity
        Reflectance at that percentile.
    """

    percent: int
    reflectance: Quantity


@dataclass(frozen=True, kw_only=True)
class MeasuredReflectance:
    """Reflectance of a region with its whole budget; nothing is clipped to [0, 1].

    Attributes
    ----------
    band : str
        Name of the band.
    pixels : int
        Number of pixels.
    mean : Quantity
        Reflectance of the region's signal, as K was made.
    shared_u, noise_u : float
        The two parts of its uncertainty [1].
    smallest, largest : Quantity
        Extremes of single pixels, with a single pixel's noise.
    median : Quantity
        Median of the pixels, with the median's own noise.
    percentiles : tuple of Percentile
        Percentiles of single pixels, with a single pixel's noise.
    budget : tuple of Share
        Contributions to the uncertainty of the mean, the largest first.
    i_sq : float
        Signal of the region.
    i_ss : float or None
        Sunshine reading; None for a panel-only K.
    reflectance_k : float
        K at the frame's time.
    incidence_angle_deg : float
        Angle between the light and the surface's normal [deg].
    below_zero_share, above_one_share : float
        Fractions of the region's pixels below 0 and above 1.
    saturated_share : float
        Saturated fraction of the region, 0 to 1.
    flags : tuple of Raised
        Flags of the measurement.
    i_ss_oriented : float or None
        Sunshine reading as the sensor was oriented.
    i_ss_basis : LightBasis or None
        Surface for which `i_ss` holds.
    """

    band: str
    pixels: int
    mean: Quantity
    shared_u: float
    noise_u: float
    smallest: Quantity
    largest: Quantity
    median: Quantity
    percentiles: tuple[Percentile, ...]
    budget: tuple[Share, ...]
    i_sq: float
    i_ss: float | None
    reflectance_k: float
    incidence_angle_deg: float
    below_zero_share: float
    above_one_share: float
    saturated_share: float
    flags: tuple[Raised, ...]
    i_ss_oriented: float | None = field(default=None, metadata=LATER)
    i_ss_basis: LightBasis | None = field(default=None, metadata=LATER)


def measure_region(
    frame: Frame,
    polygon: Polygon,
    *,
    header: FrameHeader,
    exposure: Exposure,
    coefficients: Sequence[Coefficient],
    incidence_angle_deg: float | None = None,
) -> MeasuredReflectance:
    """Measure the reflectance of a region.

    Parameters
    ----------
    frame : Frame
        Window that contains the region's window.
    polygon : Polygon
        Region.
    header : FrameHeader
        Metadata of the frame.
    exposure : Exposure
        Exposure of the frame.
    coefficients : sequence of Coefficient
        Coefficients of the version, one per band.
    incidence_angle_deg : float or None, default: None
        Angle between the light and the surface's normal [deg]; None for that of the
        fit.

    Returns
    -------
    MeasuredReflectance
        Reflectance with its budget, and the flags of `apply_features`.

    Raises
    ------
    InputRejected
        As `apply_features` and `extract_features`.

    Notes
    -----
    The mean is `apply_features` of the region's signal: measured as it was
    calibrated. A single pixel's noise is estimated from second differences a - 2 b
    + c of neighbours, of variance 6 times a pixel's, without outliers beyond 5
    sigma, so that texture has little effect.
    """
    features = extract_features(frame, polygon, header=header, exposure=exposure)
    applied = apply_features(
        features, header=header, coefficients=coefficients, incidence_angle_deg=incidence_angle_deg
    )
    signal = compute_signal(frame, header=header, settings=exposure.on_basis("nominal"))
    height, width = signal.shape
    inside = mask(polygon, Window(row0=frame.row0, col0=frame.col0, height=height, width=width))
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
        budget=_share_out(applied),
        i_sq=applied.i_sq,
        i_ss=applied.i_ss,
        reflectance_k=applied.reflectance_k,
        incidence_angle_deg=choose_angle(coefficients, band=features.band, stated=incidence_angle_deg),
        below_zero_share=float(np.mean(values < 0.0)),
        above_one_share=float(np.mean(values > 1.0)),
        saturated_share=features.statistics.saturated_share,
        flags=applied.flags,
        i_ss_oriented=applied.i_ss_oriented,
        i_ss_basis=applied.i_ss_basis,
    )


def describe_pixels(
    values: NDArray[np.float64], *, noise: float, shared_rel: float, unit: str
) -> dict[str, Any]:
    """Return the statistics of a region's pixels by their names in a measurement."""

    def pixel(value: float, own: float = noise) -> Quantity:
        return Quantity(value=value, standard_uncertainty=math.hypot(value * shared_rel, own), unit=unit)

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
    """Estimate the noise of one pixel of a region.

    Parameters
    ----------
    values : ndarray of float64
        Values of the window, (row, col).
    inside : ndarray of bool
        Pixels of the region, (row, col).

    Returns
    -------
    float
        Standard deviation; 0 if no three neighbours lie in the region.
    """
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


def _share_out(applied: AppliedReflectance) -> tuple[Share, ...]:
    """List the sources, the largest first."""
    variance = applied.reflectance.standard_uncertainty**2
    shares = [
        Share(
            source=effect.source,
            shared=effect.shared,
            standard_uncertainty=abs(effect.effect),
            variance_share=effect.effect**2 / variance if variance > 0.0 else 0.0,
        )
        for effect in applied.effects
    ]
    return tuple(sorted(shares, key=lambda share: (-share.variance_share, share.source)))
