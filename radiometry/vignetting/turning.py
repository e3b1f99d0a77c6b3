"""Plane of light, from flats between which the camera was turned: the light then turns in the frame."""

import math
from collections.abc import Sequence

import numpy as np
import scipy

from radiometry.vignetting.solution import Blocks, Matrix

Plane2 = tuple[Matrix, Matrix]
"""Gradient per half diagonal, (2,), row first, and its covariance, (2, 2)."""

_TURN_U = math.radians(3.0)
"""Standard uncertainty of a turn by hand."""

_STEADY_U = 1e-4
"""By so much, per half diagonal, planes of light change between frames at least."""

_CERTAIN_CHI_SQUARED = 9.0


def measure_plane(flat: Blocks, merged: Blocks) -> Plane2:
    """Fit a plane to the ratio of a flat to the mean of all flats, in which there is no lens.

    Parameters
    ----------
    flat, merged : Blocks
        Blocks of the frame and of the mean.

    Returns
    -------
    Plane2
        Plane with the covariance that the frame's noise gives it.
    """
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

    Parameters
    ----------
    planes : sequence of Plane2
        By how much the plane of each frame differs from that of the mean.
    turns_deg : sequence of float
        Angle by which the camera was turned about its axis at each frame, in either sense [deg].

    Returns
    -------
    Plane2 or None
        Plane in the mean; None if nothing was turned.

    Notes
    -----
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
