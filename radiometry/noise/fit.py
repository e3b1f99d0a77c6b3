"""Evaluation of one channel at one ISO value, from its stacks to every coefficient."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.noise.darkness import find_dark_current
from radiometry.noise.figures import (
    find_dark_current_figures,
    find_read_noise_dn,
    find_transfer_figures,
    measure_dark_noise,
)
from radiometry.noise.levels import Level, list_darks, list_levels
from radiometry.noise.linearity import Linearity, find_linearity
from radiometry.noise.nonuniformity import find_dsnu, find_prnu
from radiometry.noise.results import ChannelFit, LevelResult, LinearityFigures
from radiometry.noise.rows import Params
from radiometry.noise.stacks import Stack
from radiometry.noise.transfer import Saturation, Transfer, find_saturation, fit_gain


@dataclass(frozen=True, kw_only=True)
class FittedChannel:
    """Coefficients of a channel, with the values from which the flags are raised."""

    fit: ChannelFit
    stacks: tuple[Stack, ...]
    levels: tuple[Level, ...]
    transfer: Transfer | None
    rounding_dominates: bool
    dsnu_resolved: bool
    prnu_resolved: bool


def fit_channel(stacks: Sequence[Stack], params: Params) -> FittedChannel | None:
    """Evaluate one channel at one ISO value.

    Parameters
    ----------
    stacks : sequence of Stack
        Stacks of the channel at the ISO value.
    params : Params
        Parameters of the fit.

    Returns
    -------
    FittedChannel or None
        None if no pair of dark frames shows the noise of the channel.
    """
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
        linearity=_show(linearity) if linearity else None,
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


def _show(linearity: Linearity) -> LinearityFigures:
    return LinearityFigures(
        error_rel=linearity.error,
        lowest_rel=linearity.lowest_rel,
        highest_rel=linearity.highest_rel,
        levels_used=len(linearity.deviations),
    )


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
        deviation_rel=next((each.deviation_rel for each in deviations if each.level is level), None),
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
