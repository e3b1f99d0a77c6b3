"""Flags of a noise fit."""

import math
from collections.abc import Sequence

from radiometry.findings import Finding, Raised, shared
from radiometry.frame.darkness import flag_assumed_black, name_not_dark
from radiometry.noise import codes
from radiometry.noise.blocks import FrameRow
from radiometry.noise.darkness import find_not_dark
from radiometry.noise.fit import FittedChannel
from radiometry.noise.rows import DARK

GOOD_LEVELS = 6
DRIFT_REL = 0.01
TIME_RATIO = 2.0
UNDERFLOW_SHARE = 0.005
"""EMVA 1288, 6.5: no more samples of a dark frame may be zero."""

OFF_LINE_REL = 0.1
"""Nominal shutter times err by up to 7 %, 1/60 s for 1/64 s, and sensors bend by a few per cent."""

UNEVEN_REL = 0.05
"""Sensors have 0.3 to 2 %."""

_ERRORS = 3.0


def check_fits(fitted: Sequence[FittedChannel]) -> tuple[Raised, ...]:
    """Check every channel of every ISO value.

    Parameters
    ----------
    fitted : sequence of FittedChannel
        Fitted channels.

    Returns
    -------
    tuple of Raised
        Flags by channel, then in the order of the flags.
    """
    found: list[Raised] = []
    for each in fitted:
        where = f"iso {each.fit.iso:g} {each.fit.channel}"
        for flag, detail in (*_check_stacks(each), *_check_transfer(each), *_check_figures(each)):
            found.append(flag.at(where, detail))
    return tuple(found)


def check_headers(rows: Sequence[FrameRow]) -> tuple[Raised, ...]:
    """Check whether frames are rendered, with a tone curve between light and numbers, or lack a black level.

    Returns
    -------
    tuple of Raised
        Flags `rendered` and `black_level_assumed`.
    """
    rendered = sum(row.header.rendered for row in rows)
    detail = f"Rendered frames: {rendered} of {len(rows)}."
    found = (shared.RENDERED.at("", detail),) if rendered else ()
    return (*found, *flag_assumed_black([row.header for row in rows]))


def _check_stacks(each: FittedChannel) -> list[tuple[Finding, str]]:
    found = []
    drifting = max((level.lit.drift_rel for level in each.levels), default=0.0)
    if drifting > DRIFT_REL:
        detail = f"The means of frames of one setting differ by up to {drifting:.1%}."
        found.append((codes.PAIR_LIGHT_DRIFT, detail))
    ratios = [level.time_ratio for level in each.levels if not level.left_out]
    if max(ratios, default=1.0) > TIME_RATIO:
        found.append((shared.DARK_EXPOSURE_DIFFERS, f"By up to a factor of {max(ratios):.3g}."))
    darks = [stack for stack in each.stacks if stack.setting.role == DARK]
    doubted = {frame: why for stack in darks for frame, why in find_not_dark(stack).items()}
    if doubted:
        found.append((shared.DARK_NOT_DARK, name_not_dark(doubted)))
    zeros = max(stack.zero_share for stack in darks)
    if zeros > UNDERFLOW_SHARE:
        found.append((codes.DARK_CLIPPED, f"Up to {zeros:.1%} of a dark frame's samples are 0."))
    return found


def _check_transfer(each: FittedChannel) -> list[tuple[Finding, str]]:
    transfer = each.transfer
    if transfer is None:
        return [(codes.NO_PHOTON_TRANSFER, _count_levels(each))]
    found = []
    if len(transfer.levels) < GOOD_LEVELS:
        found.append((shared.FEW_POINTS, f"Levels in the photon transfer: {len(transfer.levels)}."))
    if transfer.birge_ratio > 1.0 and transfer.chi_squared > _chi_squared_limit(len(transfer.levels) - 1):
        detail = f"Birge ratio {transfer.birge_ratio:.3f}: the noise does not follow the photon transfer."
        found.append((shared.SCATTER_EXCEEDS_UNCERTAINTY, detail))
    line = each.fit.linearity
    if line and max(-line.lowest_rel, line.highest_rel) > OFF_LINE_REL:
        detail = f"Levels lie {line.lowest_rel:+.1%} to {line.highest_rel:+.1%} off the line."
        found.append((codes.LINEARITY_ERROR_LARGE, detail))
    figures = each.fit.transfer
    if figures and figures.saturation_origin == "white_level_assumed":
        top = max((level.signal_dn for level in each.levels), default=0.0)
        found.append(
            (
                codes.FULL_WELL_NOT_REACHED,
                f"The brightest level is {top / figures.saturation_dn.value:.0%} of white.",
            )
        )
    return found


def _check_figures(each: FittedChannel) -> list[tuple[Finding, str]]:
    fit, found = each.fit, []
    if each.rounding_dominates:
        low, high = (
            max(0.0, fit.read_noise_dn.value + side * 1.96 * fit.read_noise_dn.standard_uncertainty)
            for side in (-1.0, 1.0)
        )
        detail = f"It lies between {low:.2g} and {high:.2g} DN with a probability of 95 %."
        found.append((codes.READ_NOISE_BELOW_ROUNDING, detail))
    if fit.prnu_rel and fit.prnu_rel.value > UNEVEN_REL:
        found.append((codes.PRNU_LARGE, f"PRNU {fit.prnu_rel.value:.1%}."))
    names = [
        name
        for name, resolved in (("DSNU", each.dsnu_resolved), ("PRNU", each.prnu_resolved))
        if not resolved
    ]
    if names:
        found.append((codes.PATTERN_NOT_RESOLVED, f"{' and '.join(names)}: add frames of one setting."))
    current = fit.dark_current
    mean = current.dark_current_e_per_s if current else None
    variance = current.from_variance_e_per_s if current else None
    if mean and variance:
        u = math.hypot(mean.standard_uncertainty, variance.standard_uncertainty)
        if variance.value - mean.value > _ERRORS * u:
            detail = f"From the mean {mean.value:.3g} e-/s, from the variance {variance.value:.3g} e-/s."
            found.append((codes.DARK_CURRENT_COMPENSATED, detail))
    return found


def _count_levels(each: FittedChannel) -> str:
    usable = sum(not level.left_out for level in each.levels)
    return f"Usable levels: {usable} of {len(each.levels)}."


def _chi_squared_limit(dof: int) -> float:
    """Return what chance exceeds once in several hundred times: mean plus three standard deviations."""
    return dof + 3.0 * math.sqrt(2.0 * dof)
