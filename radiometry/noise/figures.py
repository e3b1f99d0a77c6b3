"""Dark current, read noise, saturation and the figures that follow from them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Reason, shared
from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.frame.verdicts import TAKE_AGAIN, inspect_black
from radiometry.noise.results import DARK, DarkCurrentFigures, TransferFigures
from radiometry.noise.stacks import Stack, estimate_rounded_noise, estimate_rounding_error
from radiometry.noise.transfer import Saturation, Transfer

Vector = NDArray[np.float64]

# Of the span from black to white, above the darkest frame of the same ISO and time: black levels wander by a
# tenth of this
ABOVE_OTHERS_SHARE = 0.001


@dataclass(frozen=True, kw_only=True)
class DarkCurrent:
    """Dark current from the dark signal and from the dark noise."""

    from_mean: Quantity  # Slope of the dark signal's mean [DN/s]
    from_variance: Quantity | None  # Slope of the dark noise's variance [DN^2/s]; None if it is not known
    dof: float  # Degrees of freedom of the uncertainty of the first


def find_dark_current(stacks: Sequence[Stack]) -> DarkCurrent | None:
    """Fit mu_dark = mu_0 + mu_I t to the means of all dark frames, and a line to their stacks' variances.

    The dark current in DN and in electrons is [1] (section 7.1)::

        mu_I [DN/s] = slope of the mean,     mu_I [e-/s] = slope of the variance / K^2

    A frame's mean is weighted by the noise of its samples. Electronics move whole frames by more than that
    noise; where frames scatter more, the error grows with their scatter (Birge).

    [1] EMVA Standard 1288, release 3.1
    """
    darks = [stack for stack in stacks if stack.setting.role == DARK]
    noise = max((stack.temporal.value_dn2 for stack in darks if stack.temporal), default=0.0)
    points = [
        (
            stack.setting.exposure_time_s,
            mean,
            math.sqrt(_noise_dn2(stack, noise) / stack.samples),
        )
        for stack in darks
        for mean in stack.frame_means_dn
    ]
    line = _fit_slope(points)
    if line is None or noise <= 0.0:
        return None
    variances = [
        (stack.setting.exposure_time_s, stack.temporal.value_dn2, stack.temporal.u_dn2)
        for stack in darks
        if stack.temporal
    ]
    growing = _fit_slope(variances, fewest=2)
    return DarkCurrent(
        from_mean=Quantity(value=line[0], standard_uncertainty=line[1], unit="DN/s"),
        from_variance=Quantity(value=growing[0], standard_uncertainty=growing[1], unit="DN2/s")
        if growing
        else None,
        dof=line[2],
    )


def _noise_dn2(stack: Stack, otherwise: float) -> float:
    return stack.temporal.value_dn2 if stack.temporal else otherwise


def _fit_slope(
    points: Sequence[tuple[float, float, float]], *, fewest: int = 3
) -> tuple[float, float, float] | None:
    """Return slope, its standard uncertainty and degrees of freedom of a weighted line through (t, y, u)."""
    if len(points) < fewest or len({time for time, _, _ in points}) < 2:
        return None
    t, y, u = (np.array(column) for column in zip(*points, strict=True))
    if not np.all(u > 0.0):
        return None
    weights = 1.0 / u**2
    middle = float(weights @ t / weights.sum())
    spread = float(weights @ (t - middle) ** 2)
    slope = float(weights @ ((t - middle) * y)) / spread
    level = float(weights @ y / weights.sum())
    residual = y - level - slope * (t - middle)
    dof = len(points) - 2
    excess = max(1.0, float(weights @ residual**2) / dof) if dof else 1.0
    return slope, math.sqrt(excess / spread), float(dof) if excess > 1.0 else MOST_DOF


def find_not_dark(stack: Stack) -> dict[str, Reason]:
    """Return the reason for each frame of a dark stack that saw light.

    A warm sensor's signal grows with time, in all frames of one time alike. A noise campaign measures just
    this, so only a signal that no sensor reaches without light counts against the stated black level.
    """
    span = max(stack.white_level_dn - stack.black_level_dn, 1.0)
    darkest = min(stack.frame_means_dn)
    found = {}
    for frame, mean in zip(stack.frames, stack.frame_means_dn, strict=True):
        reason = inspect_black(mean, black_level_dn=stack.black_level_dn, white_level_dn=stack.white_level_dn)
        if mean - darkest > ABOVE_OTHERS_SHARE * span:
            detail = (
                f"Its mean is {mean - darkest:.3g} DN above that of a dark frame of the same ISO and time: "
                f"this one saw light. {TAKE_AGAIN}"
            )
            reason = shared.DARK_NOT_DARK.reason(detail)
        if reason is not None and reason.outcome == "fail":
            found[frame] = reason
    return found


_STEP_REL = 1e-5


def propagate(
    figure: Callable[..., float],
    values: NDArray[np.float64],
    covariance: NDArray[np.float64],
    *,
    unit: str,
    dofs: NDArray[np.float64] | None = None,
) -> tuple[Quantity, float]:
    """Compute a function of several inputs and its uncertainty: u^2 = g' V g (JCGM 100)."""
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
    """Variance sigma_y.dark^2 [DN^2] of the shortest dark stack, and the part of it due to rounding."""

    stack: Stack  # Shortest dark stack
    variance_dn2: float  # Variance and its standard uncertainty [DN^2]
    variance_u_dn2: float
    dof: float  # Degrees of freedom of that uncertainty
    rounding_dn2: float  # Variance due to rounding, sigma_q^2 [DN^2]

    @property
    def rounding_dominates(self) -> bool:
        """True if rounding hides most of the noise."""
        return self.stack.changes is not None

    def read_noise_dn(self, variance_dn2: float) -> float:
        """Return sqrt(sigma_y.dark^2 - sigma_q^2) [DN]."""
        return math.sqrt(max(0.0, variance_dn2 - self.rounding_dn2))


def measure_dark_noise(stack: Stack) -> DarkNoise:
    """Read the dark noise off a stack of dark frames; sigma_q^2 = step^2 / 12."""
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
    variance = np.array([dark.variance_dn2])
    return propagate(dark.read_noise_dn, variance, np.array([[dark.variance_u_dn2**2]]), unit="DN")[0]


def find_transfer_figures(
    dark: DarkNoise, transfer: Transfer, saturation: Saturation, *, dsnu_dn: Quantity
) -> tuple[TransferFigures, dict[str, float]]:
    """Compute the coefficients that follow from K, sigma_y.dark^2 and mu_sat.

    With K [DN/e-] [1] (2.3 to 2.6, 6.6)::

        sigma_d = sqrt(sigma_y.dark^2 - sigma_q^2) / K,   mu_e.min = sigma_y.dark / K + 1/2,
        mu_e.sat = mu_sat / K,   SNR_max = sqrt(mu_e.sat),   DR = mu_e.sat / mu_e.min

    [1] EMVA Standard 1288, release 3.1
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
    """Return the dark current in DN/s, and in e-/s if the gain is known."""
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
