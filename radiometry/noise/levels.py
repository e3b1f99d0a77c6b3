"""Levels of a photon transfer: lit stacks, each with its dark stack."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from radiometry.noise.rows import DARK, Params
from radiometry.noise.stacks import Stack


@dataclass(frozen=True, kw_only=True)
class Level:
    """Lit stack and its dark stack: the one of the same exposure time, else of the nearest.

    Attributes
    ----------
    lit : Stack
        Lit stack.
    dark : Stack
        Dark stack.
    signal_dn : float
        Mean above the mean of `dark` [DN]: electrons of light and, where the times
        differ, of dark current, which the photon transfer does not distinguish.
    light_dn, light_u_dn : float
        Mean above the dark signal of the same time, interpolated between dark stacks,
        and its standard uncertainty [DN]: the signal of light alone. Outside their
        times the nearest dark stack is used; what dark current adds up to that time is
        part of the uncertainty, if there are two times to estimate it from.
    time_ratio : float
        Factor by which the exposure time lies outside those of the dark stacks; 1
        within them.
    left_out : str
        Reason why its variance is not used at all; "" if it is used.
    """

    lit: Stack
    dark: Stack
    signal_dn: float
    light_dn: float
    light_u_dn: float
    time_ratio: float
    left_out: str

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
    """Return the dark stacks whose noise is known, the shortest time first.

    Parameters
    ----------
    stacks : sequence of Stack
        Stacks of frames.

    Returns
    -------
    list of Stack
        Dark stacks by exposure time.
    """
    darks = [stack for stack in stacks if stack.setting.role == DARK and stack.temporal is not None]
    return sorted(darks, key=lambda stack: (stack.setting.exposure_time_s, stack.setting))


def list_levels(stacks: Sequence[Stack], params: Params) -> tuple[Level, ...]:
    """Return every lit stack with its dark stack.

    Returns
    -------
    tuple of Level
        Levels in the order of signal; empty if no dark stack has a noise.
    """
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
