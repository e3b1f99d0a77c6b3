"""Reflectance: per band the coefficient K that converts irradiance at the sensor into reflectance.

    R cos(theta) = K I_sq / I_ss          K = R cos(theta) I_ss / I_sq   of a panel of known R

I_sq is the band's signal after black and vignetting, I_ss the sunshine sensor's reading of the same moment.
There is one K per band, camera and sunshine sensor, for one flight. The method follows "How to convert
Sequoia images to reflectance?" 1.1; the divisions by the gain index and of black by the vignetting, in public
scripts, are not followed.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Finding, InputRejected, Raised, shared
from radiometry.fitting import evidence
from radiometry.fitting.comparison import PERCENT
from radiometry.fitting.evidence import CoefficientValue, Extracted, Quantity, require_complete
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.multispectral import LightBasis, Multispectral
from radiometry.records import Record
from radiometry.reflectance import codes, findings, imaging, panel_code, points, results, sun
from radiometry.reflectance.fit import check_times, describe_point, find_scale, fit_bands
from radiometry.reflectance.results import Coefficient, Doubt, Effect, Fit, FrameRow, KAtTime, Params, Reading
from radiometry.reflectance.sunshine import (
    SINGLE_READING_U_REL,
    Gain,
    Sunshine,
    measure_light,
    recall_attitude,
)

_SAME_SCALE_REL = 0.01
_CHANGED = 0.7
_SAME_ANGLE_DEG = 0.05
_READINGS: Final = "sunshine readings"


class Scale(Record):
    """Conversion of a frame's signal to reflectance: R = I_sq factor, factor = K / (I_ss cos(theta))."""

    band: str
    factor: float
    u_rel: float  # of the factor, the same for every pixel
    sources: tuple[tuple[str, float], ...]  # parts of `u_rel`
    doubt: Doubt  # of `u_rel` squared
    reflectance_k: float  # K at the frame's time
    i_ss: float | None  # None for a panel-only K
    flags: tuple[Raised, ...]
    i_ss_oriented: float | None = None
    i_ss_basis: LightBasis | None = None


def find_scale_of_frame(
    header: FrameHeader, *, coefficients: Sequence[Coefficient], incidence_angle_deg: float | None = None
) -> Scale:
    """Compute the factor from a frame's signal to reflectance.

    With K at the frame's time; I_ss is left out with a panel-only K. What panel and frame share of the tilt
    counts by its difference::

        R = K I_sq / (I_ss cos(theta))        u_rel^2 = u_K^2 + drift^2 + sunshine^2 + tilt^2 + gain^2

    The error of a gain is in K and in I_ss alike: with the same gain index in both it cancels, otherwise both
    count.
    """
    band = imaging.require_band(header)
    coefficient = choose_coefficient(coefficients, band=band.band)
    angle_deg = choose_angle(coefficients, band=band.band, stated=incidence_angle_deg)
    points.require_flat_angle(angle_deg)
    flags = _check_identity(header, band, coefficient)
    if not math.isclose(angle_deg, coefficient.incidence_angle_deg, abs_tol=_SAME_ANGLE_DEG):
        detail = f"{angle_deg:g} degrees; fitted with {coefficient.incidence_angle_deg:g}."
        flags.append(codes.INCIDENCE_ANGLE_DIFFERS.at("", detail))
    sunshine = None
    if coefficient.normalisation == "sunshine":
        header, stale = recall_attitude(header, coefficient.panel_light or ())
        flags += [codes.SUNSHINE_STALE.at("", stale)] if stale else []
        value, u_rel = coefficient.channel_ratio, coefficient.channel_ratio_u_rel or 0.0
        # the panel's light of an older version was not levelled without a zone, and its sky was white
        older = all(knot.level_effects is None for knot in coefficient.knots)
        sunshine = measure_light(
            replace(header, multispectral=replace(band, wavelength_nm=None)) if older else header,
            choice=coefficient.sunshine_choice,
            params=None if older and len(sun.locate_suns_of(header)) > 1 else coefficient.tilt,
            ratio=None if value is None else Gain(value=value, u_rel=u_rel),
        )
        flags += sunshine.flags
        low, high = coefficient.i_ss_range or (sunshine.i_ss, sunshine.i_ss)
        if not _CHANGED * low <= sunshine.i_ss <= high / _CHANGED:
            detail = f"{sunshine.i_ss:.4g} {sunshine.unit}; of the panel {low:.4g} to {high:.4g}."
            flags.append(codes.LIGHT_CHANGED.at("", detail))
            sunshine = _doubt_sky(sunshine, band)
    else:
        flags.append(codes.PANEL_ONLY.at("", "Its light was not compared with this frame's."))
    k = results.evaluate_k(coefficient, at_s=sun.read_clock_s(header))
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
        doubt=_doubt(coefficient, k, sunshine, readings_u_rel=dict(sources).get(_READINGS, 0.0)),
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
    return choose_coefficient(coefficients, band=band).incidence_angle_deg if stated is None else stated


