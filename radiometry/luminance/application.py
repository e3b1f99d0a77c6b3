"""A luminance coefficient applied to a new frame."""

import math
from collections.abc import Sequence

from radiometry.findings import InputRejected, Raised, shared
from radiometry.fitting import models
from radiometry.fitting.evidence import Quantity
from radiometry.frame.exposure import Exposure, Settings, require_plausible
from radiometry.frame.statistics import ChannelStatistics, Signal, measure_signal
from radiometry.luminance import codes
from radiometry.luminance.coefficient import Aperture, Coefficient
from radiometry.luminance.effects import SAME_SETTING_REL, Conversion, list_source_effects
from radiometry.luminance.measured import AppliedLuminance
from radiometry.luminance.points import DETECTION_ERRORS, MOST_SATURATED_SHARE
from radiometry.vignetting.lens import LensShare

_SAME_TIME_REL = 0.02


def apply_coefficient(
    statistics: Sequence[ChannelStatistics],
    *,
    exposure: Exposure,
    coefficients: Sequence[Coefficient],
) -> AppliedLuminance:
    """Compute the luminance of a region in a new frame.

    Parameters
    ----------
    statistics : sequence of ChannelStatistics
        Statistics of the region, one row per channel.
    exposure : Exposure
        Exposure of the frame.
    coefficients : sequence of Coefficient
        Coefficients of the version, one per ISO value.

    Returns
    -------
    AppliedLuminance
        Luminance with its effects, and the flags `outside_exposure_times`,
        `outside_f_numbers`, `f_number_not_calibrated`, `outside_signals`,
        `saturated`, `below_detection`.

    Raises
    ------
    InputRejected
        `iso_not_calibrated` if there is no coefficient for the frame's ISO value;
        `exposure_implausible`; `vignetting_not_calibrated` for a K that was fitted
        with vignetting (see `lens.correct_signal`).

    Notes
    -----
    L = X f^2 / (t S), with X where the model has the signal N - D. For N - D = K
    X::

        L = (N - D) f^2 / (K t S)
        (u_L/L)^2 = (u_K/K)^2 + (u_t/t)^2 + (u_S/S)^2 + 4 (u_f/f)^2 + (u_N^2 + u_D^2) / (N - D)^2

    u_S is 0, because K was fitted at the same setting.
    K is that of the frame's f-number if it was calibrated, so that only the rest of
    the f-number's error counts; else it is K of the ISO value. The error of an
    exposure time that was calibrated is in K too, and cancels as far as it is. For
    other models the covariance of their parameters is propagated through their
    inverse [1]_. Nothing is clipped: a signal below dark gives a negative luminance
    with its uncertainty.

    References
    ----------
    .. [1] JCGM 100:2008, 5.2.2, doi:10.59161/JCGM100-2008E
    """
    coefficient = choose_coefficient(coefficients, iso=exposure.iso)
    signal = measure_signal(statistics, channel=coefficient.channel)
    return apply_to_signal(signal, exposure=exposure, coefficient=coefficient)


def apply_to_signal(
    signal: Signal,
    *,
    exposure: Exposure,
    coefficient: Coefficient,
    share: LensShare | None = None,
) -> AppliedLuminance:
    """Compute the luminance of a signal: of a region, of a cell, or of a single pixel.

    Parameters
    ----------
    signal : Signal
        Mean raw value, black included [DN].
    exposure : Exposure
        Exposure of the frame.
    coefficient : Coefficient
        Coefficient for the frame's ISO value.
    share : LensShare or None, default: None
        Relative illumination V at this place and f-number, if vignetting is
        corrected.

    Returns
    -------
    AppliedLuminance
        Luminance with the effect of each source.

    Raises
    ------
    InputRejected
        `exposure_implausible`, `fit_failed`; `vignetting_not_calibrated` if K needs
        V and has none, or the reverse.

    Notes
    -----
    The equation is that of `apply_coefficient`, with each source's effect separate:
    two luminances of a frame share the same error times their sensitivities, and
    each has its own noise. A K that was fitted with vignetting applies to (N - D) /
    V in place of N - D.
    """
    require_alike(coefficient, corrected=share is not None)
    settings = exposure.on_basis(coefficient.exposure_basis)
    require_plausible(settings)
    coefficient = coefficient.at(settings.exposure_time_s)
    above_dark = signal.value_dn - coefficient.dark_signal_dn
    adjusted = above_dark / share.value if share else above_dark
    aperture = find_aperture(coefficient, settings)
    rhs = _invert(coefficient, adjusted) / (aperture.x_factor if aperture else 1.0)
    scale = settings.f_number**2 / (settings.exposure_time_s * settings.iso)
    effects = list_source_effects(
        coefficient,
        signal,
        share,
        adjusted_dn=adjusted,
        conversion=Conversion(
            settings, aperture, rhs * scale, scale / (aperture.x_factor if aperture else 1.0)
        ),
    )
    u_above_dark = math.hypot(signal.standard_uncertainty_dn, coefficient.dark_signal_standard_uncertainty_dn)
    return AppliedLuminance(
        luminance_cd_m2=Quantity(
            value=rhs * scale,
            standard_uncertainty=math.hypot(*(effect.effect_cd_m2 for effect in effects)),
            unit="cd/m2",
        ),
        signal_dn=signal.value_dn,
        adjusted_signal_dn=adjusted,
        rhs=rhs,
        effects=effects,
        flags=tuple(_flags(coefficient, settings, signal, above_dark, u_above_dark)),
        lens_share=share.quantity if share else None,
    )


