"""One channel at one ISO value: linearity, nonuniformity and all figures."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.noise.results import ChannelFit, LevelResult, LinearityFigures, Params
from radiometry.noise.stacks import Stack, Variance
from radiometry.noise.transfer import (
    Level,
    Saturation,
    Transfer,
    find_dark_current,
    find_dark_current_figures,
    find_read_noise_dn,
    find_saturation,
    find_transfer_figures,
    fit_gain,
    list_darks,
    list_levels,
    measure_dark_noise,
)
from radiometry.records import Record

FEWEST_LEVELS = 4  # Two parameters, and two degrees of freedom to see a bend with. EMVA 1288 asks for nine.


class Linearity(Record):
    """Line of one scene and f-number, and the relative deviation of each level on which it rests."""

    figures: LinearityFigures
    deviations: tuple[tuple[Level, float], ...]


def find_linearity(
    levels: Sequence[Level],
    *,
    saturation_signal_dn: float,
    range_share: tuple[float, float],
    gain_dn_per_e: float,
) -> Linearity | None:
    """Fit y = a0 + a1 t to the scene that has most exposure times, and compute the deviations from it.

    Over 5 to 95 % of saturation [1] (section 6.7)::

        minimise sum (y_i - (a0 + a1 t_i))^2 / y_i^2,     delta_i = y_i / (a0 + a1 t_i) - 1,
        LE = mean |delta_i|

    The light must be the same at all times, so levels of another scene or f-number do not enter. u(LE) is
    that of the noise of the means; without any nonlinearity LE is that noise.

    [1] EMVA Standard 1288, release 3.1
    """
    low, high = (share * saturation_signal_dn for share in range_share)
    usable = [level for level in levels if not level.lit.clipped and low <= level.light_dn <= high]
    series = [
        members
        for members in _group(usable)
        if len({member.lit.setting.exposure_time_s for member in members}) >= FEWEST_LEVELS
    ]
    if not series:
        return None
    longest = max(series, key=len)  # of equally long ones the first by role and scene
    t = np.array([level.lit.setting.exposure_time_s for level in longest])
    y = np.array([level.light_dn for level in longest])
    design = np.column_stack([np.ones_like(t), t]) / y[:, None]
    hat = design @ np.linalg.pinv(design)
    a0, a1 = np.linalg.pinv(design) @ np.ones_like(y)
    line = a0 + a1 * t
    deviations = y / line - 1.0
    relative_u = np.array([_mean_u_dn(level, gain_dn_per_e) for level in longest]) / y
    effect = np.sign(deviations) @ (np.eye(len(y)) - hat) / len(y)
    return Linearity(
        figures=LinearityFigures(
            error_rel=Quantity(
                float(np.mean(np.abs(deviations))), float(np.linalg.norm(effect * relative_u)), "1"
            ),
            lowest_rel=float(deviations.min()),
            highest_rel=float(deviations.max()),
            levels_used=len(longest),
        ),
        deviations=tuple(zip(longest, deviations.tolist(), strict=True)),
    )


def _group(levels: Sequence[Level]) -> list[list[Level]]:
    def key(level: Level) -> tuple[str, str, float]:
        setting = level.lit.setting
        return setting.role, setting.scene, setting.f_number

    return [list(group) for _, group in itertools.groupby(sorted(levels, key=key), key=key)]


def _mean_u_dn(level: Level, gain_dn_per_e: float) -> float:
    """Return the noise of a level's mean; for a single frame by the photon transfer."""
    if level.lit.temporal is not None:
        return level.light_u_dn
    dark = level.dark.temporal.value_dn2 if level.dark.temporal else 0.0
    variance = (dark + gain_dn_per_e * level.signal_dn) / level.lit.samples
    return math.sqrt(variance + level.light_u_dn**2)


# EMVA 1288 takes a level at 50 % of saturation; in the field it is the one of most frames within these, of
# equals the nearest to 50 %
PRNU_RANGE_SHARE = (0.3, 0.7)

