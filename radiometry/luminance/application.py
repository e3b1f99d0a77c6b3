"""A luminance coefficient applied to a signal, with the effect of each source of error."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.drawing.text import write_exposure
from radiometry.findings import Raised, shared
from radiometry.fitting import evidence, sources
from radiometry.fitting.comparison import PERCENT, MeasuredChange
from radiometry.frame.exposure import Exposure, Settings, require_plausible
from radiometry.frame.statistics import Signal
from radiometry.luminance import codes, points
from radiometry.luminance.results import Aperture, Coefficient, Rows
from radiometry.records import Record
from radiometry.vignetting.lens import LensShare

_SAME_TIME_REL = 0.02
NOISE = "pixel noise"
SAME_SETTING_REL = 1e-3


class Effect(Record):
    """Effect of one standard uncertainty of one independent source on a luminance."""

    source: str
    # True if the same error is in every luminance of the frame: it can cancel in a ratio and never averages
    # down; else it is this luminance's own noise
    shared: bool
    effect_cd_m2: float  # with its sign


class AppliedLuminance(Record):
    """Luminance of a region in a frame, with its uncertainty and flags."""

    luminance_cd_m2: evidence.Quantity
    signal_dn: float  # N, black included
    adjusted_signal_dn: float  # (N - D) / V; N - D without vignetting correction
    rhs: float  # X
    # their sum of squares is the variance; the shared ones of one frame's luminances are in one order
    effects: tuple[Effect, ...]
    flags: tuple[Raised, ...]
    lens_share: evidence.Quantity | None = None  # V; None without vignetting correction


def apply_to_signal(
    signal: Signal, *, exposure: Exposure, coefficient: Coefficient, share: LensShare | None = None
) -> AppliedLuminance:
    """Compute the luminance of a signal: of a region, of a cell, or of a single pixel.

    L = X f^2 / (t S), with X where the model has the signal N - D. For N - D = K X::

        L = (N - D) f^2 / (K t S)
        (u_L/L)^2 = (u_K/K)^2 + (u_t/t)^2 + (u_S/S)^2 + 4 (u_f/f)^2 + (u_N^2 + u_D^2) / (N - D)^2

    u_S is 0, because K was fitted at the same setting. K is that of the frame's f-number if it was
    calibrated, so that only the rest of the f-number's error counts; else it is K of the ISO value. The error
    of an exposure time that was calibrated is in K too, and cancels as far as it is. For other models the
    covariance of their parameters is propagated through their inverse [1]. Nothing is clipped: a signal below
    dark gives a negative luminance with its uncertainty.

    Each source's effect is separate: two luminances of a frame share the same error times their
    sensitivities, and each has its own noise. A K that was fitted with vignetting applies to (N - D) / V in
    place of N - D.

    [1] JCGM 100:2008, 5.2.2, doi:10.59161/JCGM100-2008E
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
        luminance_cd_m2=evidence.Quantity(
            rhs * scale, math.hypot(*(effect.effect_cd_m2 for effect in effects)), "cd/m2"
        ),
        signal_dn=signal.value_dn,
        adjusted_signal_dn=adjusted,
        rhs=rhs,
        effects=effects,
        flags=tuple(_flags(coefficient, settings, signal, above_dark, u_above_dark)),
        lens_share=share.quantity if share else None,
    )


def find_aperture(coefficient: Coefficient, settings: Settings) -> Aperture | None:
    for aperture in coefficient.apertures or ():
        if math.isclose(aperture.f_number, settings.f_number, rel_tol=SAME_SETTING_REL):
            return aperture
    return None


def find_k(coefficient: Coefficient, settings: Settings) -> Coefficient | Aperture:
    """Return what has the K of a frame: its f-number if that was calibrated, else the ISO value."""
    return find_aperture(coefficient, settings) or coefficient


def foresee_k(coefficients: Sequence[Coefficient], *, iso: float) -> float:
    """Return the standard uncertainty of K at an f-number that was not calibrated."""
    coefficient = choose_coefficient(coefficients, iso=iso)
    slope = coefficient.parameters[1] if coefficient.model == "power" else 1.0
    by_f_number = 2.0 * slope * coefficient.luminance_k * coefficient.f_number_u_rel
    return math.hypot(coefficient.luminance_k_standard_uncertainty, by_f_number)


def require_alike(coefficient: Coefficient, *, corrected: bool) -> None:
    """Refuse K for a signal corrected for vignetting if K's was not, and the reverse."""
    if coefficient.vignetting is not None and not corrected:
        raise shared.VIGNETTING_NOT_CALIBRATED.reject(
            "This K holds for signals that are corrected for vignetting: measure with the vignetting version "
            "that it was made with."
        )
    if coefficient.vignetting is None and corrected:
        raise shared.VIGNETTING_NOT_CALIBRATED.reject(
            "This K was made without correcting vignetting, and holds for uncorrected signals alone."
        )