def find_aperture(coefficient: Coefficient, settings: Settings) -> Aperture | None:
    """Return the calibration of a frame's f-number.

    Parameters
    ----------
    coefficient : Coefficient
        Coefficient for the frame's ISO value.
    settings : Settings
        Settings of the frame on the coefficient's basis.

    Returns
    -------
    Aperture or None
        None if the f-number was not calibrated, or the version is older.
    """
    for aperture in coefficient.apertures or ():
        if math.isclose(aperture.f_number, settings.f_number, rel_tol=SAME_SETTING_REL):
            return aperture
    return None


def foresee_k(coefficients: Sequence[Coefficient], *, iso: float) -> float:
    """Return the standard uncertainty of K at an f-number that was not calibrated.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of the version, one per ISO value.
    iso : float
        ISO value.

    Returns
    -------
    float
        Standard uncertainty, in the unit of K: the f-number's own error is added.
    """
    coefficient = choose_coefficient(coefficients, iso=iso)
    slope = coefficient.parameters[1] if coefficient.model == "power" else 1.0
    by_f_number = 2.0 * slope * coefficient.luminance_k * coefficient.f_number_u_rel
    return math.hypot(coefficient.luminance_k_standard_uncertainty, by_f_number)


def require_alike(coefficient: Coefficient, *, corrected: bool) -> None:
    """Refuse K for a signal corrected for vignetting if K's was not, and the reverse.

    Parameters
    ----------
    coefficient : Coefficient
        Coefficient to apply.
    corrected : bool
        True if the signal is corrected for vignetting.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated`.
    """
    if coefficient.vignetting is not None and not corrected:
        raise InputRejected(
            shared.VIGNETTING_NOT_CALIBRATED,
            "This K holds for signals that are corrected for vignetting: measure with the vignetting version "
            "that it was made with.",
        )
    if coefficient.vignetting is None and corrected:
        raise InputRejected(
            shared.VIGNETTING_NOT_CALIBRATED,
            "This K was made without correcting vignetting, and holds for uncorrected signals alone.",
        )


def choose_coefficient(coefficients: Sequence[Coefficient], *, iso: float) -> Coefficient:
    """Return the coefficient of an ISO value; between two calibrated values nothing is interpolated.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of the version, one per ISO value.
    iso : float
        ISO value of the frame.

    Raises
    ------
    InputRejected
        `iso_not_calibrated` if there is none.
    """
    for coefficient in coefficients:
        if coefficient.iso == iso:
            return coefficient
    known = ", ".join(f"{coefficient.iso:g}" for coefficient in coefficients)
    raise InputRejected(
        codes.ISO_NOT_CALIBRATED,
        f"The frame was taken at ISO {iso:g}; this calibration holds ISO {known}. "
        "Every ISO value needs its own.",
    )


def luminance_per_dn(coefficient: Coefficient, exposure: Exposure) -> float:
    """Compute the slope of a luminance map: L = (N - D) * slope.

    Returns
    -------
    float
        f^2 / (K t S) [cd/m2 per DN above dark], with K at the frame's f-number.

    Raises
    ------
    InputRejected
        `fit_failed` if the calibration's model is not proportional, so that its map
        is not a scale.
    """
    if coefficient.model != "proportional":
        raise InputRejected(
            shared.FIT_FAILED,
            "A map, or glare_share, needs a calibration with the proportional model; this one is "
            f"{coefficient.model}.",
        )
    settings = exposure.on_basis(coefficient.exposure_basis)
    k = (find_aperture(coefficient, settings) or coefficient).luminance_k
    return settings.f_number**2 / (k * settings.exposure_time_s * settings.iso)


def _invert(coefficient: Coefficient, adjusted_dn: float) -> float:
    rhs = models.invert(coefficient.model, coefficient.parameters, adjusted_dn)
    if not math.isfinite(rhs):
        raise InputRejected(
            shared.FIT_FAILED,
            f"The {coefficient.model} model of this calibration has no luminance for a signal of "
            f"{adjusted_dn:g} DN above dark.",
        )
    return rhs


def _flags(
    coefficient: Coefficient, settings: Settings, signal: Signal, adjusted_dn: float, u_adjusted_dn: float
) -> list[Raised]:
    raised: list[Raised] = []
    times = coefficient.exposure_times_s
    if not any(abs(settings.exposure_time_s / time - 1.0) <= _SAME_TIME_REL for time in times):
        detail = f"{settings.exposure_time_s:g} s; calibrated: {', '.join(f'{time:g}' for time in times)} s."
        raised.append(codes.OUTSIDE_EXPOSURE_TIMES.at("", detail))
    for flag, value, (low, high), unit in (
        (codes.OUTSIDE_F_NUMBERS, settings.f_number, coefficient.f_number_range, ""),
        (codes.OUTSIDE_SIGNALS, adjusted_dn, coefficient.signal_range_dn, " DN above dark"),
    ):
        if not low <= value <= high:
            detail = f"{value:g}{unit}; calibrated: {low:g} to {high:g}{unit}."
            raised.append(flag.at("", detail))
        elif (
            flag is codes.OUTSIDE_F_NUMBERS
            and coefficient.apertures
            and not find_aperture(coefficient, settings)
        ):
            known = ", ".join(f"{aperture.f_number:g}" for aperture in coefficient.apertures)
            raised.append(codes.F_NUMBER_NOT_CALIBRATED.at("", f"{value:g}; calibrated: {known}."))
    if signal.saturated_share > MOST_SATURATED_SHARE:
        detail = f"{signal.saturated_share:.2%} of the samples."
        raised.append(shared.SATURATED.at("", detail))
    if adjusted_dn < DETECTION_ERRORS * u_adjusted_dn:
        detail = f"{adjusted_dn:.3g} DN above dark, standard uncertainty {u_adjusted_dn:.3g} DN."
        raised.append(shared.BELOW_DETECTION.at("", detail))
    return raised
