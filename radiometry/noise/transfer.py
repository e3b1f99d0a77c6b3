"""Photon transfer: system gain from the growth of the noise with the signal, and saturation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.noise.levels import Level
from radiometry.noise.stacks import Stack

FEWEST_LEVELS = 3
_ROUNDS = 20
_RELATIVE_TOLERANCE = 1e-12
_FALL_IN_ERRORS = 3.0

SaturationOrigin = Literal["white_level", "variance_maximum", "white_level_assumed"]


@dataclass(frozen=True, kw_only=True)
class Saturation:
    """End of the signal [DN above dark].

    Attributes
    ----------
    signal_dn : float
        Signal at saturation [DN above dark].
    u_dn : float
        For a variance maximum, standard uncertainty from the spacing of the levels
        [DN]; else 0, and the noise adds to it later.
    origin : SaturationOrigin
        "white_level": a level reaches white; "variance_maximum": the variance falls
        again below it; "white_level_assumed": no level came near either.
    """

    signal_dn: float
    u_dn: float
    origin: SaturationOrigin


@dataclass(frozen=True, kw_only=True)
class Transfer:
    """System gain, and what its error shares with the dark noise.

    Attributes
    ----------
    gain_dn_per_e, gain_u : float
        Gain K [DN/e-] and its standard uncertainty, with the Birge ratio.
    birge_ratio : float
        Birge ratio, 1 or more.
    chi_squared : float
        Weighted sum of squared residuals.
    weights : tuple of float
        Weight of each level's excess variance in K.
    levels : tuple of Level
        Levels that entered the fit.
    """

    gain_dn_per_e: float
    gain_u: float
    birge_ratio: float
    chi_squared: float
    weights: tuple[float, ...]
    levels: tuple[Level, ...]

    def covariance_with(self, dark: Stack) -> float:
        """Return cov(K, sigma_dark^2) [DN^3/e-].

        K falls by the weights of the levels that the dark stack serves.

        Parameters
        ----------
        dark : Stack
            Dark stack.

        Returns
        -------
        float
            Covariance [DN^3/e-].
        """
        if dark.temporal is None:
            return 0.0
        served = [w for w, level in zip(self.weights, self.levels, strict=True) if level.dark is dark]
        return -math.fsum(served) * dark.temporal.u_dn2**2


def find_saturation(levels: Sequence[Level], *, white_signal_dn: float) -> Saturation:
    """Find where the temporal variance has its maximum [1]_ (6.6), or where the numbers end.

    Parameters
    ----------
    levels : sequence of Level
        Levels in the order of signal.
    white_signal_dn : float
        White level above dark [DN].

    Returns
    -------
    Saturation
        Signal at saturation and how it was found.

    Notes
    -----
    Levels may be a fifth apart in the field. If the brighter ones are cut off by white, the maximum lies at
    white itself, within two standard deviations of noise.

    References
    ----------
    .. [1] EMVA Standard 1288, release 3.1
    """
    if any(level.lit.clipped for level in levels):
        return Saturation(signal_dn=white_signal_dn, u_dn=0.0, origin="white_level")
    seen = [level for level in levels if not level.left_out and level.lit.temporal]
    variances = [level.lit.temporal for level in seen if level.lit.temporal]
    if len(seen) > FEWEST_LEVELS:
        top = max(range(len(seen)), key=lambda index: variances[index].value_dn2)
        last = variances[-1]
        fall = variances[top].value_dn2 - last.value_dn2
        if fall > _FALL_IN_ERRORS * math.hypot(variances[top].u_dn2, last.u_dn2):
            below = seen[max(0, top - 1)].signal_dn
            above = seen[min(len(seen) - 1, top + 1)].signal_dn
            return Saturation(
                signal_dn=seen[top].signal_dn,
                u_dn=(above - below) / 2 / math.sqrt(3.0),
                origin="variance_maximum",
            )
    return Saturation(signal_dn=white_signal_dn, u_dn=0.0, origin="white_level_assumed")


def fit_gain(levels: Sequence[Level], saturation: Saturation, *, range_share: float) -> Transfer | None:
    """Fit the line through the origin whose slope is K, by generalised least squares.

    Parameters
    ----------
    levels : sequence of Level
        Levels of one channel at one ISO value.
    saturation : Saturation
        Saturation of the channel.
    range_share : float
        Upper end of the fit, as a fraction of saturation.

    Returns
    -------
    Transfer or None
        None if fewer than three levels are left, or if the noise does not grow with the
        signal.

    Notes
    -----
    The line is [1]_ (eq. 15)::

        sigma_y^2 - sigma_dark^2 = K (mu_y - mu_dark)
        V_ij = [i = j] (2 sigma_i^4 / nu_i + K^2 u(x_i)^2) + [same dark] 2 sigma_dark^4 / nu_dark

    up to `range_share` of saturation. The sigma_i in V are those of the line, not the measured ones: a
    level whose noise came out small by chance must not get a larger weight for it. chi^2 / (n - 1) above 1
    enlarges u(K).

    References
    ----------
    .. [1] EMVA Standard 1288, release 3.1
    """
    used = tuple(
        level
        for level in levels
        if not level.left_out and 0.0 < level.signal_dn <= range_share * saturation.signal_dn
    )
    if len(used) < FEWEST_LEVELS:
        return None
    x = np.array([level.signal_dn for level in used])
    y = np.array([level.excess_dn2 for level in used])
    gain = float(y.sum() / x.sum())
    for _ in range(_ROUNDS):
        if gain <= 0.0:
            return None
        inverse = np.linalg.inv(_covariance(used, x, gain))
        information = float(x @ inverse @ x)
        weights = inverse @ x / information
        converged = abs(float(weights @ y) - gain) <= _RELATIVE_TOLERANCE * gain
        gain = float(weights @ y)
        if converged:
            break
    residual = y - gain * x
    chi_squared = float(residual @ inverse @ residual)
    birge = math.sqrt(max(1.0, chi_squared / (len(used) - 1)))
    if gain <= 0.0:
        return None
    return Transfer(
        gain_dn_per_e=gain,
        gain_u=birge / math.sqrt(information),
        birge_ratio=birge,
        chi_squared=chi_squared,
        weights=tuple(float(weight) for weight in weights),
        levels=used,
    )


def _covariance(used: Sequence[Level], x: NDArray[np.float64], gain: float) -> NDArray[np.float64]:
    n = len(used)
    covariance = np.zeros((n, n))
    for i, level in enumerate(used):
        lit, dark = level.lit.temporal, level.dark.temporal
        if lit is None or dark is None:
            raise AssertionError("a level without a variance is left out")
        relative = lit.u_dn2 / lit.value_dn2
        own = relative * (dark.value_dn2 + gain * float(x[i]))
        covariance[i, i] += own**2 + (gain * level.signal_u_dn) ** 2
        for j, other in enumerate(used):
            if other.dark is level.dark:
                covariance[i, j] += dark.u_dn2**2
    return covariance