def choose_coefficient(coefficients: Sequence[Coefficient], *, iso: float) -> Coefficient:
    """Return the coefficient of an ISO value; between two calibrated values nothing is interpolated."""
    for coefficient in coefficients:
        if coefficient.iso == iso:
            return coefficient
    known = ", ".join(f"{coefficient.iso:g}" for coefficient in coefficients)
    raise codes.ISO_NOT_CALIBRATED.reject(
        f"The frame was taken at ISO {iso:g}; this calibration holds ISO {known}. "
        "Every ISO value needs its own."
    )


def luminance_per_dn(coefficient: Coefficient, exposure: Exposure) -> float:
    """Compute the slope of a luminance map: L = (N - D) * slope."""
    if coefficient.model != "proportional":
        raise shared.FIT_FAILED.reject(
            "A map, or glare_share, needs a calibration with the proportional model; this one is "
            f"{coefficient.model}."
        )
    settings = exposure.on_basis(coefficient.exposure_basis)
    k = find_k(coefficient, settings).luminance_k
    return settings.f_number**2 / (k * settings.exposure_time_s * settings.iso)


def _invert(coefficient: Coefficient, adjusted_dn: float) -> float:
    rhs = sources.invert(coefficient.model, coefficient.parameters, adjusted_dn)
    if not math.isfinite(rhs):
        raise shared.FIT_FAILED.reject(
            f"The {coefficient.model} model of this calibration has no luminance for a signal of "
            f"{adjusted_dn:g} DN above dark."
        )
    return rhs


def _flags(
    coefficient: Coefficient, settings: Settings, signal: Signal, adjusted_dn: float, u_adjusted_dn: float
) -> list[Raised]:
    raised: list[Raised] = []
    times = coefficient.exposure_times_s
    if not any(abs(settings.exposure_time_s / time - 1.0) <= _SAME_TIME_REL for time in times):
        calibrated = ", ".join(map(write_exposure, times))
        detail = f"{write_exposure(settings.exposure_time_s)}; calibrated: {calibrated}."
        raised.append(codes.OUTSIDE_EXPOSURE_TIMES.at("", detail))
    for flag, value, (low, high), unit in (
        (codes.OUTSIDE_F_NUMBERS, settings.f_number, coefficient.f_number_range, ""),
        (codes.OUTSIDE_SIGNALS, adjusted_dn, coefficient.signal_range_dn, " DN above dark"),
    ):
        if not low <= value <= high:
            raised.append(flag.at("", f"{value:.5g}{unit}; calibrated: {low:.5g} to {high:.5g}{unit}."))
        elif (
            flag is codes.OUTSIDE_F_NUMBERS
            and coefficient.apertures
            and not find_aperture(coefficient, settings)
        ):
            known = ", ".join(f"{aperture.f_number:g}" for aperture in coefficient.apertures)
            raised.append(codes.F_NUMBER_NOT_CALIBRATED.at("", f"{value:g}; calibrated: {known}."))
    if signal.saturated_share > points.MOST_SATURATED_SHARE:
        raised.append(shared.SATURATED.at("", f"{signal.saturated_share:.2%} of the samples."))
    if adjusted_dn < points.DETECTION_ERRORS * u_adjusted_dn:
        detail = f"{adjusted_dn:.3g} DN above dark, standard uncertainty {u_adjusted_dn:.3g} DN."
        raised.append(shared.BELOW_DETECTION.at("", detail))
    return raised


class Conversion(Record, kw_only=False):
    """A frame's settings, what was calibrated of them, its luminance and luminance per X [cd/m2]."""

    settings: Settings
    aperture: Aperture | None
    luminance: float
    scale: float


def list_source_effects(
    coefficient: Coefficient,
    signal: Signal,
    share: LensShare | None,
    *,
    adjusted_dn: float,
    conversion: Conversion,
) -> tuple[Effect, ...]:
    """List each source's effect on L = X scale [cd/m2]; correlated parameters as independent combinations."""
    by_signal, by_parameters = sources.invert_gradient(coefficient.model, coefficient.parameters, adjusted_dn)
    scale, luminance = conversion.scale, conversion.luminance
    through = share.value if share else 1.0
    by_lens = [-by_signal * adjusted_dn * effect / through for effect in share.effects] if share else []
    # semilog has no K that scales with the meter
    meter_u_rel = coefficient.meter_calibration_u_rel if coefficient.model != "semilog" else 0.0
    dark_u_dn = coefficient.dark_signal_standard_uncertainty_dn
    known = _split_known(coefficient, by_parameters * scale, conversion)
    shared = [
        *(("fit of K", effect) for effect in known[0]),
        ("meter calibration", luminance * meter_u_rel),
        ("dark signal", -by_signal * dark_u_dn / through * scale),
        *(("exposure time", effect) for effect in known[1]),
        *(("f-number", effect) for effect in known[2]),
        ("ISO setting", 0.0),  # K was fitted at the same setting
        *(("vignetting", effect * scale) for effect in by_lens),
        # of shutter, aperture and gain, which do not repeat: the same in all of one frame
        *((sources.SCATTER, luminance * each) for each in [coefficient.frame_scatter_rel] if each),
    ]
    noise = Effect(
        source=NOISE, shared=False, effect_cd_m2=by_signal * signal.standard_uncertainty_dn / through * scale
    )
    return (*(Effect(source=name, shared=True, effect_cd_m2=effect) for name, effect in shared), noise)


