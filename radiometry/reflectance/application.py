"""Application of a reflectance calibration to a new frame: a region, or every pixel of a window."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Finding, InputRejected, Raised, shared
from radiometry.fitting.comparison import PERCENT
from radiometry.fitting.evidence import Quantity
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.light import LightBasis
from radiometry.frame.multispectral import Multispectral
from radiometry.reflectance import codes
from radiometry.reflectance.fit import find_scale
from radiometry.reflectance.imaging import Features, compute_signal, require_band
from radiometry.reflectance.points import MOST_SATURATED_SHARE, require_flat_angle
from radiometry.reflectance.results import (
    REFLECTANCE_UNIT,
    AppliedReflectance,
    Coefficient,
    Effect,
    KAtTime,
    evaluate_k,
)
from radiometry.reflectance.sun import read_clock_s
from radiometry.reflectance.sunshine import SINGLE_READING_U_REL, Gain, Sunshine, measure_light

_SAME_SCALE_REL = 0.01
_CHANGED = 0.7
_SAME_ANGLE_DEG = 0.05


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Conversion of a frame's signal to reflectance: R = I_sq factor, factor = K / (I_ss cos(theta))."""

    band: str
    factor: float
    u_rel: float  # of the factor, the same for every pixel
    sources: tuple[tuple[str, float], ...]  # parts of `u_rel`
    reflectance_k: float  # K at the frame's time
    i_ss: float | None  # None for a panel-only K
    flags: tuple[Raised, ...]
    i_ss_oriented: float | None = None
    i_ss_basis: LightBasis | None = None


def find_scale_of_frame(
    header: FrameHeader, *, coefficients: Sequence[Coefficient], incidence_angle_deg: float | None = None
) -> Scale:
    """Compute the factor from a frame's signal to reflectance.

    With K at the frame's time; I_ss is left out with a panel-only K::

        R = K I_sq / (I_ss cos(theta))        u_rel^2 = u_K^2 + drift^2 + sunshine^2 + tilt^2 + gain^2

    The error of a gain is in K and in I_ss alike: with the same gain index in both it cancels, otherwise both
    count.
    """
    band = require_band(header)
    coefficient = choose_coefficient(coefficients, band=band.band)
    angle_deg = choose_angle(coefficients, band=band.band, stated=incidence_angle_deg)
    require_flat_angle(angle_deg)
    flags = _check_identity(header, band, coefficient)
    if not math.isclose(angle_deg, coefficient.incidence_angle_deg, abs_tol=_SAME_ANGLE_DEG):
        detail = f"{angle_deg:g} degrees; fitted with {coefficient.incidence_angle_deg:g}."
        flags.append(codes.INCIDENCE_ANGLE_DIFFERS.at("", detail))
    sunshine = None
    if coefficient.normalisation == "sunshine":
        value, u_rel = coefficient.channel_ratio, coefficient.channel_ratio_u_rel or 0.0
        sunshine = measure_light(
            header,
            choice=coefficient.sunshine_choice,
            params=coefficient.tilt,
            ratio=None if value is None else Gain(value=value, u_rel=u_rel),
        )
        flags += sunshine.flags
        low, high = coefficient.i_ss_range or (sunshine.i_ss, sunshine.i_ss)
        if not _CHANGED * low <= sunshine.i_ss <= high / _CHANGED:
            detail = f"{sunshine.i_ss:.4g} {sunshine.unit}; of the panel {low:.4g} to {high:.4g}."
            flags.append(codes.LIGHT_CHANGED.at("", detail))
            sunshine = _doubt_sky(sunshine, band)
    else:
        detail = "Its light was not compared with this frame's."
        flags.append(codes.PANEL_ONLY.at("", detail))
    k = evaluate_k(coefficient, at_s=read_clock_s(header))
    if k.outside_s != 0.0:
        flags.append(codes.OUTSIDE_PANEL_TIMES.at("", _describe_outside(k)))
    sources = _list_sources(coefficient, k, sunshine)
    cosine = math.cos(math.radians(angle_deg))
    i_ss = sunshine.i_ss if sunshine else None
    return Scale(
        band=band.band,
        factor=k.value / ((1.0 if i_ss is None else i_ss) * cosine),
        u_rel=math.hypot(*(u for _, u in sources)),
        sources=sources,
        reflectance_k=k.value,
        i_ss=i_ss,
        flags=tuple(flags),
        i_ss_oriented=sunshine.oriented if sunshine else None,
        i_ss_basis=sunshine.basis if sunshine else None,
    )


