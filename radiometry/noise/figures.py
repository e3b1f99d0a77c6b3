"""Coefficients in electrons from gain, dark noise and saturation, with the errors that they share."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.noise.darkness import DarkCurrent
from radiometry.noise.results import DarkCurrentFigures, TransferFigures
from radiometry.noise.rounding import estimate_rounded_noise, estimate_rounding_error
from radiometry.noise.stacks import Stack
from radiometry.noise.transfer import Saturation, Transfer

_STEP_REL = 1e-5


def propagate(
    figure: Callable[..., float],
    values: NDArray[np.float64],
    covariance: NDArray[np.float64],
    *,
    unit: str,
    dofs: NDArray[np.float64] | None = None,
) -> tuple[Quantity, float]:
    """Compute a function of several inputs and its uncertainty: u^2 = g' V g (JCGM 100).

    Parameters
    ----------
    figure : callable
        Function of the inputs, with gradient g by central differences.
    values : ndarray of float64
        Inputs, none of them 0, (n,).
    covariance : ndarray of float64
        Covariance V of the inputs, (n, n).
    unit : str
        Unit of the value.
    dofs : ndarray of float64 or None, default: None
        Degrees of freedom of the inputs' uncertainties, (n,); None for infinite ones.

    Returns
    -------
    tuple of (Quantity, float)
        Value and standard uncertainty, and effective degrees of freedom by Welch and Satterthwaite.
    """
    gradient = np.empty(values.size)
    for index, value in enumerate(values):
        step = _STEP_REL * abs(value)
        up, down = values.copy(), values.copy()
        up[index] += step
        down[index] -= step
        gradient[index] = (figure(*up) - figure(*down)) / (2 * step)
    variance = float(gradient @ covariance @ gradient)
    own = gradient**2 * np.diag(covariance)
    restless = float(np.sum(own**2 / dofs)) if dofs is not None else 0.0
    dof = min(MOST_DOF, variance**2 / restless) if restless > 0.0 else MOST_DOF
    u = math.sqrt(max(0.0, variance))
    return Quantity(value=float(figure(*values)), standard_uncertainty=u, unit=unit), dof


@dataclass(frozen=True, kw_only=True)
class DarkNoise:
    """Variance sigma_y.dark^2 [DN^2] of the shortest dark stack, and the part of it due to rounding.

    Attributes
    ----------
    stack : Stack
        Shortest dark stack.
    variance_dn2, variance_u_dn2 : float
        Variance and its standard uncertainty [DN^2].
    dof : float
        Degrees of freedom of that uncertainty.
    rounding_dn2 : float
        Variance due to rounding, sigma_q^2 [DN^2].
    """

    stack: Stack
    variance_dn2: float
    variance_u_dn2: float
    dof: float
    rounding_dn2: float

    @property
    def rounding_dominates(self) -> bool:
        """True if rounding hides most of the noise."""
        return self.stack.changes is not None

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
        return math.sqrt(max(0.0, variance_dn2 - self.rounding_dn2))


def measure_dark_noise(stack: Stack) -> DarkNoise:
    """Read the dark noise off a stack of dark frames; sigma_q^2 = step^2 / 12.

    Parameters
    ----------
    stack : Stack
        Stack of at least two dark frames.

    Returns
    -------
    DarkNoise
        Variance and the part of it due to rounding. Where rounding hides the noise, it is that of
        `estimate_rounded_noise`; else the error of the rounding is added.
    """
    if stack.temporal is None or stack.pattern is None:
        raise AssertionError("a dark stack has at least two frames")
    rounding, step = stack.step_dn**2 / 12, stack.step_dn
    variance, u, dof = stack.temporal.value_dn2, stack.temporal.u_dn2, stack.temporal.dof
    if stack.changes is not None:
        alone = variance * math.sqrt(2.0 / ((len(stack.frames) - 1) * (stack.samples - 1)))
        noise, noise_u = estimate_rounded_noise(
            stack.changes,
            u_rel=max(1.0, u / alone) if alone else 1.0,
            spread=math.sqrt(max(0.0, stack.pattern.value_dn2)) / step,
        )
        variance, u, dof = (noise * step) ** 2 + rounding, 2.0 * noise * noise_u * step**2, math.inf
    else:
        by_rounding = estimate_rounding_error(math.sqrt(variance - rounding) / step) * step**2
        whole = math.hypot(u, by_rounding)
        u, dof = whole, dof * (whole / u) ** 4
    return DarkNoise(stack=stack, variance_dn2=variance, variance_u_dn2=u, dof=dof, rounding_dn2=rounding)


def find_read_noise_dn(dark: DarkNoise) -> Quantity:
    """Return the read noise [DN], which needs no gain.

    Returns
    -------
    Quantity
        Read noise [DN].
    """
    variance = np.array([dark.variance_dn2])
    return propagate(dark.read_noise_dn, variance, np.array([[dark.variance_u_dn2**2]]), unit="DN")[0]


def find_transfer_figures(
    dark: DarkNoise, transfer: Transfer, saturation: Saturation, *, dsnu_dn: Quantity
) -> tuple[TransferFigures, dict[str, float]]:
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
    tuple of (TransferFigures, dict of str to float)
        Coefficients with their uncertainties, and effective degrees of freedom by name.

    Notes
    -----
    With K [DN/e-] [1]_ (2.3 to 2.6, 6.6)::

        sigma_d = sqrt(sigma_y.dark^2 - sigma_q^2) / K,   mu_e.min = sigma_y.dark / K + 1/2,
        mu_e.sat = mu_sat / K,   SNR_max = sqrt(mu_e.sat),   DR = mu_e.sat / mu_e.min

    References
    ----------
    .. [1] EMVA Standard 1288, release 3.1
    """
    values = np.array([transfer.gain_dn_per_e, dark.variance_dn2, saturation.signal_dn])
    covariance = np.diag([transfer.gain_u**2, dark.variance_u_dn2**2, saturation.u_dn**2])
    if not dark.rounding_dominates:
        covariance[0, 1] = covariance[1, 0] = transfer.covariance_with(dark.stack)
    dofs = np.array([transfer.dof, dark.dof, math.inf])
    figures: dict[str, tuple[Callable[[float, float, float], float], str]] = {
        "system_gain_dn_per_e": (lambda k, _v, _top: k, "DN/e-"),
        "read_noise_e": (lambda k, v, _top: dark.read_noise_dn(v) / k, "e-"),
        "sensitivity_threshold_e": (lambda k, v, _top: _threshold_e(k, v), "e-"),
        "saturation_dn": (lambda _k, _v, top: top, "DN"),
        "full_well_e": (lambda k, _v, top: top / k, "e-"),
        "snr_max": (lambda k, _v, top: math.sqrt(top / k), "1"),
        "dynamic_range": (_ratio, "1"),
        "dynamic_range_db": (lambda k, v, top: 20 * math.log10(_ratio(k, v, top)), "dB"),
        "dynamic_range_stops": (lambda k, v, top: math.log2(_ratio(k, v, top)), "stop"),
    }
    found = {
        name: propagate(figure, values, covariance, unit=unit, dofs=dofs)
        for name, (figure, unit) in figures.items()
    }
    return TransferFigures(
        **{name: quantity for name, (quantity, _) in found.items()},
        saturation_origin=saturation.origin,
        dsnu_e=_per_gain(dsnu_dn, transfer, power=1, unit="e-"),
        levels_used=len(transfer.levels),
        birge_ratio=transfer.birge_ratio,
        chi_squared=transfer.chi_squared,
    ), {name: dof for name, (_, dof) in found.items()}


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
