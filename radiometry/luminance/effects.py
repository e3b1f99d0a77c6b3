"""Effects of the sources of error on a luminance."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting import models
from radiometry.frame.exposure import Settings
from radiometry.frame.statistics import Signal
from radiometry.luminance.coefficient import Aperture, Coefficient, Rows
from radiometry.luminance.measured import AppliedLuminance, Effect, Share
from radiometry.vignetting.lens import LensShare

NOISE = "pixel noise"
SAME_SETTING_REL = 1e-3


@dataclass(frozen=True)
class Conversion:
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
    by_signal, by_parameters = models.invert_gradient(coefficient.model, coefficient.parameters, adjusted_dn)
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
    ]
    noise = Effect(
        source=NOISE, shared=False, effect_cd_m2=by_signal * signal.standard_uncertainty_dn / through * scale
    )
    return (*(Effect(source=name, shared=True, effect_cd_m2=effect) for name, effect in shared), noise)


def share_out(applied: AppliedLuminance) -> tuple[Share, ...]:
    """Add up the effects of each source; the variance shares add up to one.

    Parameters
    ----------
    applied : AppliedLuminance
        Luminance with its effects.

    Returns
    -------
    tuple of Share
        Sources in the order of the effects.
    """
    total = applied.luminance_cd_m2.standard_uncertainty
    names = dict.fromkeys((effect.source, effect.shared) for effect in applied.effects)
    shares = []
    for source, shared in names:
        u = math.hypot(*(e.effect_cd_m2 for e in applied.effects if e.source == source))
        shares.append(
            Share(
                source=source,
                shared=shared,
                standard_uncertainty_cd_m2=u,
                variance_share=(u / total) ** 2 if total > 0.0 else 0.0,
            )
        )
    return tuple(shares)


def _split_known(
    coefficient: Coefficient, by_parameters: NDArray[np.float64], conversion: Conversion
) -> tuple[list[float], list[float], list[float]]:
    """Return the effects of the fit, of the exposure times and of the f-numbers [cd/m2].

    Notes
    -----
    An error that the calibration's frames had as well is in K already. With g the share
    of it in ln K, its effect on L is L (1 - g), and nothing if all frames had it.
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