def _doubt_sky(sunshine: Sunshine, band: Multispectral) -> Sunshine:
    """Return a levelled reading less certain by the whole correction: under a cloud none is due."""
    stated = band.irradiance
    if sunshine.basis != "levelled" or (stated is not None and stated.scattered_w_m2_nm is not None):
        return sunshine
    sky = abs(1.0 - sunshine.oriented / sunshine.i_ss) / math.sqrt(3.0)
    return replace(sunshine, level_u_rel=math.hypot(sunshine.level_u_rel, sky))


def choose_angle(coefficients: Sequence[Coefficient], *, band: str, stated: float | None) -> float:
    """Return the angle of incidence of a measurement."""
    return choose_coefficient(coefficients, band=band).incidence_angle_deg if stated is None else stated


def choose_coefficient(coefficients: Sequence[Coefficient], *, band: str) -> Coefficient:
    for coefficient in coefficients:
        if coefficient.band == band:
            return coefficient
    known = ", ".join(sorted(coefficient.band for coefficient in coefficients))
    raise InputRejected(
        codes.BAND_NOT_CALIBRATED,
        f"The frame shows band {band}; this calibration holds {known}. Every band needs a panel frame of "
        "its own and the panel's reflectance in it.",
    )


def _list_sources(
    coefficient: Coefficient, k: KAtTime, sunshine: Sunshine | None
) -> tuple[tuple[str, float], ...]:
    sources = (("K", k.u_rel), ("drift", k.drift_u_rel))
    if sunshine is None:
        return sources
    same_gain = len(coefficient.gain_indices) <= 1 and coefficient.gain_indices == sunshine.gain_indices
    gain = 0.0 if same_gain else math.hypot(coefficient.gain_u_rel, sunshine.gain_u_rel)
    readings = sunshine.standard_uncertainty / sunshine.i_ss
    if sunshine.is_single and coefficient.reading_u_rel is not None:
        readings = math.sqrt(readings**2 - SINGLE_READING_U_REL**2 + coefficient.reading_u_rel**2)
    return (
        *sources,
        ("sunshine readings", readings),
        ("sunshine tilt", sunshine.level_u_rel),
        ("sunshine gain", gain),
    )


def _describe_outside(k: KAtTime) -> str:
    if k.outside_s is None:
        return "The time of the frame or of a panel capture is not known: the mean K was used."
    side = "before the first" if k.outside_s < 0.0 else "after the last"
    return (
        f"{abs(k.outside_s) / 60.0:.0f} min {side} panel capture: its K was used, with "
        f"{k.drift_u_rel:.1%} for drift since."
    )


def _check_identity(header: FrameHeader, band: Multispectral, coefficient: Coefficient) -> list[Raised]:
    """Refuse another camera or sunshine sensor; flag what cannot be compared."""
    flags = []
    if coefficient.normalisation == "sunshine":
        known = _compare(
            band.sunshine_serial, coefficient.sunshine_serial, "sunshine sensor", codes.WRONG_SUNSHINE_SENSOR
        )
        if not known:
            flags.append(codes.SUNSHINE_SERIAL_UNKNOWN.at("", "No serial number."))
    if not _compare(header.serial, coefficient.camera_serial, "camera", shared.WRONG_CAMERA):
        flags.append(shared.SERIAL_UNKNOWN.at("", "No serial number."))
    scale = find_scale(band)
    if not math.isclose(scale, coefficient.sensor_model_scale, rel_tol=_SAME_SCALE_REL):
        detail = f"{scale:g}; calibrated with {coefficient.sensor_model_scale:g}."
        flags.append(codes.SENSOR_MODEL_DIFFERS.at("", detail))
    return flags


def _compare(stated: str | None, calibrated: str | None, what: str, code: Finding) -> bool:
    """Return True if both serial numbers are known; refuse two that differ."""
    if not stated or not calibrated:
        return False
    if stated.casefold() != calibrated.casefold():
        raise InputRejected(
            code,
            f"The frame's {what} is {stated}, this calibration was made with {calibrated}. K belongs to one "
            "camera and one sunshine sensor: take a panel capture with this pair.",
        )
    return True


