"""Falloff of one f-number and channel, from all of its flat frames."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.findings import shared
from radiometry.fitting.evidence import MOST_DOF
from radiometry.frame.packing import pack
from radiometry.records import Record
from radiometry.vignetting import codes, falloff, light, points, results
from radiometry.vignetting.falloff import Blocks, Matrix, Solution

Plane2 = tuple[Matrix, Matrix]  # Gradient per half diagonal, (2,), row first, and its covariance, (2, 2)

_TURN_U = math.radians(3.0)  # Standard uncertainty of a turn by hand

_STEADY_U = 1e-4  # By so much, per half diagonal, planes of light change between frames at least

_CERTAIN_CHI_SQUARED = 9.0


def measure_plane(flat: Blocks, merged: Blocks) -> Plane2:
    """Fit a plane to the ratio of a flat to the mean of all flats, in which there is no lens."""
    counts = np.isfinite(flat.standard_error) & np.isfinite(merged.standard_error)
    down, right = (np.broadcast_to(each, counts.shape)[counts] for each in flat.places)
    level = float(flat.light[counts].mean() / merged.light[counts].mean())
    expected = level * merged.light[counts]
    weights = expected / flat.standard_error[counts]
    design = np.column_stack([np.ones_like(down), down, right]) * weights[:, None]
    inverse = np.linalg.inv(design.T @ design)
    plane = inverse @ (design.T @ (weights * (flat.light[counts] / expected - 1.0)))
    return plane[1:], np.asarray(inverse[1:, 1:])


def find_turned_light(planes: Sequence[Plane2], turns_deg: Sequence[float]) -> Plane2 | None:
    """Estimate the plane of light in the mean of flats from what turns between them.

    With g the plane of a frame that is not turned, s the plane of the mean and R_i the turn::

        e_i = R_i g - s,    V_i = C_i + (u_turn |g|)^2 I

    is solved for g and s by generalised least squares. Planes that do not turn as stated enlarge the error
    (Birge). The sense of the turns is that which fits better, or either where the frames do not show it.
    """
    if len(planes) < 2 or len({turn % 360.0 for turn in turns_deg}) < 2:
        return None
    senses = [_solve(planes, sense * np.radians(turns_deg)) for sense in (1.0, -1.0)]
    (least, best, covariance), (most, other, wide) = sorted(senses, key=lambda each: each[0])
    if most - least > _CERTAIN_CHI_SQUARED:
        return best, covariance
    half = (best - other) / 2.0
    return np.asarray((best + other) / 2.0), np.asarray((covariance + wide) / 2.0 + np.outer(half, half))


def _solve(planes: Sequence[Plane2], turns: Matrix) -> tuple[float, Matrix, Matrix]:
    """Return chi^2, the plane of the mean and its covariance, for turns of one sense [rad]."""
    rotations = [np.array([[c, -s], [s, c]]) for c, s in zip(np.cos(turns), np.sin(turns), strict=True)]
    design = np.vstack([np.hstack([each, -np.eye(2)]) for each in rotations])
    seen = np.concatenate([plane for plane, _ in planes])
    size = 0.0
    for _ in range(2):
        unsure = ((_TURN_U * size) ** 2 + _STEADY_U**2) * np.eye(2)
        weight = scipy.linalg.block_diag(*(np.linalg.inv(noise + unsure) for _, noise in planes))
        normal = design.T @ weight @ design
        found = np.linalg.solve(normal, design.T @ weight @ seen)
        size = float(np.hypot(*found[:2]))
    residual = seen - design @ found
    chi_squared, dof = float(residual @ weight @ residual), seen.size - 4
    scale = max(1.0, chi_squared / dof) if dof else 1.0
    return chi_squared, found[2:], np.asarray(scale * np.linalg.inv(normal)[2:, 2:])


def merge_flats(flats: Sequence[Blocks]) -> tuple[Blocks, list[Plane2]]:
    """Average frames of one f-number block by block, each divided by its own level and plane first.

    z = sum(w light / level) / sum w,  w = (level / u)^2;  the level is the mean over the blocks that count
    in every frame, so that a block missing in one frame does not shift it against the others. Frames with
    different planes would bend the mean, since a block weighs more where its frame is darker: the planes are
    read off the ratios to a first mean, in which there is no lens, and divided out of a second.
    """
    everywhere = np.all([np.isfinite(flat.standard_error) for flat in flats], axis=0)
    if not everywhere.any():
        raise codes.FLAT_UNUSABLE.reject(
            "The flat frames of one f-number have no part of the picture in common: leave their regions out, "
            "so that the whole frame counts."
        )
    merged = _average_flats(flats, everywhere)
    if len(flats) == 1:
        return merged, []
    planes = [measure_plane(flat, merged) for flat in flats]
    down, right = flats[0].places
    level = []
    for flat, (plane, _) in zip(flats, planes, strict=True):
        tilt = 1.0 + plane[0] * down + plane[1] * right
        level.append(replace(flat, light=flat.light / tilt, standard_error=flat.standard_error / tilt))
    return _average_flats(level, everywhere), planes


def _average_flats(flats: Sequence[Blocks], everywhere: NDArray[np.bool_]) -> Blocks:
    levels = [float(flat.light[everywhere].mean()) for flat in flats]
    weights = [(level / flat.standard_error) ** 2 for level, flat in zip(levels, flats, strict=True)]
    total = np.sum(weights, axis=0)
    shares = [float(weight.sum() / total.sum()) for weight in weights]
    darks = [
        replace(flat.dark, shared=flat.dark.shared / level, own=flat.dark.own / level)
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
        dark=light.merge_dark_errors(darks, shares),
    )


# Less than this in a corner is the edge of the image circle, which no such curve describes
DARKEST_SHARE = 0.02

_CHI_SQUARED_ERRORS = 3.0
# Per half diagonal: planes that differ by less do not show that the light did not turn
_SEEN_GRADIENT = 0.005


CENTRE_DRIFT_U = 0.02  # By so much the centre differs from one f-number to the next, in half diagonals


class FittedChannel(Record, kw_only=False):
    """One f-number and channel: the stored result, and the fits on which it rests."""

    fit: results.ChannelFit
    solution: Solution
    alone: Solution  # The same without knowledge of the centre from another f-number
    not_turned: bool  # True if the light did not turn in the frame as the camera was stated to turn


def fit_channel(
    flats: Sequence[Blocks],
    *,
    f_number: float,
    channel: str,
    turns_deg: Sequence[float] = (),
    known: Solution | None = None,
) -> FittedChannel:
    """Fit one channel of one f-number.

    The plane in the light is fitted always, with what turned frames show of it: it is never dropped because
    it is not significant, for then the centre would be that of the light.

    A dark level that is wrong by e changes A V to A V + e = (A + e) V', V' - 1 = (V - 1) / (1 + e/A): the k
    shrink by one factor, and the centre stays. So u(e/A)^2 k k' is added to the covariance of k.
    """
    blocks, planes = merge_flats(flats)
    alone = falloff.solve_falloff(blocks)
    turned = find_turned_light(planes, turns_deg)
    prior, not_turned = falloff.USUAL, False
    if turned is not None:
        apart = turned[0] - alone.parameters[falloff.LIGHT]
        not_turned = math.hypot(*apart) > _SEEN_GRADIENT and falloff.is_apart(
            apart, turned[1] + alone.gradient_covariance
        )
        if not not_turned:
            prior = prior.replace(falloff.LIGHT, *turned)
            alone = falloff.solve_falloff(blocks, prior)
    solution = alone
    if known is not None:
        # at another f-number the centre may lie elsewhere
        centre = known.parameters[falloff.CENTRE]
        spread = known.find_covariance()[falloff.CENTRE, falloff.CENTRE] + CENTRE_DRIFT_U**2 * np.eye(2)
        own = alone.find_covariance()[falloff.CENTRE, falloff.CENTRE]
        if not falloff.is_apart(alone.parameters[falloff.CENTRE] - centre, own + spread):
            prior = prior.replace(falloff.CENTRE, centre, spread)
            solution = falloff.solve_falloff(blocks, prior, terms=len(alone.k))
    solution = replace(solution, further=alone.further, before=alone.before)
    fit = _conclude(solution, blocks, f_number=f_number, channel=channel, frames=len(flats))
    return FittedChannel(fit=fit, solution=solution, alone=alone, not_turned=not_turned)


def find_best(fitted: Iterable[FittedChannel]) -> FittedChannel:
    """Return the f-number of one channel whose flats determine the centre best."""
    return min(
        fitted, key=lambda each: float(np.trace(each.alone.find_covariance()[falloff.CENTRE, falloff.CENTRE]))
    )


def _conclude(
    solution: Solution, blocks: Blocks, *, f_number: float, channel: str, frames: int
) -> results.ChannelFit:
    # u(e/A), e the error of the dark level and A the light at the centre
    dark_u = math.hypot(blocks.dark.shared, blocks.dark.own)
    dark_u_rel = dark_u / abs(solution.level) if solution.level else 0.0
    of_dark = np.append(solution.k, [0.0, 0.0]) * dark_u_rel
    by_dark = np.outer(of_dark, of_dark)
    covariance = solution.find_covariance_of_lens() + by_dark
    coefficient, slopes, corner_u = _build(solution, covariance, blocks, f_number=f_number, channel=channel)
    gradient, gradient_u = points.measure_gradient(solution, blocks)
    counted = np.isfinite(blocks.standard_error)
    corners = np.array(falloff.list_corners(blocks.grid.height_px, blocks.grid.width_px))
    mean_corner = float(np.mean(1.0 - coefficient.evaluate(corners[:, 0], corners[:, 1])[0]))
    certain, level, whole = (
        float(falloff.propagate(slopes, solution.find_covariance_of_lens(known=known))) ** 2
        for known in (4, 2, 0)
    )
    variances = {
        ("noise of the flats", "A"): certain,
        ("centre of the falloff", "B"): level - certain,
        ("plane of light", "A"): whole - level,
        ("dark level", "A"): float(falloff.propagate(slopes, by_dark)) ** 2,
        ("shape of the curve", "A"): corner_u**2,
    }
    total = np.diag(covariance).tolist()
    freedom = {
        "corner_falloff": (variances["dark level", "A"], math.fsum(variances.values())),
        **{f"k{n + 1}": (by_dark[n, n], total[n]) for n in range(len(solution.k))},
    }
    return results.ChannelFit(
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
            results.CornerVariance(source=source, kind=kind, variance=max(0.0, variance))
            for (source, kind), variance in variances.items()
        ),
        effective_dof={
            name: min(MOST_DOF, blocks.dark.dof * (whole_of / part) ** 2) if part else MOST_DOF
            for name, (part, whole_of) in freedom.items()
        },
    )


def find_largest_falloff(coefficient: results.Coefficient) -> float:
    """Return 1 - V where it is largest, from the centre to the farthest corner."""
    return 1.0 - float(
        falloff.evaluate_curve(falloff.sample_radii(farthest_radius(coefficient)) ** 2, coefficient.k).min()
    )


def farthest_radius(coefficient: results.Coefficient) -> float:
    """Return r at the corner that is farthest from the centre."""
    corner = falloff.find_farthest_corner(
        coefficient.height_px, coefficient.width_px, centre_px=coefficient.centre_px
    )
    return math.dist(corner, coefficient.centre_px) / coefficient.radius_px


def _measure_misfit(solution: Solution, blocks: Blocks) -> float:
    """Compute by how much, relative, V departs from the blocks beyond their noise; 0 where noise explains it.

    s^2 = mean(residual^2) - mean(u^2), where chi^2 / dof exceeds 1 by three of its own standard deviations;
    at least what terms that were left out may change, rms over a disc.
    """
    radii = falloff.sample_radii(1.0)
    changed = solution.find_left(radii) / falloff.evaluate_curve(radii**2, solution.k)
    left = math.sqrt(float(np.average(changed**2, weights=radii)))
    if solution.chi_squared / solution.dof <= 1.0 + _CHI_SQUARED_ERRORS * math.sqrt(2.0 / solution.dof):
        return left
    counted = np.isfinite(blocks.standard_error)
    noise = np.mean((blocks.standard_error[counted] / solution.fitted[counted]) ** 2)
    return math.sqrt(max(left**2, float(np.mean(solution.residual[counted] ** 2) - noise)))


def _build(
    solution: Solution, covariance: Matrix, blocks: Blocks, *, f_number: float, channel: str
) -> tuple[results.Coefficient, Matrix, float]:
    """Return the coefficient, the derivatives of V at its farthest corner, and the curve's own u there."""
    grid = blocks.grid
    row, col = falloff.find_farthest_corner(grid.height_px, grid.width_px, centre_px=solution.centre_px)
    share, slopes = falloff.evaluate_slopes(
        np.array(row),
        np.array(col),
        solution.k,
        centre_px=solution.centre_px,
        radius_px=grid.half_diagonal_px,
    )
    if not float(share) > DARKEST_SHARE or solution.level <= 0.0:
        far = np.hypot(blocks.rows.means[:, None] - row, blocks.cols.means[None] - col)
        near = np.unravel_index(np.where(np.isfinite(blocks.standard_error), far, np.inf).argmin(), far.shape)
        seen = float(blocks.light[near]) / solution.level if solution.level > 0.0 else 0.0
        raise shared.FIT_FAILED.reject(
            f"At f/{f_number:g}, channel {channel}, {seen:.1%} of the light is left in the block nearest to "
            f"the farthest corner, where the curve has {float(share):.1%}: the edge of the image circle, or "
            "a knee that no curve of five terms follows. Give the flats a region without the dark "
            "corners."
        )
    model_u_rel = _measure_misfit(solution, blocks)
    farthest = math.dist((row, col), solution.centre_px) / grid.half_diagonal_px
    corner_u = max(model_u_rel * float(share), float(solution.find_left(np.array([farthest]))[0]))
    of_curve = float(falloff.propagate(slopes, covariance))
    coefficient = results.Coefficient(
        f_number=f_number,
        channel=channel,
        height_px=grid.height_px,
        width_px=grid.width_px,
        radius_px=grid.half_diagonal_px,
        centre_row_px=solution.centre_px[0],
        centre_col_px=solution.centre_px[1],
        **{f"k{n}": each for n, each in enumerate(solution.k, 1)},
        covariance=tuple(tuple(float(each) for each in line) for line in covariance),
        model_u_rel=model_u_rel,
        corner_falloff=1.0 - float(share),
        corner_falloff_standard_uncertainty=math.hypot(of_curve, corner_u),
    )
    return coefficient, slopes, corner_u