def _split_known(
    coefficient: Coefficient, by_parameters: NDArray[np.float64], conversion: Conversion
) -> tuple[list[float], list[float], list[float]]:
    """Return the effects of the fit, of the exposure times and of the f-numbers [cd/m2].

    An error that the calibration's frames had as well is in K already. With g the share of it in ln K, its
    effect on L is L (1 - g), and nothing if all frames had it.
    """
    aperture, luminance = conversion.aperture, conversion.luminance
    by_time, by_f_number = (
        luminance * coefficient.exposure_time_u_rel,
        2.0 * luminance * coefficient.f_number_u_rel,
    )
    errors = aperture.errors if aperture else coefficient.errors
    if errors is None:
        return _combine(coefficient.covariance, by_parameters), [by_time], [by_f_number]
    gradient = np.append(by_parameters, -luminance) if aperture else by_parameters
    times = (gradient @ np.array(errors.exposure_times)).tolist()
    met = [
        math.isclose(time, conversion.settings.exposure_time_s, rel_tol=SAME_SETTING_REL)
        for time in coefficient.exposure_times_s
    ]
    if any(met):
        times[met.index(True)] += by_time
    else:
        times.append(by_time)
    f_numbers = _combine(errors.f_numbers, gradient)
    return _combine(errors.fit, gradient), times, f_numbers if aperture else [*f_numbers, by_f_number]


def _combine(covariance: Rows, gradient: NDArray[np.float64]) -> list[float]:
    """Return the effects of independent combinations of correlated errors."""
    variances, directions = np.linalg.eigh(np.array(covariance))
    found: list[float] = (gradient @ (directions * np.sqrt(np.maximum(variances, 0.0)))).tolist()
    return found


def change_luminance(
    old: Sequence[Coefficient],
    new: Sequence[Coefficient],
    *,
    exposure: Exposure,
    signal_dn: float | None,
    lens_share: float = 1.0,
    common_u_rel: float = 0.0,
) -> MeasuredChange:
    """Compute how a luminance measured with `old` would change if it were measured with `new`.

    With X from the model at N - D [1]::

        L = X f^2 / (t S)        change = L_new / L_old - 1

    The error of N is the same in both versions and cancels for signals above dark.

    [1] JCGM 100:2008, 5.2.2, doi:10.59161/JCGM100-2008E
    """
    before, after = _at_iso(old, exposure.iso), _at_iso(new, exposure.iso)
    if before is None or after is None:
        lacking = "The version used" if before is None else "The version that would take its place"
        return MeasuredChange.untold(f"{lacking} holds no coefficient for ISO {exposure.iso:g}.")
    for was, becomes, why in (
        (
            before.channel,
            after.channel,
            f"One version takes the {before.channel} signal, the other {after.channel}.",
        ),
        (
            before.vignetting,
            after.vignetting,
            "The versions are corrected with different vignetting, or one of them with none.",
        ),
        (
            before.conditions,
            after.conditions,
            "The versions state different lamps, responses or distances: measure again to correct for them.",
        ),
    ):
        if was != becomes:
            return MeasuredChange.untold(why)
    held = [find_k(each, exposure.on_basis(each.exposure_basis)) for each in (before, after)]
    if signal_dn is None:
        if {before.model, after.model} != {"proportional"}:
            return MeasuredChange.untold(
                "The measured signal was not kept; K alone tells the change for proportional models."
            )
        ratio = held[0].luminance_k / held[1].luminance_k
    else:
        first, second = (_luminance(each, exposure, signal_dn, lens_share) for each in (before, after))
        ratio = second / first if first > 0.0 else math.nan
    if not math.isfinite(ratio):
        return MeasuredChange.untold("The signal is so near the dark signal that a ratio says nothing.")
    squares = [(each.luminance_k_standard_uncertainty / abs(each.luminance_k)) ** 2 for each in held]
    u_rel = math.sqrt(max(0.0, math.fsum(squares) - 2.0 * common_u_rel**2))
    change = evidence.Quantity(100.0 * (ratio - 1.0), 100.0 * abs(ratio) * u_rel, PERCENT)
    return MeasuredChange(change=change, basis="k_ratio" if signal_dn is None else "signal", why=None)


def _luminance(coefficient: Coefficient, exposure: Exposure, signal_dn: float, lens_share: float) -> float:
    settings = exposure.on_basis(coefficient.exposure_basis)
    dark_dn = coefficient.at(settings.exposure_time_s).dark_signal_dn
    adjusted_dn = (signal_dn - dark_dn) / lens_share
    aperture = find_aperture(coefficient, settings)
    rhs = sources.invert(coefficient.model, coefficient.parameters, adjusted_dn)
    rhs /= aperture.x_factor if aperture else 1.0
    return rhs * settings.f_number**2 / (settings.exposure_time_s * settings.iso)


def _at_iso(coefficients: Sequence[Coefficient], iso: float) -> Coefficient | None:
    return next((coefficient for coefficient in coefficients if coefficient.iso == iso), None)