_RESOLVED_IN_ERRORS = 2.0


def find_dsnu(stacks: Sequence[Stack]) -> tuple[Quantity, bool] | None:
    """Compute DSNU = sqrt(s^2_dark) [DN] of the dark stack with most frames.

    [1] (section 8.2) divides by K for electrons. Nothing slow is removed: glow and banding are part of it.

    [1] EMVA Standard 1288, release 3.1
    """
    darks = list_darks(stacks)
    if not darks:
        return None
    stack = max(darks, key=lambda each: len(each.frames))  # of equals the shortest time
    if stack.pattern is None:
        raise AssertionError("a stack with a temporal variance has a spatial one")
    return _root(stack.pattern, unit="DN"), _is_resolved(stack.pattern)


def find_prnu(levels: Sequence[Level], *, saturation_signal_dn: float) -> tuple[Quantity, bool] | None:
    """Compute PRNU = sqrt(s^2_50 - s^2_dark) / (mu_50 - mu_dark) about half of saturation.

    [1] (section 8.2) defines it for equally lit pixels. Behind a lens the light is not even, so a
    quadratic surface is removed from both mean images. It holds for a block of at most 96 samples, not for
    the whole frame.

    [1] EMVA Standard 1288, release 3.1
    """
    low, high = (share * saturation_signal_dn for share in PRNU_RANGE_SHARE)
    usable = [level for level in levels if not level.left_out and low <= level.light_dn <= high]
    if not usable:
        return None
    level = min(
        usable, key=lambda each: (-len(each.lit.frames), abs(each.light_dn - saturation_signal_dn / 2))
    )
    lit, dark = level.lit.detrended, level.dark.detrended
    if lit is None or dark is None:
        raise AssertionError("a stack with a temporal variance has a spatial one")
    pattern = Variance(value_dn2=lit.value_dn2 - dark.value_dn2, u_dn2=math.hypot(lit.u_dn2, dark.u_dn2))
    root = _root(pattern, unit="1")
    return (
        Quantity(root.value / level.light_dn, root.standard_uncertainty / level.light_dn, "1"),
        _is_resolved(pattern),
    )


def _root(variance: Variance, *, unit: str) -> Quantity:
    """Return the root with its uncertainty: u / (2 s), and near zero how far one error more would reach."""
    root = math.sqrt(max(0.0, variance.value_dn2))
    if _is_resolved(variance):
        u = variance.u_dn2 / (2.0 * root)
    else:
        u = math.sqrt(max(0.0, variance.value_dn2) + variance.u_dn2) - root
    return Quantity(root, u, unit)


def _is_resolved(variance: Variance) -> bool:
    return variance.value_dn2 > _RESOLVED_IN_ERRORS * variance.u_dn2


class FittedChannel(Record):
    """Coefficients of a channel, with the values from which the flags are raised."""

    fit: ChannelFit
    stacks: tuple[Stack, ...]
    levels: tuple[Level, ...]
    transfer: Transfer | None
    rounding_dominates: bool
    dsnu_resolved: bool
    prnu_resolved: bool


