"""Errors of the field that the calibration does not contain: spectrum, flicker, focus and stray light."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from radiometry.drawing.text import write_exposure
from radiometry.findings import Raised
from radiometry.fitting.comparison import FOCUS, STRAY
from radiometry.fitting.evidence import FieldCorrection, Quantity, Values
from radiometry.fitting.sources import FLICKER
from radiometry.frame.exposure import Settings
from radiometry.luminance import codes
from radiometry.luminance.application import AppliedLuminance, Effect
from radiometry.luminance.results import Coefficient
from radiometry.luminance.rows import CalibrationConditions, Colour, FieldConditions
from radiometry.spectral import mismatch
from radiometry.spectral.lamps import LABELS, find_modulation, list_spectra

NEAREST_M = 1.0
"""Distance that a surface of unknown distance is at least away: nearer, a wide lens sees little but it."""

_USUAL_FOCAL_LENGTH_MM = 15.0
# A pupil magnified by 0.7 to 1.5 instead of 1 changes 2 m by so much; rectangular.
_PUPIL_REL = 0.25
# Glare at a place of the frame is between half of what the trap showed and one and a half; rectangular.
_GLARE_REL = 0.5 / math.sqrt(3.0)
# Lenses scatter up to 4 % (ISO 9358 veiling glare); the rms of anything from 0 on, at any place of the frame.
_USUAL_GLARE = 0.04
_UNKNOWN_GLARE = _USUAL_GLARE / math.sqrt(3.0) * math.hypot(1.0, _GLARE_REL)
MAINS_HZ = (50.0, 60.0)
_NAMED_FLICKER = 0.005
_LARGEST = 0.99
_MIDDLES = (np.arange(200) + 0.5) / 200


def correct_spectrum(
    field: FieldConditions, coefficient: Coefficient, colour: Colour | None
) -> tuple[FieldCorrection, tuple[Raised, ...]]:
    """Correct the spectral mismatch as far as lamp, response and light are known."""
    known = coefficient.conditions or CalibrationConditions()
    lamp, response, light = known.lamp, known.camera_response, field.light_source
    stated = field.spectral_mismatch_u_rel
    if lamp is not None and light is not None and is_same(lamp, light):
        found = FieldCorrection(
            source=mismatch.SOURCE,
            u_rel=0.0 if mismatch.is_table(light) else mismatch.LEAST_U_REL,
            basis=f"light and lamp of the calibration are both {_name(light)}",
        )
    elif lamp is not None and response is not None and light is not None:
        pair = {"channel": coefficient.channel, "calibrated": lamp, "measured": light}
        camera = mismatch.name_curve(response, mismatch.list_responses())
        found = FieldCorrection(
            source=mismatch.SOURCE,
            factor=mismatch.compute_mismatch(response, **pair),
            u_rel=mismatch.estimate_u_rel(response, **pair),
            basis=f"computed for {_name(light)} and a calibration under {_name(lamp)}, response {camera}",
        )
    else:
        found = _predict_mismatch(field, known, colour, channel=coefficient.channel)
    if stated is not None:
        basis = "as stated with the request" if found.assumed else found.basis
        return replace(found, u_rel=stated, basis=basis, assumed=None), ()
    if found.assumed is None:
        return found, ()
    flag = mismatch.SPECTRAL_MISMATCH_UNKNOWN.at(
        "", f"{found.basis.capitalize()}; {found.u_rel:.0%} of L assumed."
    )
    return found, (flag,)


def _predict_mismatch(
    field: FieldConditions, known: CalibrationConditions, colour: Colour | None, *, channel: str
) -> FieldCorrection:
    """Predict the mismatch from the kinds of both lights and the region's colour, as far as they are known.

    Without the camera's response it is taken to be like any published one. With a response and the spectrum
    of the calibration's lamp the colour alone suffices: the light may then be any of the library's.
    """
    ends = list_spectra(known.lamp_kind, known.lamp), list_spectra(field.lamp_kind, field.light_source)
    of_kinds = all(ends) and (field.light_source is None or known.lamp is None)
    if of_kinds or (known.lamp and known.camera_response and not ends[1]):
        responses = (known.camera_response,) if known.camera_response else mismatch.list_responses()
        asked = {"channel": channel, "calibrated": ends[0], "measured": ends[1]}
        sides = (known.lamp_kind, known.lamp), (field.lamp_kind, field.light_source)
        values: Values = {"cameras": float(len(responses))}
        for name, (kind, lamp) in zip(("calibrated", "measured"), sides, strict=True):
            if lamp or kind:
                values[name] = _name(lamp) if lamp else str(kind)
        if colour is not None and known.colour is not None:
            red, blue = (here / there for here, there in zip(colour, known.colour, strict=True))
            remedy = mismatch.fit_colour_remedy(responses, **asked)
            predicted = remedy.predict(red, blue)
            if predicted is not None:
                basis = (
                    f"from the region's own raw colour, R/G {red:.3g} and B/G {blue:.3g} of the calibration's"
                )
                values |= {"red_to_green": red, "blue_to_green": blue}
                return FieldCorrection(
                    source=mismatch.SOURCE,
                    factor=predicted,
                    u_rel=max(remedy.rms_rel, mismatch.LEAST_U_REL) if of_kinds else remedy.u_rel,
                    basis=f"{basis}, {_describe_ends(values)}" if of_kinds else basis,
                    values=values,
                )
        if of_kinds:
            remedy = mismatch.fit_colour_remedy(responses, **asked, by_colour=False)
            basis = f"{_describe_ends(values)}; the region's colour is unknown, or none of theirs"
            return FieldCorrection(
                source=mismatch.SOURCE,
                factor=remedy.factor,
                u_rel=max(remedy.rms_rel, mismatch.LEAST_U_REL),
                basis=basis,
                values=values,
            )
    lacking = [
        text
        for text, given in (
            ("the calibration's lamp", ends[0]),
            ("the camera's response", known.camera_response),
            ("the measured light", ends[1]),
        )
        if not given
    ]
    basis = f"assumed: {', '.join(lacking)} not known"
    return FieldCorrection(source=mismatch.SOURCE, u_rel=mismatch.DEFAULT_U_REL, basis=basis, assumed=True)


def _describe_ends(values: Values) -> str:
    light, lamp = (LABELS.get(str(values[name]), str(values[name])) for name in ("measured", "calibrated"))
    camera = (
        "its published response" if values["cameras"] == 1 else f"{values['cameras']:g} published cameras"
    )
    return f"for {light} after a calibration under {lamp}, by {camera}"


def correct_focus(field: FieldConditions, coefficient: Coefficient) -> FieldCorrection:
    """Correct the light that a lens loses when it is focused nearer.

    The illuminance on the sensor falls with (1 + m)^2, m = c / (d - c) for the focal length c and the
    distance d [1]::

        L = L_shown (1 + m)^2 / (1 + m_cal)^2

    A quarter of the correction is its standard uncertainty: the pupil's magnification is not known. An
    unknown distance may be anything from 1 m on, an unknown focal length is taken as 15 mm; the largest
    effect over sqrt(3) is then the uncertainty, and nothing is corrected. Nothing is lost by a focus that is
    left as it was.

    [1] S. F. Ray, Applied Photographic Optics, 3rd edition, Focal Press 2002, chapter 7
    """
    if field.lens_focus == "unchanged":
        return FieldCorrection(source=FOCUS, basis="focus as in the calibration")
    known = coefficient.conditions or CalibrationConditions()
    here, there, focal_mm = field.distance_m, known.focus_distance_m, known.focal_length_mm
    focal = _USUAL_FOCAL_LENGTH_MM if focal_mm is None else focal_mm
    values: Values = {
        "distance_m": f"from {NEAREST_M:g} on" if here is None else here,
        "focus_distance_m": f"from {NEAREST_M:g} on" if there is None else there,
        "focal_length_mm": focal,
    }
    if here is not None and there is not None and focal_mm is not None:
        factor = (_lose(here, focal_mm)) / _lose(there, focal_mm)
        basis = f"{here:g} m, calibrated at {there:g} m, focal length {focal_mm:g} mm"
        u_rel = _PUPIL_REL * abs(factor - 1.0)
        return FieldCorrection(source=FOCUS, factor=factor, u_rel=u_rel, basis=basis, values=values)
    ends = [[_lose(at, focal)] if at is not None else [1.0, _lose(NEAREST_M, focal)] for at in (here, there)]
    worst = max(abs(measured / calibrated - 1.0) for measured in ends[0] for calibrated in ends[1])
    lacking = [
        text
        for text, given in (("distance", here), ("calibration's distance", there), ("focal length", focal_mm))
        if given is None
    ]
    basis = f"assumed, not corrected: {', '.join(lacking)} not known"
    u_rel = worst / math.sqrt(3.0)
    return FieldCorrection(source=FOCUS, u_rel=u_rel, basis=basis, assumed=True, values=values)


def _lose(distance_m: float, focal_length_mm: float) -> float:
    focal_m = focal_length_mm / 1e3
    return (1.0 + focal_m / max(distance_m - focal_m, focal_m)) ** 2


def correct_stray_light(
    field: FieldConditions, mean_cd_m2: float | None
) -> tuple[FieldCorrection, tuple[Raised, ...]]:
    """Subtract the light that the lens scatters over the frame.

    With the glare g that a black trap shows::

        L = L_shown - g L_mean

    Its standard uncertainty is 29 % of it: at another place of the frame glare is taken to be within a half
    of that at the trap. A glare that is not stated may be anything from 0 to 4 %: nothing is subtracted, and
    its rms, 2.4 % of L_mean, is the standard uncertainty.
    """
    detail = "Each percent of glare raises every part of the frame by 1 % of the frame's mean luminance."
    unknown = (codes.STRAY_LIGHT_UNKNOWN.at("min", detail),)
    if mean_cd_m2 is None:
        return FieldCorrection(source=STRAY), unknown
    glare, of_mean = field.glare_share, f"of the frame's mean of {mean_cd_m2:.4g} cd/m2"
    if glare is None:
        return FieldCorrection(
            source=STRAY,
            u_cd_m2=_UNKNOWN_GLARE * abs(mean_cd_m2),
            basis=f"assumed: glare of up to {_USUAL_GLARE:.0%} {of_mean}",
            assumed=True,
            values={"glare_share": [0.0, _USUAL_GLARE], "frame_mean_cd_m2": mean_cd_m2},
        ), unknown
    return FieldCorrection(
        source=STRAY,
        offset_cd_m2=glare * mean_cd_m2,
        u_cd_m2=_GLARE_REL * (glare * mean_cd_m2),
        basis=f"{glare:.2%} {of_mean}",
        values={"glare_share": glare, "frame_mean_cd_m2": mean_cd_m2},
    ), ()


def apply_corrections(applied: AppliedLuminance, corrections: Sequence[FieldCorrection]) -> AppliedLuminance:
    """Correct a luminance, and add what is left of each error to its effects."""
    if not corrections:
        return applied
    factor = math.prod(each.factor for each in corrections)
    scaled = factor * applied.luminance_cd_m2.value
    effects = [replace(each, effect_cd_m2=factor * each.effect_cd_m2) for each in applied.effects]
    for each in corrections:
        effect = scaled * each.u_rel - each.u_cd_m2
        effects.append(Effect(source=each.source, shared=True, effect_cd_m2=effect))
    return replace(
        applied,
        effects=tuple(effects),
        luminance_cd_m2=Quantity(
            scaled - sum(each.offset_cd_m2 for each in corrections),
            math.hypot(*(each.effect_cd_m2 for each in effects)),
            applied.luminance_cd_m2.unit,
        ),
    )


def _name(lamp: str) -> str:
    return mismatch.name_curve(lamp, mismatch.list_lamps())


def is_same(lamp: str, light: str) -> bool:
    if mismatch.is_table(lamp) or mismatch.is_table(light):
        return lamp.strip() == light.strip()
    return _name(lamp) == _name(light)


def correct_flicker(
    field: FieldConditions, settings: Settings, *, frames: int
) -> tuple[FieldCorrection, tuple[Raised, ...]]:
    """Estimate the error of an exposure that is no whole number of flicker periods.

    A frame shows L (1 + e), e as in `estimate_flicker`, and L is found from what it shows: it errs by 1 / (1
    + e) - 1, which is skewed where e is large. u is its rms over all phases and depths, or 1 / 1.96 of what
    95 % of them stay below, whichever is larger, so that the expanded interval holds 95 % [1]. It averages
    over frames. Where neither depth nor kind is stated, the rms of e is taken, which is smaller, and too
    small for times much shorter than a period.

    [1] JCGM 101:2008, 5.3 and 7.7, doi:10.59161/JCGM101-2008
    """
    mains, stated, kind = field.mains_frequency_hz, field.flicker_modulation, field.lamp_kind
    time_s, (low, high) = settings.exposure_time_s, find_modulation(kind, stated)
    largest, one = estimate_flicker(time_s, mains, modulation=(low, high))
    if stated is not None or kind is not None:
        one = _estimate_inverse(largest, low, high)
    values: Values = {
        "mains_frequency_hz": list(MAINS_HZ) if mains is None else mains,
        "modulation": [low, high],
        "exposure_share": largest,
    }
    supply = "assumed: mains frequency of 50 or 60 Hz" if mains is None else f"{mains:g} Hz mains"
    depth = f"modulation {low:g}" if stated is not None else f"modulation assumed from {low:g} to {high:g}"
    if kind is not None and stated is None:
        values["lamp_kind"] = kind
        depth = f"{LABELS[kind]}: {depth}"
    basis = (
        f"{supply}, {depth}, of which {write_exposure(time_s)} shows {largest:.1%}"
        if mains != 0.0
        else "direct current"
    )
    line = FieldCorrection(
        source=FLICKER,
        u_rel=one / math.sqrt(frames),
        basis=basis,
        assumed=True if mains is None or (stated is None and kind is None) else None,
        values=values,
    )
    if mains is not None or line.u_rel <= _NAMED_FLICKER:
        return line, ()
    detail = f"At {write_exposure(time_s)}, light of 50 or 60 Hz mains can err by {high * largest:.1%}."
    return line, (codes.FLICKER_UNKNOWN.at("", detail),)


def estimate_flicker(
    exposure_time_s: float, mains_frequency_hz: float | None, *, modulation: tuple[float, float]
) -> tuple[float, float]:
    """Return the largest relative error of an exposure under fully modulated light, and its rms.

    With the largest error h of `compute_flicker` at full modulation, a phase that is anywhere and a depth
    that is anywhere from a to b, both with equal probability [1]::

        u^2 = h^2 / 2 (a^2 + a b + b^2) / 3

    [1] JCGM 100:2008, 4.3.7 and 4.4.5, doi:10.59161/JCGM100-2008E
    """
    frequencies = MAINS_HZ if mains_frequency_hz is None else (mains_frequency_hz,)
    largest = max(compute_flicker(exposure_time_s, mains_frequency_hz=each) for each in frequencies)
    low, high = modulation
    return largest, largest * math.sqrt((low * low + low * high + high * high) / 6.0)


def _estimate_inverse(largest: float, low: float, high: float) -> float:
    """Return u of 1 / (1 + e) over all phases and the depths from `low` to `high`."""
    # light that goes out altogether is not known at all from a moment of it
    share = min(largest, _LARGEST / high) if high else 0.0
    depths = low + (high - low) * _MIDDLES[:, None]
    errors = np.abs(1.0 / (1.0 + share * depths * np.sin(2.0 * np.pi * _MIDDLES)) - 1.0)
    return max(float(np.sqrt(np.mean(errors**2))), float(np.quantile(errors, 0.95)) / 1.96)


def compute_flicker(exposure_time_s: float, *, mains_frequency_hz: float) -> float:
    """Compute the largest relative error of an exposure under fully modulated light.

    Light 1 + m sin(2 pi f t + phase), f twice the mains frequency, averaged over the exposure time t::

        largest error = m |sin(pi f t)| / (pi f t)

    It is 0 for t = n / f. A rolling shutter turns it into bands, which a region averages in part.
    """
    turns = 2.0 * mains_frequency_hz * exposure_time_s
    if not turns:
        return 0.0
    return abs(math.sin(math.pi * turns)) / (math.pi * turns)
