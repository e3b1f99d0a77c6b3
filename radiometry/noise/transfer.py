"""Levels of light, and the photon transfer through them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.noise.results import DARK, Params, SaturationOrigin
from radiometry.noise.stacks import Stack


@dataclass(frozen=True, kw_only=True)
class Level:
    """Lit stack and its dark stack: the one of the same exposure time, else of the nearest."""

    lit: Stack
    dark: Stack
    # Mean above the mean of `dark` [DN]: electrons of light and, where the times differ, of dark current,
    # which the photon transfer does not distinguish
    signal_dn: float
    # Mean above the dark signal of the same time, interpolated between dark stacks, and its standard
    # uncertainty [DN]: the signal of light alone. Outside their times the nearest dark stack is used; what
    # dark current adds up to that time is part of the uncertainty, if there are two times to estimate it
    # from.
    light_dn: float
    light_u_dn: float
    # Factor by which the exposure time lies outside those of the dark stacks; 1 within them
    time_ratio: float
    left_out: str  # Reason why its variance is not used at all; "" if it is used

    @property
    def signal_u_dn(self) -> float:
        """Standard uncertainty of the signal [DN], from the noise of the samples of both stacks."""
        return math.sqrt(self.lit.mean_variance_dn2 + self.dark.mean_variance_dn2)

    @property
    def excess_dn2(self) -> float:
        """Temporal variance that light adds [DN^2]; defined only for a level that is not left out."""
        if self.lit.temporal is None or self.dark.temporal is None:
            raise AssertionError("a level without a variance is left out")
        return self.lit.temporal.value_dn2 - self.dark.temporal.value_dn2


def list_darks(stacks: Sequence[Stack]) -> list[Stack]:
    """Return the dark stacks whose noise is known, the shortest time first."""
    darks = [stack for stack in stacks if stack.setting.role == DARK and stack.temporal is not None]
    return sorted(darks, key=lambda stack: (stack.setting.exposure_time_s, stack.setting))


def list_levels(stacks: Sequence[Stack], params: Params) -> tuple[Level, ...]:
    """Return every lit stack with its dark stack."""
    darks = list_darks(stacks)
    if not darks:
        return ()
    levels = [_pair(lit, darks, params) for lit in stacks if lit.setting.role != DARK]
    return tuple(sorted(levels, key=lambda level: (level.signal_dn, level.lit.setting)))


def _pair(lit: Stack, darks: Sequence[Stack], params: Params) -> Level:
    time_s = lit.setting.exposure_time_s
    dark = min(darks, key=lambda each: abs(math.log(each.setting.exposure_time_s / time_s)))
    below, above, share = _find_neighbours(darks, time_s)
    expected = (1.0 - share) * below.mean_dn + share * above.mean_dn
    variance = (1.0 - share) ** 2 * below.mean_variance_dn2 + share**2 * above.mean_variance_dn2
    shortest, longest = darks[0].setting.exposure_time_s, darks[-1].setting.exposure_time_s
    return Level(
        lit=lit,
        dark=dark,
        signal_dn=lit.mean_dn - dark.mean_dn,
        light_dn=lit.mean_dn - expected,
        light_u_dn=math.sqrt(lit.mean_variance_dn2 + variance + _estimate_drift(darks, time_s) ** 2),
        time_ratio=max(1.0, shortest / time_s, time_s / longest),
        left_out=_judge(lit, params),
    )


def _estimate_drift(darks: Sequence[Stack], time_s: float) -> float:
    """Estimate how far the dark signal moves from the nearest dark stack to a time outside theirs [DN]."""
    first, last = darks[0], darks[-1]
    shortest, longest = first.setting.exposure_time_s, last.setting.exposure_time_s
    outside_s = max(shortest - time_s, time_s - longest, 0.0)
    if shortest == longest:
        return 0.0
    return outside_s * abs(last.mean_dn - first.mean_dn) / (longest - shortest)


def _find_neighbours(darks: Sequence[Stack], time_s: float) -> tuple[Stack, Stack, float]:
    """Return the dark stacks about a time and how far it lies from the first to the second, 0 to 1."""
    below = [dark for dark in darks if dark.setting.exposure_time_s <= time_s]
    above = [dark for dark in darks if dark.setting.exposure_time_s >= time_s]
    if not below or not above:
        only = (below or above)[-1 if below else 0]
        return only, only, 0.0
    first, second = below[-1], above[0]
    span = second.setting.exposure_time_s - first.setting.exposure_time_s
    return first, second, (time_s - first.setting.exposure_time_s) / span if span else 0.0


def _judge(lit: Stack, params: Params) -> str:
    if lit.clipped:
        return f"{lit.clipped_share:.2%} of its samples are at white: its noise is cut off"
    if lit.temporal is None:
        return "no other frame has its role, scene, ISO, time and f-number: without a pair no noise is seen"
    if lit.temporal.value_dn2 <= 0.0:
        return "its frames do not differ at all: they show no noise"
    if lit.drift_rel > params.largest_drift_rel:
        return f"the light changed by {lit.drift_rel:.1%} between its frames"
    return ""


FEWEST_LEVELS = 3
_ROUNDS = 20
_RELATIVE_TOLERANCE = 1e-12
_FALL_IN_ERRORS = 3.0
_COLLAPSED = 0.5  # Of the greatest variance: what is below it lies on a plateau


@dataclass(frozen=True, kw_only=True)
class Saturation:
    """End of the signal [DN above dark]."""

    signal_dn: float  # Signal at saturation [DN above dark]
    u_dn: float  # Its standard uncertainty, from the spacing of the levels or the width of the noise [DN]
    # "white_level": a level reaches white; "variance_maximum": the variance falls again below it;
    # "white_level_assumed": no level came near either
    origin: SaturationOrigin


@dataclass(frozen=True, kw_only=True)
class Transfer:
    """System gain, and what its error shares with the dark noise."""

    gain_dn_per_e: float  # Gain K [DN/e-] and its standard uncertainty, with the Birge ratio
    gain_u: float
    birge_ratio: float  # Birge ratio, 1 or more
    chi_squared: float  # Weighted sum of squared residuals
    dof: float  # Degrees of freedom of `gain_u`
    weights: tuple[float, ...]  # Weight of each level's excess variance in K
    levels: tuple[Level, ...]  # Levels that entered the fit

    def covariance_with(self, dark: Stack) -> float:
        """Return cov(K, sigma_dark^2) [DN^3/e-].

        K falls by the weights of the levels that the dark stack serves.
        """
        if dark.temporal is None:
            return 0.0
        served = [w for w, level in zip(self.weights, self.levels, strict=True) if level.dark is dark]
        return -math.fsum(served) * dark.temporal.u_dn2**2


def find_saturation(
    levels: Sequence[Level], *, white_signal_dn: float, largest_drift_rel: float = math.inf
) -> Saturation:
    """Find where the temporal variance has its maximum [1] (6.6).

    Levels whose variance is within three errors of the greatest may all be the maximum. It lies between the
    levels beside them, b and a. Levels may be a fifth apart in the field. Where the signal ends sharply, at
    white or at a full well whose plateau brighter levels show, the maximum is computed: that of

        E[s^2(m) v((end - m) / s(m))],    s^2(m) = variance at the maximum * m / signal at the maximum,

    over the pixels' own levels m, with v(h) the variance of a standard normal number that is cut off at h. It
    is taken if it lies between b and a, with the spread of noise and pixels as a rectangle; else the
    greatest sampled variance, with (a - b) / 2.

    [1] EMVA Standard 1288, release 4.0
    """
    seen = [
        (level, level.lit.temporal)
        for level in levels
        if level.lit.temporal and level.signal_dn > 0.0 and level.lit.drift_rel <= largest_drift_rel
    ]
    clipped = any(level.lit.clipped for level, _ in seen)
    if not seen:
        return Saturation(signal_dn=white_signal_dn, u_dn=0.0, origin="white_level_assumed")
    top, highest = max(seen, key=lambda pair: pair[1].value_dn2)
    near = [
        highest.value_dn2 - each.value_dn2 <= _FALL_IN_ERRORS * math.hypot(each.u_dn2, highest.u_dn2)
        for _, each in seen
    ]
    first, last = near.index(True), len(near) - 1 - near[::-1].index(True)
    falls = len(seen) > FEWEST_LEVELS and last < len(seen) - 1
    plateau = falls and seen[-1][1].value_dn2 < _COLLAPSED * highest.value_dn2
    end_dn = seen[-1][0].signal_dn if plateau and not clipped else white_signal_dn
    expected, width = _expect_maximum(top, highest.value_dn2, end_dn)
    low_dn = seen[first - 1][0].signal_dn if first else 0.0
    high_dn = seen[last + 1][0].signal_dn if falls else math.inf
    if falls and not ((plateau or clipped) and low_dn <= expected <= high_dn):
        u_dn = (high_dn - low_dn) / 2.0 / math.sqrt(3.0)
        return Saturation(signal_dn=top.signal_dn, u_dn=u_dn, origin="variance_maximum")
    origin: SaturationOrigin = "variance_maximum" if plateau else "white_level_assumed"
    return Saturation(
        signal_dn=expected, u_dn=width / math.sqrt(3.0), origin="white_level" if clipped else origin
    )


def _expect_maximum(top: Level, variance_dn2: float, end_dn: float) -> tuple[float, float]:
    """Return the signal of the greatest variance below a sharp end, and the spread of numbers there [DN]."""
    slope = variance_dn2 / top.signal_dn
    pattern = max(0.0, top.lit.pattern.value_dn2) if top.lit.pattern else 0.0
    pixels = math.sqrt(pattern) * end_dn / top.signal_dn
    width = math.hypot(math.sqrt(slope * end_dn), pixels)
    mean = np.maximum(end_dn - np.linspace(-1.0, 6.0, 281) * width, end_dn / 100.0)
    nodes, weights = np.polynomial.hermite_e.hermegauss(21)
    own = np.maximum(mean[:, None] + pixels * nodes, end_dn / 100.0)
    noise = np.sqrt(slope * own)
    h = (end_dn - own) / noise
    below, density = scipy.special.ndtr(h), np.exp(-(h**2) / 2.0) / math.sqrt(2.0 * math.pi)
    first = h * (1.0 - below) - density
    second = below - h * density + h**2 * (1.0 - below)
    weights = weights / weights.sum()
    best = int(np.argmax((noise**2 * (second - first**2)) @ weights))
    return float((own + noise * first)[best] @ weights), width


def fit_gain(levels: Sequence[Level], saturation: Saturation, *, range_share: float) -> Transfer | None:
    """Fit the line through the origin whose slope is K, by generalised least squares.

    The line is [1] (eq. 15)::

        sigma_y^2 - sigma_dark^2 = K (mu_y - mu_dark)
        V_ij = [i = j] (2 sigma_i^4 / nu_i + K^2 u(x_i)^2) + [same dark] 2 sigma_dark^4 / nu_dark

    up to `range_share` of saturation. The sigma_i in V are those of the line, not the measured ones: a
    level whose noise came out small by chance must not get a larger weight for it. chi^2 / (n - 1) above 1
    enlarges u(K).

    [1] EMVA Standard 1288, release 4.0
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
        dof=float(len(used) - 1) if birge > 1.0 else math.inf,
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
