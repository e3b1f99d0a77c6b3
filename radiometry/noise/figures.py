"""Coefficients in electrons from gain, dark noise and saturation, with the errors that they share."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from radiometry.fitting.evidence import Quantity
from radiometry.noise.darkness import DarkCurrent
from radiometry.noise.propagation import propagate
from radiometry.noise.results import DarkCurrentFigures, TransferFigures
from radiometry.noise.stacks import Stack
from radiometry.noise.transfer import Saturation, Transfer

ROUNDING_DOMINATES_DN2 = 0.24
"""Below this variance rounding hides the noise, and the noise may be anything up to 0.40 steps [1, 6.6]."""


@dataclass(frozen=True, kw_only=True)
class DarkNoise:
    """Variance sigma_y.dark^2 [DN^2] of the shortest dark stack, and the part of it due to rounding.

    Attributes
    ----------
    stack : Stack
        Shortest dark stack.
    variance_dn2, variance_u_dn2 : float
        Variance and its standard uncertainty [DN^2].
    rounding_dn2 : float
        Variance due to rounding, sigma_q^2 [DN^2].
    rounding_dominates : bool
        True if the variance is a limit.
    """

    stack: Stack
    variance_dn2: float
    variance_u_dn2: float
    rounding_dn2: float
    rounding_dominates: bool

    def read_noise_dn(self, variance_dn2: float) -> float:
        """Return sqrt(sigma_y.dark^2 - sigma_q^2) [DN].

        Parameters
        ----------
        variance_dn2 : float
            Variance sigma_y.dark^2 [DN^2].

        Returns
        -------
        float
            Read noise [DN].
        """
        return math.sqrt(variance_dn2 - self.rounding_dn2)


def measure_dark_noise(stack: Stack) -> DarkNoise:
    """Read the dark noise off a stack of dark frames; sigma_q^2 = step^2 / 12.

    Parameters
    ----------
    stack : Stack
        Stack of at least two dark frames.

    Returns
    -------
    DarkNoise
        Variance and the part of it due to rounding.
    """
    if stack.temporal is None:
        raise AssertionError("a dark stack has at least two frames")
    least, rounding = ROUNDING_DOMINATES_DN2 * stack.step_dn**2, stack.step_dn**2 / 12
    dominates = stack.temporal.value_dn2 < least
    # then anything from no noise to the limit: a rectangle of the read noise, carried to the variance
    limit_u = 2 * (least - rounding) / math.sqrt(12.0)
    return DarkNoise(
        stack=stack,
        variance_dn2=least if dominates else stack.temporal.value_dn2,
        variance_u_dn2=limit_u if dominates else stack.temporal.u_dn2,
        rounding_dn2=rounding,
        rounding_dominates=dominates,
    )


def find_read_noise_dn(dark: DarkNoise) -> Quantity:
    """Return the read noise [DN], which needs no gain.

    Parameters
    ----------
    dark : DarkNoise
        Dark noise.

    Returns
    -------
    Quantity
        Read noise [DN].
    """
    variance = np.array([dark.variance_dn2])
    return propagate(dark.read_noise_dn, variance, np.array([[dark.variance_u_dn2**2]]), unit="DN")


def find_transfer_figures(
    dark: DarkNoise, transfer: Transfer, saturation: Saturation, *, dsnu_dn: Quantity
) -> TransferFigures:
    """Compute the coefficients that follow from K, sigma_y.dark^2 and mu_sat.

    Parameters
    ----------
    dark : DarkNoise
        Dark noise sigma_y.dark^2.
    transfer : Transfer
        Photon transfer with the gain K.
    saturation : Saturation
        Saturation mu_sat.
    dsnu_dn : Quantity
        DSNU [DN].

    Returns
    -------
    TransferFigures
        Coefficients with their uncertainties.

    Notes
    -----
    With K [DN/e-] [1]_ (2.3 to 2.6, 6.6)::

        sigma_d = sqrt(sigma_y.dark^2 - sigma_q^2) / K,   mu_e.min = sigma_y.dark / K + 1/2,
        mu_e.sat = mu_sat / K,   SNR_max = sqrt(mu_e.sat),   DR = mu_e.sat / mu_e.min

    References
    ----------
    .. [1] EMVA Standard 1288, release 3.1
    """
    gain = transfer.gain_dn_per_e
    # where numbers are cut off at white, the maximum of the variance lies up to two sigma below it
    top_noise = math.sqrt(dark.variance_dn2 + gain * saturation.signal_dn)
    saturation_u = saturation.u_dn or 2 * top_noise / math.sqrt(3.0)
    values = np.array([gain, dark.variance_dn2, saturation.signal_dn])
    covariance = np.diag([transfer.gain_u**2, dark.variance_u_dn2**2, saturation_u**2])
    if not dark.rounding_dominates:
        covariance[0, 1] = covariance[1, 0] = transfer.covariance_with(dark.stack)

    def carry(figure: Callable[[float, float, float], float], unit: str) -> Quantity:
        return propagate(figure, values, covariance, unit=unit)

    return TransferFigures(
        system_gain_dn_per_e=carry(lambda k, _v, _top: k, "DN/e-"),
        read_noise_e=carry(lambda k, v, _top: dark.read_noise_dn(v) / k, "e-"),
        sensitivity_threshold_e=carry(lambda k, v, _top: _threshold_e(k, v), "e-"),
        saturation_dn=carry(lambda _k, _v, top: top, "DN"),
        saturation_origin=saturation.origin,
        full_well_e=carry(lambda k, _v, top: top / k, "e-"),
        snr_max=carry(lambda k, _v, top: math.sqrt(top / k), "1"),
        dynamic_range=carry(_ratio, "1"),
        dynamic_range_db=carry(lambda k, v, top: 20 * math.log10(_ratio(k, v, top)), "dB"),
        dynamic_range_stops=carry(lambda k, v, top: math.log2(_ratio(k, v, top)), "stop"),
        dsnu_e=_per_gain(dsnu_dn, transfer, power=1, unit="e-"),
        levels_used=len(transfer.levels),
        birge_ratio=transfer.birge_ratio,
        chi_squared=transfer.chi_squared,
    )


def find_dark_current_figures(
    current: DarkCurrent | None, transfer: Transfer | None
) -> DarkCurrentFigures | None:
    """Return the dark current in DN/s, and in e-/s if the gain is known.

    Parameters
    ----------
    current : DarkCurrent or None
        Dark current; None if it is not known.
    transfer : Transfer or None
        Photon transfer with the gain; None if it is not known.

    Returns
    -------
    DarkCurrentFigures or None
        None without a dark current.
    """
    if current is None:
        return None
    mean, variance = current.from_mean, current.from_variance
    return DarkCurrentFigures(
        dark_current_dn_per_s=mean,
        dark_current_e_per_s=_per_gain(mean, transfer, power=1, unit="e-/s") if transfer else None,
        from_variance_e_per_s=_per_gain(variance, transfer, power=2, unit="e-/s")
        if transfer and variance
        else None,
    )


def _threshold_e(gain: float, variance_dn2: float) -> float:
    return math.sqrt(variance_dn2) / gain + 0.5


def _ratio(gain: float, variance_dn2: float, top_dn: float) -> float:
    return top_dn / gain / _threshold_e(gain, variance_dn2)


def _per_gain(quantity: Quantity, transfer: Transfer, *, power: int, unit: str) -> Quantity:
    per_e = transfer.gain_dn_per_e**power
    from_gain = power * quantity.value * transfer.gain_u / transfer.gain_dn_per_e
    return Quantity(
        value=quantity.value / per_e,
        standard_uncertainty=math.hypot(quantity.standard_uncertainty, from_gain) / per_e,
        unit=unit,
    )