def apply_features(
    features: Features,
    *,
    header: FrameHeader,
    coefficients: Sequence[Coefficient],
    incidence_angle_deg: float | None = None,
) -> AppliedReflectance:
    """Compute the reflectance of a region with its uncertainty; nothing is clipped to [0, 1]."""
    scale = find_scale_of_frame(header, coefficients=coefficients, incidence_angle_deg=incidence_angle_deg)
    value = features.i_sq * scale.factor
    noise = features.i_sq_standard_uncertainty * abs(scale.factor)
    effects = (
        *(Effect(source=source, shared=True, effect=value * u_rel) for source, u_rel in scale.sources),
        Effect(source="pixel noise", shared=False, effect=noise),
    )
    return AppliedReflectance(
        band=features.band,
        reflectance=Quantity(
            value=value,
            standard_uncertainty=math.hypot(*(effect.effect for effect in effects)),
            unit=REFLECTANCE_UNIT,
        ),
        i_sq=features.i_sq,
        i_ss=scale.i_ss,
        reflectance_k=scale.reflectance_k,
        effects=effects,
        i_ss_oriented=scale.i_ss_oriented,
        i_ss_basis=scale.i_ss_basis,
        flags=(*scale.flags, *_check_features(features, value, noise)),
    )


def scale_pixels(
    frame: Frame, *, header: FrameHeader, exposure: Exposure, factor: float = 1.0
) -> NDArray[np.float32]:
    """Compute a multiple of the signal of every pixel of a window; it equals that of the whole frame there.

    With the factor of a `Scale` it is the reflectance, with 1 the radiance of a MicaSense camera. Nothing is
    clipped.
    """
    signal = compute_signal(frame, header=header, settings=exposure.on_basis("nominal"))
    found: NDArray[np.float32] = (signal * factor).astype(np.float32)
    found[frame.samples_dn >= min(frame.white_level_dn)] = np.nan
    return found


def _check_features(features: Features, value: float, noise: float) -> list[Raised]:
    raised = []
    share = features.statistics.saturated_share
    if share > MOST_SATURATED_SHARE:
        raised.append(shared.SATURATED.at("", f"{share:.2%} of the samples."))
    if value < 3.0 * noise:
        detail = f"Reflectance {value:.3g}, pixel noise {noise:.3g}."
        raised.append(shared.BELOW_DETECTION.at("", detail))
    if not 0.0 <= value <= 1.0:
        raised.append(codes.REFLECTANCE_OUT_OF_RANGE.at("", f"{value:.4g}."))
    return raised


def change_reflectance(
    old: Sequence[Coefficient],
    new: Sequence[Coefficient],
    *,
    header: FrameHeader,
    incidence_angle_deg: float | None = None,
    common_u_rel: float = 0.0,
) -> Quantity:
    """Compute R_new / R_old - 1 of a frame measured with `old` and with `new`.

    With the uncertainties relative to K [1]::

        R = K I_sq / (I_ss cos(theta))      R_new / R_old = factor_new / factor_old
        u(change)^2 = (R_new / R_old)^2 (u_old^2 + u_new^2 - 2 m^2)

    The frame's signal is the same in both, and so is the error of its sunshine reading.

    [1] JCGM 100:2008, 5.2.2, doi:10.59161/JCGM100-2008E
    """
    factors = [
        find_scale_of_frame(header, coefficients=each, incidence_angle_deg=incidence_angle_deg).factor
        for each in (old, new)
    ]
    band = require_band(header).band
    shares = [_k_u_rel(choose_coefficient(each, band=band)) for each in (old, new)]
    ratio = factors[1] / factors[0]
    variance = shares[0] ** 2 + shares[1] ** 2 - 2.0 * common_u_rel**2
    return Quantity(
        value=100.0 * (ratio - 1.0),
        standard_uncertainty=100.0 * abs(ratio) * math.sqrt(max(0.0, variance)),
        unit=PERCENT,
    )


def _k_u_rel(coefficient: Coefficient) -> float:
    return coefficient.reflectance_k_standard_uncertainty / abs(coefficient.reflectance_k)
