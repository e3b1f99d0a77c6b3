"""Falloff of one f-number and channel, from all of its flat frames."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import MOST_DOF
from radiometry.frame.packing import pack
from radiometry.vignetting.curve import (
    evaluate_curve,
    evaluate_slopes,
    find_farthest_corner,
    list_corners,
    propagate,
    sample_radii,
)
from radiometry.vignetting.darkness import DarkError
from radiometry.vignetting.flats import merge_flats
from radiometry.vignetting.grid import Grid
from radiometry.vignetting.least_squares import solve_falloff
from radiometry.vignetting.quality import measure_gradient
from radiometry.vignetting.results import ChannelFit, Coefficient, CornerVariance
from radiometry.vignetting.solution import CENTRE, LIGHT, USUAL, Blocks, Matrix, Solution, is_apart
from radiometry.vignetting.turning import find_turned_light

DARKEST_SHARE = 0.02
"""Less than this in a corner is the edge of the image circle, which no such curve describes."""

_CHI_SQUARED_ERRORS = 3.0
_SEEN_GRADIENT = 0.005
"""Per half diagonal: planes that differ by less do not show that the light did not turn."""


CENTRE_DRIFT_U = 0.02
"""By so much the centre differs from one f-number to the next, in half diagonals."""


@dataclass(frozen=True)
class FittedChannel:
    """One f-number and channel: the stored result, and the fits on which it rests.

    Attributes
    ----------
    fit : ChannelFit
        Result of the fit.
    solution : Solution
        Fit of the result.
    alone : Solution
        The same without knowledge of the centre from another f-number.
    not_turned : bool
        True if the light did not turn in the frame as the camera was stated to turn.
    """

    fit: ChannelFit
    solution: Solution
    alone: Solution
    not_turned: bool


def fit_channel(
    flats: Sequence[Blocks],
    *,
    f_number: float,
    channel: str,
    turns_deg: Sequence[float] = (),
    known: Solution | None = None,
) -> FittedChannel:
    """Fit one channel of one f-number.

    Parameters
    ----------
    flats : sequence of Blocks
        Blocks of each frame in a fixed order, at least one.
    f_number : float
        F-number.
    channel : str
        Name of the channel.
    turns_deg : sequence of float, default: ()
        Angle by which the camera was turned at each frame [deg]; empty if it was not.
    known : Solution or None, default: None
        Fit of another f-number of the channel, whose centre this one shares unless it contradicts.

    Returns
    -------
    FittedChannel
        Result and its fits.

    Raises
    ------
    InputRejected
        `fit_failed` if hardly any light is left in a corner.

    Notes
    -----
    The plane in the light is fitted always, with what turned frames show of it: it is never dropped because
    it is not significant, for then the centre would be that of the light.

    A dark level that is wrong by e changes A V to A V + e = (A + e) V', V' - 1 = (V - 1) / (1 + e/A): the k
    shrink by one factor, and the centre stays. So u(e/A)^2 k k' is added to the covariance of k.
    """
    blocks, planes = merge_flats(flats)
    alone = solve_falloff(blocks)
    turned = find_turned_light(planes, turns_deg)
    prior, not_turned = USUAL, False
    if turned is not None:
        apart = turned[0] - alone.parameters[LIGHT]
        not_turned = math.hypot(*apart) > _SEEN_GRADIENT and is_apart(
            apart, turned[1] + alone.gradient_covariance
        )
        if not not_turned:
            prior = prior.replace(LIGHT, *turned)
            alone = solve_falloff(blocks, prior)
    solution = alone
    if known is not None:
        centre, spread = _expect_centre(known)
        own = alone.find_covariance()[CENTRE, CENTRE]
        if not is_apart(alone.parameters[CENTRE] - centre, own + spread):
            solution = solve_falloff(blocks, prior.replace(CENTRE, centre, spread))
    fit = _conclude(solution, blocks, f_number=f_number, channel=channel, frames=len(flats))
    return FittedChannel(fit=fit, solution=solution, alone=alone, not_turned=not_turned)


def find_best(fitted: Iterable[FittedChannel]) -> FittedChannel:
    """Return the f-number of one channel whose flats determine the centre best.

    Parameters
    ----------
    fitted : iterable of FittedChannel
        F-numbers of one channel.

    Returns
    -------
    FittedChannel
        One of them.
    """
    return min(fitted, key=lambda each: float(np.trace(each.alone.find_covariance()[CENTRE, CENTRE])))


def _expect_centre(known: Solution) -> tuple[Matrix, Matrix]:
    """Return the centre at another f-number and its covariance [R]."""
    own = known.find_covariance()[CENTRE, CENTRE]
    return known.parameters[CENTRE], own + CENTRE_DRIFT_U**2 * np.eye(2)


def _conclude(
    solution: Solution, blocks: Blocks, *, f_number: float, channel: str, frames: int
) -> ChannelFit:
    dark_u_rel = _relate_dark_error(solution, blocks.dark)
    by_dark = np.zeros((5, 5))
    by_dark[:3, :3] = dark_u_rel**2 * np.outer(solution.k, solution.k)
    covariance = solution.find_covariance_of_lens() + by_dark
    model_u_rel = _measure_misfit(solution, blocks)
    coefficient, slopes = _build(
        solution,
        covariance,
        blocks.grid,
        f_number=f_number,
        channel=channel,
        model_u_rel=model_u_rel,
    )
    gradient, gradient_u = measure_gradient(solution, blocks)
    counted = np.isfinite(blocks.standard_error)
    corners = np.array(list_corners(blocks.grid.height_px, blocks.grid.width_px))
    mean_corner = float(np.mean(1.0 - _share_at(coefficient, corners[:, 0], corners[:, 1])))
    share = 1.0 - coefficient.corner_falloff
    certain, level, whole = (
        float(propagate(slopes, solution.find_covariance_of_lens(known=known))) ** 2 for known in (4, 2, 0)
    )
    variances = {
        ("noise of the flats", "A"): certain,
        ("centre of the falloff", "B"): level - certain,
        ("plane of light", "A"): whole - level,
        ("dark level", "A"): float(propagate(slopes, by_dark)) ** 2,
        ("shape of the curve", "A"): (model_u_rel * share) ** 2,
    }
    of_dark = {name: by_dark[index, index] for index, name in enumerate(("k1", "k2", "k3"))}
    total = np.diag(covariance)[:3].tolist()
    freedom = {
        "corner_falloff": (variances["dark level", "A"], math.fsum(variances.values())),
        **{name: (of_dark[name], each) for name, each in zip(of_dark, total, strict=True)},
    }
    return ChannelFit(
        coefficient=coefficient,
        frames=frames,
        chi_squared=solution.chi_squared,
        dof=solution.dof,
        birge_ratio=math.sqrt(max(1.0, solution.chi_squared / solution.dof)),
        residual_rms_rel=float(np.sqrt(np.mean(solution.residual[counted] ** 2))),
        mean_corner_falloff=mean_corner,
        largest_falloff=find_largest_falloff(coefficient),
        gradient_rel=gradient,
        gradient_standard_uncertainty_rel=gradient_u,
        gradient_fitted=True,
        centre_held=solution.centre_held,
        residuals=pack(np.where(counted, solution.residual, np.nan), dtype="<f2"),
        block_px=blocks.grid.block_px,
        dark_u_rel=dark_u_rel,
        corner_variances=tuple(
            CornerVariance(source=source, kind=kind, variance=max(0.0, variance))
            for (source, kind), variance in variances.items()
        ),
        effective_dof={
            name: min(MOST_DOF, blocks.dark.dof * (whole_of / part) ** 2) if part else MOST_DOF
            for name, (part, whole_of) in freedom.items()
        },
    )


def _relate_dark_error(solution: Solution, dark: DarkError) -> float:
    """Return u(e/A), e the error of the dark level and A the light at the centre."""
    return math.hypot(dark.shared, dark.own) / abs(solution.level) if solution.level else 0.0


def find_largest_falloff(coefficient: Coefficient) -> float:
    """Return 1 - V where it is largest, from the centre to the farthest corner.

    Parameters
    ----------
    coefficient : Coefficient
        Falloff of one f-number and channel.
    """
    return 1.0 - float(evaluate_curve(sample_radii(farthest_radius(coefficient)) ** 2, coefficient.k).min())


def farthest_radius(coefficient: Coefficient) -> float:
    """Return r at the corner that is farthest from the centre.

    Parameters
    ----------
    coefficient : Coefficient
        Falloff of one f-number and channel.
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
    solution: Solution, covariance: Matrix, grid: Grid, *, f_number: float, channel: str, model_u_rel: float
) -> tuple[Coefficient, Matrix]:
    """Return the coefficient, and the derivatives of V at its farthest corner."""
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
    of_curve = float(propagate(slopes, covariance))
    coefficient = Coefficient(
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
        covariance=tuple(tuple(float(each) for each in line) for line in covariance),
        model_u_rel=model_u_rel,
        corner_falloff=1.0 - float(share),
        corner_falloff_standard_uncertainty=math.hypot(of_curve, model_u_rel * float(share)),
    )
    return coefficient, slopes
