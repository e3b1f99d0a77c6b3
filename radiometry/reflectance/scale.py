"""Reflectance per signal of a frame: its coefficient, its light and the sources of error."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from radiometry.findings import Finding, InputRejected, Raised, shared
from radiometry.frame import FrameHeader
from radiometry.frame.light import LightBasis
from radiometry.frame.multispectral import Multispectral
from radiometry.reflectance import codes
from radiometry.reflectance.clock import read_clock_s
from radiometry.reflectance.evaluation import KAtTime, evaluate_k
from radiometry.reflectance.fit import find_scale
from radiometry.reflectance.gains import Gain
from radiometry.reflectance.imaging import require_band
from radiometry.reflectance.levelling import measure_light
from radiometry.reflectance.points import require_flat_angle
from radiometry.reflectance.results import Coefficient
from radiometry.reflectance.sunshine import SINGLE_READING_U_REL, Sunshine

_SAME_SCALE_REL = 0.01
_CHANGED = 0.7
_SAME_ANGLE_DEG = 0.05


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Conversion of a frame's signal to reflectance: R = I_sq factor, factor = K / (I_ss cos(theta)).

    Attributes
    ----------
    band : str
        Name of the band.
    factor : float
        Factor from the signal to reflectance.
    u_rel : float
        Relative standard uncertainty of the factor, the same for every pixel.
    sources : tuple of tuple[str, float]
        Parts of `u_rel` by source.
    reflectance_k : float
        K at the frame's time.
    i_ss : float or None
        Sunshine reading; None for a panel-only K.
    flags : tuple of Raised
        Flags of the frame.
    i_ss_oriented : float or None, default: None
        Sunshine reading as the sensor was oriented.
    i_ss_basis : LightBasis or None, default: None
        Surface for which `i_ss` holds.
    """

    band: str
    factor: float
    u_rel: float
    sources: tuple[tuple[str, float], ...]
    reflectance_k: float
    i_ss: float | None
    flags: tuple[Raised, ...]
    i_ss_oriented: float | None = None
    i_ss_basis: LightBasis | None = None


def find_scale_of_frame(
    header: FrameHeader, *, coefficients: Sequence[Coefficient], incidence_angle_deg: float | None = None
) -> Scale:
    """Compute the factor from a frame's signal to reflectance.

    Parameters
    ----------
    header : FrameHeader
        Metadata of the frame.
    coefficients : sequence of Coefficient
        Coefficients of the version, one per band.
    incidence_angle_deg : float or None, default: None
        Angle between the light and the surface's normal [deg]; None for that of the
        fit.

    Returns
    -------
    Scale
        Factor with its uncertainty. Flags: those of `measure_light`, and
        `panel_only`, `incidence_angle_differs`, `outside_panel_times`, `sensor_model_differs`,
        `serial_unknown`, `sunshine_serial_unknown`, `light_changed`.

    Raises
    ------
    InputRejected
        `band_not_calibrated`, `wrong_camera`, `wrong_sunshine_sensor`,
        `sunshine_missing`, `panel_angle_too_large` or `sensor_model_unusable`.

    Notes
    -----
    With K at the frame's time; I_ss is left out with a panel-only K::

        R = K I_sq / (I_ss cos(theta))        u_rel^2 = u_K^2 + drift^2 + sunshine^2 + tilt^2 + gain^2

    The error of a gain is in K and in I_ss alike: with the same gain index in both
    it cancels, otherwise both count.
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
    """Return the angle of incidence of a measurement.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of the version, one per band.
    band : str
        Name of the band.
    stated : float or None
        Angle that the measurement states [deg].

    Returns
    -------
    float
        The stated angle, else that of the fit [deg].

    Raises
    ------
    InputRejected
        `band_not_calibrated`.
    """
    return choose_coefficient(coefficients, band=band).incidence_angle_deg if stated is None else stated


def choose_coefficient(coefficients: Sequence[Coefficient], *, band: str) -> Coefficient:
    """Return the coefficient of a band.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of the version, one per band.
    band : str
        Name of the band.

    Returns
    -------
    Coefficient
        The coefficient of that band.

    Raises
    ------
    InputRejected
        `band_not_calibrated` if there is none.
    """
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