def fit_channel(stacks: Sequence[Stack], params: Params) -> FittedChannel | None:
    """Evaluate one channel at one ISO value."""
    darks, dsnu = list_darks(stacks), find_dsnu(stacks)
    if not darks or dsnu is None:
        return None
    dark, levels = measure_dark_noise(darks[0]), list_levels(stacks, params)
    saturation = find_saturation(
        levels,
        white_signal_dn=darks[0].white_level_dn - darks[0].mean_dn,
        largest_drift_rel=params.largest_drift_rel,
    )
    transfer = fit_gain(levels, saturation, range_share=params.gain_range_share)
    linearity, prnu = _look_at_light(levels, saturation, transfer, params)
    figures, dofs = (
        find_transfer_figures(dark, transfer, saturation, dsnu_dn=dsnu[0]) if transfer else (None, {})
    )
    current = find_dark_current(stacks)
    fit = ChannelFit(
        iso=darks[0].setting.iso,
        channel=darks[0].setting.channel,
        dark_signal_dn=darks[0].mean_dn,
        read_noise_dn=find_read_noise_dn(dark),
        dsnu_dn=dsnu[0],
        prnu_rel=prnu[0] if prnu else None,
        transfer=figures,
        linearity=linearity.figures if linearity else None,
        dark_current=find_dark_current_figures(current, transfer),
        levels=tuple(_describe(level, transfer, linearity, saturation, params) for level in levels),
        effective_dof=dofs
        | {"read_noise_dn": min(MOST_DOF, dark.dof)}
        | ({f"dark_current_{unit}_per_s": current.dof for unit in ("dn", "e")} if current else {}),
    )
    return FittedChannel(
        fit=fit,
        stacks=tuple(stacks),
        levels=levels,
        transfer=transfer,
        rounding_dominates=dark.rounding_dominates,
        dsnu_resolved=dsnu[1],
        prnu_resolved=prnu[1] if prnu else True,
    )


def _look_at_light(
    levels: Sequence[Level], saturation: Saturation, transfer: Transfer | None, params: Params
) -> tuple[Linearity | None, tuple[Quantity, bool] | None]:
    """Return linearity and PRNU, whose ranges mean nothing without a photon transfer."""
    if transfer is None:
        return None, None
    linearity = find_linearity(
        levels,
        saturation_signal_dn=saturation.signal_dn,
        range_share=params.linearity_range_share,
        gain_dn_per_e=transfer.gain_dn_per_e,
    )
    return linearity, find_prnu(levels, saturation_signal_dn=saturation.signal_dn)


def _describe(
    level: Level,
    transfer: Transfer | None,
    linearity: Linearity | None,
    saturation: Saturation,
    params: Params,
) -> LevelResult:
    lit, dark, setting = level.lit.temporal, level.dark.temporal, level.lit.setting
    excess = level.excess_dn2 if lit and dark else None
    used = transfer is not None and any(each is level for each in transfer.levels)
    deviations = linearity.deviations if linearity else ()
    return LevelResult(
        role=setting.role,
        scene=setting.scene,
        f_number=setting.f_number,
        exposure_time_s=setting.exposure_time_s,
        frames=len(level.lit.frames),
        signal_dn=level.signal_dn,
        light_dn=level.light_dn,
        excess_dn2=excess,
        excess_u_dn2=math.hypot(lit.u_dn2, dark.u_dn2) if lit and dark else None,
        **_describe_snr(level),
        residual_dn2=excess - transfer.gain_dn_per_e * level.signal_dn
        if transfer and excess is not None
        else None,
        deviation_rel=next((deviation for each, deviation in deviations if each is level), None),
        left_out="" if used else level.left_out or _explain(level, saturation, params),
    )


def _describe_snr(level: Level) -> dict[str, float | None]:
    lit = level.lit.temporal
    if lit is None or lit.value_dn2 <= 0.0:
        return {"snr": None, "snr_standard_uncertainty": None}
    noise = math.sqrt(lit.value_dn2)
    relative = lit.u_dn2 / lit.value_dn2 / 2
    u = math.hypot(level.light_dn * relative, level.light_u_dn) / noise
    return {"snr": level.light_dn / noise, "snr_standard_uncertainty": u}


def _explain(level: Level, saturation: Saturation, params: Params) -> str:
    if level.signal_dn <= 0.0:
        return "it is not brighter than its dark frames"
    share = level.signal_dn / saturation.signal_dn
    if share > params.gain_range_share:
        end = params.gain_range_share
        return f"its signal is {share:.0%} of saturation: the photon transfer ends at {end:.0%}"
    return "too few levels for a photon transfer"
