"""The photon transfer of one channel, and the figures that follow from it and from dark stacks."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.findings import Reason, shared
from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.frame.verdicts import TAKE_AGAIN, inspect_black
from radiometry.noise.results import DARK, DarkCurrentFigures, Params, SaturationOrigin, TransferFigures
from radiometry.noise.stacks import Image, Stack, Variance, estimate_rounded_noise, estimate_rounding_error
from radiometry.records import Record


class Level(Record):
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
_SOFTNESS = np.geomspace(1e-3, 0.15, 13)  # Of a full well's end, relative to it
# By how much the variance near an end may differ from that of the form; and u from wells of another form (a
# parabola between line and end), of what the softness lowers the maximum.
_VARIANCE_U, _FORM_SHARE = 0.03, 0.15
_NINE, _FORTY = ((np.arange(n) + 0.5) / n for n in (9, 40))
_COLLAPSED = 0.5  # Of the greatest variance: what is below it lies on a plateau


class Saturation(Record):
    """End of the signal [DN above dark]."""

    signal_dn: float  # Signal at saturation [DN above dark]
    u_dn: float  # Its standard uncertainty, from the spacing of the levels or the width of the noise [DN]
    # "white_level": a level reaches white; "variance_maximum": the variance falls again below it;
    # "white_level_assumed": no level came near either
    origin: SaturationOrigin


class Transfer(Record):
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

    over the pixels' own levels m, with v(h) the variance of a standard normal number that is cut off at h. If
    it lies between b and a, it is taken at white, with the spread of noise and pixels as a rectangle. A full
    well whose plateau brighter levels show may end softly (see `_weigh_softness`). Else the greatest sampled
    variance is taken, with (a - b) / 2.

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
    if plateau and not clipped:
        signal_dn, spread_dn = _weigh_softness(seen, top, end_dn)
        u_dn = math.hypot(width / math.sqrt(12.0), spread_dn)
        return Saturation(signal_dn=signal_dn, u_dn=u_dn, origin="variance_maximum")
    low_dn = seen[first - 1][0].signal_dn if first else 0.0
    high_dn = seen[last + 1][0].signal_dn if falls else math.inf
    if falls and not (clipped and low_dn <= expected <= high_dn):
        u_dn = (high_dn - low_dn) / 2.0 / math.sqrt(3.0)
        return Saturation(signal_dn=top.signal_dn, u_dn=u_dn, origin="variance_maximum")
    origin: SaturationOrigin = "white_level" if clipped else "white_level_assumed"
    return Saturation(signal_dn=expected, u_dn=width / math.sqrt(3.0), origin=origin)


def _weigh_softness(seen: Sequence[tuple[Level, Variance]], top: Level, end_dn: float) -> tuple[float, float]:
    """Return the signal of the greatest variance below an end of unknown softness, and its uncertainty [DN].

    Each softness has the weight with which the levels above half of the end show the variance that it makes
    of their mean, exp(-chi^2 / 2), where all are as likely before. The form of the end is not known: a share
    of what softness lowers the maximum is part of the uncertainty.
    """
    usual = [pair for pair in seen if pair[0].signal_dn < 0.7 * end_dn] or seen[:1]
    slope = float(np.median([each.value_dn2 / level.signal_dn for level, each in usual]))
    spread = math.sqrt(max(0.0, top.lit.pattern.value_dn2)) / top.signal_dn if top.lit.pattern else 0.0
    shown = [(level, each) for level, each in seen if 0.5 * end_dn < level.signal_dn < end_dn]
    maxima, misfits = [], []
    for softness in _SOFTNESS:
        means, variances = _trace_end(slope, spread, end_dn, softness)
        maxima.append(float(means[variances.argmax()]))
        # a soft end begins to take from the variance far below it
        variances *= np.median(
            [each.value_dn2 / np.interp(level.signal_dn, means, variances) for level, each in usual]
        )
        misfits.append(
            math.fsum(
                (each.value_dn2 - float(np.interp(level.signal_dn, means, variances))) ** 2
                / (each.u_dn2**2 + (_VARIANCE_U * slope * end_dn) ** 2)
                for level, each in shown
            )
        )
    weights = np.exp((min(misfits) - np.array(misfits)) / 2.0)
    weights /= weights.sum()
    value = float(weights @ maxima)
    form = _FORM_SHARE * (maxima[0] - value)
    return value, math.hypot(math.sqrt(float(weights @ (np.array(maxima) - value) ** 2)), form)


def _trace_end(slope: float, spread: float, end_dn: float, softness: float) -> tuple[Image, Image]:
    """Return mean and variance from frame to frame of rising light up to an end [DN], by quantiles.

    Light x fills end - s ln(1 + exp((end - x) / s)), s = `softness` end; ``spread``: that of the pixels.
    """
    light = end_dn * np.linspace(0.0, 1.3, 262)[1:, None, None]
    own = light * (1.0 + spread * scipy.special.ndtri(_NINE)[:, None])
    missing = end_dn - own - np.sqrt(slope * own) * scipy.special.ndtri(_FORTY)
    seen = end_dn - softness * end_dn * np.logaddexp(0.0, missing / (softness * end_dn))
    return seen.mean(axis=(1, 2)), seen.var(axis=2).mean(axis=1)


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


# Of the span from black to white, above the darkest frame of the same ISO and time: black levels wander by a
# tenth of this
ABOVE_OTHERS_SHARE = 0.001


class DarkCurrent(Record):
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
            math.sqrt((stack.temporal.value_dn2 if stack.temporal else noise) / stack.samples),
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
        from_mean=Quantity(line[0], line[1], "DN/s"),
        from_variance=Quantity(growing[0], growing[1], "DN2/s") if growing else None,
        dof=line[2],
    )


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
    return Quantity(float(figure(*values)), u, unit), dof


class DarkNoise(Record):
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
        quantity.value / per_e, math.hypot(quantity.standard_uncertainty, from_gain) / per_e, unit
    )