def choose_coefficient(coefficients: Sequence[Coefficient], *, band: str) -> Coefficient:
    for coefficient in coefficients:
        if coefficient.band == band:
            return coefficient
    known = ", ".join(sorted(coefficient.band for coefficient in coefficients))
    raise codes.BAND_NOT_CALIBRATED.reject(
        f"The frame shows band {band}; this calibration holds {known}. Every band needs a panel frame of "
        "its own and the panel's reflectance in it."
    )


def _list_sources(
    coefficient: Coefficient, k: KAtTime, sunshine: Sunshine | None
) -> tuple[tuple[str, float], ...]:
    if sunshine is None:
        return ("K", k.u_rel), ("drift", k.drift_u_rel)
    own = sun.take_away(k.u_rel, (k.level_u_rel, *k.level_effects))
    own_tilt = sun.take_away(sunshine.level_u_rel, sunshine.level_effects)
    shared_tilt = results.add_effects((k.level_effects, sunshine.level_effects), (1.0, -1.0))
    same_gain = len(coefficient.gain_indices) <= 1 and coefficient.gain_indices == sunshine.gain_indices
    gain = 0.0 if same_gain else math.hypot(coefficient.gain_u_rel, sunshine.gain_u_rel)
    readings = sunshine.standard_uncertainty / sunshine.i_ss
    if sunshine.is_single and coefficient.reading_u_rel is not None:
        readings = math.sqrt(readings**2 - SINGLE_READING_U_REL**2 + coefficient.reading_u_rel**2)
    return (
        ("K", own),
        ("drift", k.drift_u_rel),
        (_READINGS, readings),
        ("sunshine tilt", math.hypot(k.level_u_rel, own_tilt, *shared_tilt)),
        ("sunshine gain", gain),
    )


def _doubt(
    coefficient: Coefficient, k: KAtTime, sunshine: Sunshine | None, *, readings_u_rel: float
) -> Doubt:
    """Return how well the factor's variance is known; a single reading has the noise of the panel's."""
    own = readings_u_rel**2
    single, estimated = (own, 0.0) if sunshine is None or sunshine.is_single else (0.0, own)
    restless = estimated**2 / (sunshine.readings - 1.0) if estimated and sunshine else 0.0
    return Doubt(k.single + single, k.restless + restless, coefficient.reading_dof or results.READING_DOF)


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
        raise code.reject(
            f"The frame's {what} is {stated}, this calibration was made with {calibrated}. K belongs to one "
            "camera and one sunshine sensor: take a panel capture with this pair."
        )
    return True


