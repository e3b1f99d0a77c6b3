"""Falloff of one f-number and channel, from all of its flat frames."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from radiometry.findings import InputRejected, shared
from radiometry.frame.packing import pack
from radiometry.vignetting import codes
from radiometry.vignetting.curve import (
    evaluate_curve,
    evaluate_slopes,
    find_farthest_corner,
    list_corners,
    propagate,
    sample_radii,
)
from radiometry.vignetting.darkness import DarkError, merge_dark_errors
from radiometry.vignetting.grid import Grid
from radiometry.vignetting.quality import measure_gradient
from radiometry.vignetting.results import ChannelFit, Coefficient
from radiometry.vignetting.solving import Blocks, Solution, is_gradient_significant, solve_falloff

DARKEST_SHARE = 0.02
"""Less than this in a corner is the edge of the image circle, which no such curve describes."""

_CHI_SQUARED_ERRORS = 3.0


@dataclass(frozen=True)
class FittedChannel:
    """One f-number and channel: the stored result, and both of the fits on which it rests.

    Attributes
    ----------
    fit : ChannelFit
        Result of the fit.
    plain : Solution
        Fit without a plane in the light.
    tilted : Solution
        Fit with a plane in the light.
    """

    fit: ChannelFit
    plain: Solution
    tilted: Solution


def merge_flats(flats: Sequence[Blocks]) -> Blocks:
    """Average frames of one f-number block by block, each divided by its own level first.

    Parameters
    ----------
    flats : sequence of Blocks
        Blocks of each frame.

    Returns
    -------
    Blocks
        Blocks of the mean.

    Raises
    ------
    InputRejected
        `flat_unusable` if no block counts in all of them.

    Notes
    -----
    z = sum(w light / level) / sum w,  w = (level / u)^2;  the level is the mean over the blocks that count
    in every frame, so that a block missing in one frame does not shift it against the others.
    """
    everywhere = np.all([np.isfinite(flat.standard_error) for flat in flats], axis=0)
    if not everywhere.any():
        raise InputRejected(
            codes.FLAT_UNUSABLE,
            "The flat frames of one f-number have no part of the picture in common: leave their regions out, "
            "so that the whole frame counts.",
        )
    levels = [float(flat.light[everywhere].mean()) for flat in flats]
    weights = [(level / flat.standard_error) ** 2 for level, flat in zip(levels, flats, strict=True)]
    total = np.sum(weights, axis=0)
    shares = [float(weight.sum() / total.sum()) for weight in weights]
    darks = [
        DarkError(shared=flat.dark.shared / level, own=flat.dark.own / level)
        for flat, level in zip(flats, levels, strict=True)
    ]
    summed = np.sum(
        [weight * flat.light / level for weight, flat, level in zip(weights, flats, levels, strict=True)],
        axis=0,
    )
    known = total > 0.0
    return replace(
        flats[0],
        light=np.divide(summed, total, out=np.zeros_like(total), where=known),
        standard_error=np.divide(1.0, np.sqrt(total), out=np.full_like(total, np.inf), where=known),
        dark=merge_dark_errors(darks, shares),
    )


def fit_channel(flats: Sequence[Blocks], *, f_number: float, channel: str) -> FittedChannel:
    """Fit one channel of one f-number.

    Parameters
    ----------
    flats : sequence of Blocks
        Blocks of each frame in a fixed order, at least one.
    f_number : float
        F-number.
    channel : str
        Name of the channel.

    Returns
    -------
    FittedChannel
        Result and both fits.

    Raises
    ------
    InputRejected
        `fit_failed` if hardly any light is left in a corner.

    Notes
    -----
    Two fits are made, without and with a plane in the light. The second is used if the plane exceeds its
    error as much as three standard errors do: then the centre of the first fit is that of the light.

    A dark level that is wrong by e changes A V to A V + e = (A + e) V', V' - 1 = (V - 1) / (1 + e/A): the k
    shrink by one factor, and the centre stays. So u(e/A)^2 k k' is added to the covariance of k.
    """
    blocks = merge_flats(flats)
    plain = solve_falloff(blocks, with_gradient=False)
    tilted = solve_falloff(blocks, with_gradient=True)
    use_tilted = is_gradient_significant(plain, tilted)
    chosen = _add_dark_error(tilted if use_tilted else plain, blocks.dark)
    model_u_rel = _measure_misfit(chosen, blocks)
    coefficient = _build(chosen, blocks.grid, f_number=f_number, channel=channel, model_u_rel=model_u_rel)
    gradient, gradient_u = measure_gradient(tilted, blocks)
    counted = np.isfinite(blocks.standard_error)
    corners = np.array(list_corners(blocks.grid.height_px, blocks.grid.width_px))
    mean_corner = float(np.mean(1.0 - _share_at(coefficient, corners[:, 0], corners[:, 1])))
    fit = ChannelFit(
        coefficient=coefficient,
        frames=len(flats),
        chi_squared=chosen.chi_squared,
        dof=chosen.dof,
        birge_ratio=math.sqrt(max(1.0, chosen.chi_squared / chosen.dof)),
        residual_rms_rel=float(np.sqrt(np.mean(chosen.residual[counted] ** 2))),
        mean_corner_falloff=mean_corner,
        largest_falloff=find_largest_falloff(coefficient),
        gradient_rel=gradient,
        gradient_standard_uncertainty_rel=gradient_u,
        gradient_fitted=use_tilted,
        centre_held=chosen.centre_held,
        residuals=pack(np.where(counted, chosen.residual, np.nan), dtype="<f2"),
        block_px=blocks.grid.block_px,
        dark_u_rel=_relate_dark_error(chosen, blocks.dark),
    )
    return FittedChannel(fit=fit, plain=plain, tilted=tilted)


def _relate_dark_error(solution: Solution, dark: DarkError) -> float:
    """Return u(e/A), e the error of the dark level and A the light at the centre."""
    return math.hypot(dark.shared, dark.own) / abs(solution.level) if solution.level else 0.0


def _add_dark_error(solution: Solution, dark: DarkError) -> Solution:
    covariance = solution.covariance.copy()
    covariance[:3, :3] += _relate_dark_error(solution, dark) ** 2 * np.outer(solution.k, solution.k)
    return replace(solution, covariance=covariance)


def find_largest_falloff(coefficient: Coefficient) -> float:
    """Return 1 - V where it is largest, from the centre to the farthest corner.

    Parameters
    ----------
    coefficient : Coefficient
        Falloff of one f-number and channel.

    Returns
    -------
    float
        Largest falloff.
    """
    return 1.0 - float(evaluate_curve(sample_radii(farthest_radius(coefficient)) ** 2, coefficient.k).min())


def farthest_radius(coefficient: Coefficient) -> float:
    """Return r at the corner that is farthest from the centre.

    Parameters
    ----------
    coefficient : Coefficient
        Falloff of one f-number and channel.

    Returns
    -------
    float
        Radius r.
    """
    corner = find_farthest_corner(
        coefficient.height_px, coefficient.width_px, centre_px=coefficient.centre_px
    )
    return math.dist(corner, coefficient.centre_px) / coefficient.radius_px


def _measure_misfit(solution: Solution, blocks: Blocks) -> float:
    """Compute the relative scatter of the blocks beyond their noise; 0 where noise explains it.

    s^2 = mean(residual^2) - mean(u^2), where chi^2 / dof exceeds 1 by three of its own standard deviations.
    """
    if solution.chi_squared / solution.dof <= 1.0 + _CHI_SQUARED_ERRORS * math.sqrt(2.0 / solution.dof):
        return 0.0
    counted = np.isfinite(blocks.standard_error)
    noise = np.mean((blocks.standard_error[counted] / solution.fitted[counted]) ** 2)
    return math.sqrt(max(0.0, float(np.mean(solution.residual[counted] ** 2) - noise)))


def _share_at(coefficient: Coefficient, row_px: float | np.ndarray, col_px: float | np.ndarray) -> np.ndarray:
    share, _ = evaluate_slopes(
        np.asarray(row_px, np.float64),
        np.asarray(col_px, np.float64),
        coefficient.k,
        centre_px=coefficient.centre_px,
        radius_px=coefficient.radius_px,
    )
    return share


def _build(
    solution: Solution, grid: Grid, *, f_number: float, channel: str, model_u_rel: float
) -> Coefficient:
    row, col = find_farthest_corner(grid.height_px, grid.width_px, centre_px=solution.centre_px)
    share, slopes = evaluate_slopes(
        np.array(row),
        np.array(col),
        solution.k,
        centre_px=solution.centre_px,
        radius_px=grid.half_diagonal_px,
    )
    if not float(share) > DARKEST_SHARE or solution.level <= 0.0:
        raise InputRejected(
            shared.FIT_FAILED,
            f"At f/{f_number:g}, channel {channel}, {float(share):.1%} of the light is left in the farthest "
            "corner: that is the edge of the image circle, not a falloff. Give the flats a region without "
            "the dark corners.",
        )
    of_curve = float(propagate(slopes, solution.covariance))
    return Coefficient(
        f_number=f_number,
        channel=channel,
        height_px=grid.height_px,
        width_px=grid.width_px,
        radius_px=grid.half_diagonal_px,
        centre_row_px=solution.centre_px[0],
        centre_col_px=solution.centre_px[1],
        k1=solution.k[0],
        k2=solution.k[1],
        k3=solution.k[2],
        covariance=tuple(tuple(float(each) for each in line) for line in solution.covariance),
        model_u_rel=model_u_rel,
        corner_falloff=1.0 - float(share),
        corner_falloff_standard_uncertainty=math.hypot(of_curve, model_u_rel * float(share)),
    )