def apply_features(
    features: imaging.Features,
    *,
    header: FrameHeader,
    coefficients: Sequence[Coefficient],
    incidence_angle_deg: float | None = None,
) -> results.AppliedReflectance:
    """Compute the reflectance of a region with its uncertainty; nothing is clipped to [0, 1]."""
    scale = find_scale_of_frame(header, coefficients=coefficients, incidence_angle_deg=incidence_angle_deg)
    value = features.i_sq * scale.factor
    noise = features.i_sq_standard_uncertainty * abs(scale.factor)
    effects = (
        *(Effect(source=source, shared=True, effect=value * u_rel) for source, u_rel in scale.sources),
        Effect(source="pixel noise", shared=False, effect=noise),
    )
    return results.AppliedReflectance(
        band=features.band,
        reflectance=Quantity(
            value, math.hypot(*(effect.effect for effect in effects)), results.REFLECTANCE_UNIT
        ),
        doubt=scale.doubt.scale(value),
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
    signal = imaging.compute_signal(frame, header=header, settings=exposure.on_basis("nominal"))
    found: NDArray[np.float32] = (signal * factor).astype(np.float32)
    found[frame.samples_dn >= min(frame.white_level_dn)] = np.nan
    return found


def _check_features(features: imaging.Features, value: float, noise: float) -> list[Raised]:
    raised = []
    share = features.statistics.saturated_share
    if share > points.MOST_SATURATED_SHARE:
        raised.append(shared.SATURATED.at("", f"{share:.2%} of the samples."))
    if value < 3.0 * noise:
        raised.append(shared.BELOW_DETECTION.at("", f"Reflectance {value:.3g}, pixel noise {noise:.3g}."))
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
    band = imaging.require_band(header).band
    both = (choose_coefficient(each, band=band) for each in (old, new))
    shares = [each.reflectance_k_standard_uncertainty / abs(each.reflectance_k) for each in both]
    ratio = factors[1] / factors[0]
    variance = shares[0] ** 2 + shares[1] ** 2 - 2.0 * common_u_rel**2
    return Quantity(100.0 * (ratio - 1.0), 100.0 * abs(ratio) * math.sqrt(max(0.0, variance)), PERCENT)


def extract(
    frame: Frame, regions: Sequence[evidence.Region], *, header: FrameHeader, exposure: Exposure | None
) -> Extracted[imaging.Features]:
    if exposure is None:
        raise ValueError("a panel or field frame without its exposure")
    features = imaging.extract_features(frame, regions[0].polygon, header=header, exposure=exposure)
    return Extracted(statistics=(features.statistics,), features=features)


def find_region(frame: Frame, *, header: FrameHeader) -> panel_code.FoundPanel | None:
    """Find the panel in a whole frame of one band: as the camera states it, else by its code."""
    band = header.multispectral
    if band is None or frame.samples_dn.ndim != 2:
        return None
    stated = None
    if band.panel_region is not None:
        black_dn = imaging.find_black_dn(band, header.black_level_dn)
        stated = panel_code.find_stated_panel(frame.samples_dn, band.panel_region, black_dn=black_dn)
    if stated and band.panel_serial:
        return stated
    read = panel_code.find_panel(frame.samples_dn)
    return replace(stated, serial=read.serial if read else None) if stated else read


def missing(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params, *, unread: Sequence[str] = ()
) -> tuple[str, ...]:
    """List by name what the fit still lacks.

    A band without a panel reflectance is named although the other bands may be enough: `fit` leaves it out.
    """
    lacking = points.list_missing(rows, readings, params, unread=unread)
    return (*lacking, *points.list_bands_without_reflectance(rows, readings, params))


def fit(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> Fit:
    """Fit K for every band of a campaign's panel frames.

    The same input in any order gives the same result to the last bit. All values are finite; what does not
    exist is None.
    """
    points.require_flat_angle(params.incidence_angle_deg)
    require_complete(points.list_missing(rows, readings, params))
    candidates = points.collect_candidates(rows, readings, params)
    used = [candidate for candidate in candidates if not candidate.left_out]
    if not used:
        raise _explain(candidates)
    _require_one_pair(used, params)
    points.require_one_panel((each.row for each in used), readings)
    used, doubts = check_times(used)
    fits = fit_bands(used, params)
    flags: list[Raised] = [*findings.check_candidates(candidates), *doubts]
    for band, band_fit in fits.items():
        flags += findings.check_fit(band_fit, [each for each in used if each.band.band == band])
    if params.normalisation == "panel_only":
        flags.append(codes.PANEL_ONLY.at("", "Chosen by the parameters of this fit."))
    return Fit(
        band_fits=tuple(fits.values()),
        points=tuple(describe_point(each, params, fits.get(each.band.band)) for each in candidates),
        flags=tuple(flags),
    )


def list_coefficients(fitted: Fit) -> tuple[CoefficientValue, ...]:
    """List K of every band, by rising wavelength where the files state it."""
    coefficients = (each.coefficient for each in fitted.band_fits)
    return tuple(
        CoefficientValue(
            name="reflectance_k",
            value=coefficient.reflectance_k,
            standard_uncertainty=coefficient.reflectance_k_standard_uncertainty,
            unit=coefficient.reflectance_k_unit,
            band=coefficient.band,
            model=coefficient.normalisation,
            coverage_factor=coefficient.coverage_factor,
            flags=_flags_of(fitted, coefficient.band),
        )
        for coefficient in sorted(coefficients, key=lambda each: (each.wavelength_nm or 0.0, each.band))
    )


def _flags_of(fitted: Fit, band: str) -> tuple[str, ...]:
    """Collect the flags of the whole, of the band, and of its frames."""
    frames = {f"frame {point.frame}" for point in fitted.points if point.band == band}
    where = {"", f"band {band}", *frames}
    return tuple(sorted({raised.flag for raised in fitted.flags if raised.where in where}))


def configure(fitted: Fit) -> dict[str, Any]:
    """Return the sunshine sensor that the fit holds with: K belongs to the pair."""
    serials = sorted({each.coefficient.sunshine_serial or "" for each in fitted.band_fits} - {""})
    return {"sunshine_sensor": {"serial": serials[0]}} if serials else {}


def _explain(candidates: Sequence[points.Candidate]) -> InputRejected:
    """Name what keeps every panel frame out: by its own code where there is one for all."""
    found = {candidate.left_out_code for candidate in candidates}
    reasons = sorted({f"{each.band.band}: {each.left_out}" for each in candidates})
    code = found.pop() if len(found) == 1 else None
    what = "; ".join(reasons) or "none of the panel frames is a multispectral camera's"
    if code is None or code == codes.PANEL_SATURATED:
        what += ". Take the panel again, neither saturated nor dark, and state what it reflects in each band."
    return InputRejected(code or shared.FIT_INCOMPLETE, f"No panel frame can be used. {what}")


def _require_one_pair(used: Sequence[points.Candidate], params: Params) -> None:
    """Refuse panel frames of several cameras or sunshine sensors: K belongs to one pair."""
    cameras = {each.row.header.serial for each in used if each.row.header.serial}
    sensors = {each.band.sunshine_serial for each in used if each.band.sunshine_serial}
    for what, found, code in (
        ("cameras", cameras, shared.WRONG_CAMERA),
        (
            "sunshine sensors",
            sensors if params.normalisation == "sunshine" else set(),
            codes.WRONG_SUNSHINE_SENSOR,
        ),
    ):
        if len(found) > 1:
            raise code.reject(
                f"The panel frames are of several {what}: {', '.join(sorted(found))}. K belongs to one "
                "camera and one sunshine sensor: leave the others' frames out."
            )
