"""Several flats of one channel and f-number as one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.vignetting import codes
from radiometry.vignetting.darkness import merge_dark_errors
from radiometry.vignetting.solution import Blocks
from radiometry.vignetting.turning import Plane2, measure_plane


def merge_flats(flats: Sequence[Blocks]) -> tuple[Blocks, list[Plane2]]:
    """Average frames of one f-number block by block, each divided by its own level and plane first.

    Parameters
    ----------
    flats : sequence of Blocks
        Blocks of each frame.

    Returns
    -------
    tuple of (Blocks, list of Plane2)
        Blocks of the mean, and by how much the plane of light of each frame differs from that of the mean.

    Raises
    ------
    InputRejected
        `flat_unusable` if no block counts in all of them.

    Notes
    -----
    z = sum(w light / level) / sum w,  w = (level / u)^2;  the level is the mean over the blocks that count
    in every frame, so that a block missing in one frame does not shift it against the others. Frames with
    different planes would bend the mean, since a block weighs more where its frame is darker: the planes are
    read off the ratios to a first mean, in which there is no lens, and divided out of a second.
    """
    everywhere = np.all([np.isfinite(flat.standard_error) for flat in flats], axis=0)
    if not everywhere.any():
        raise InputRejected(
            codes.FLAT_UNUSABLE,
            "The flat frames of one f-number have no part of the picture in common: leave their regions out, "
            "so that the whole frame counts.",
        )
    merged = _average(flats, everywhere)
    if len(flats) == 1:
        return merged, []
    planes = [measure_plane(flat, merged) for flat in flats]
    down, right = flats[0].places
    level = []
    for flat, (plane, _) in zip(flats, planes, strict=True):
        tilt = 1.0 + plane[0] * down + plane[1] * right
        level.append(replace(flat, light=flat.light / tilt, standard_error=flat.standard_error / tilt))
    return _average(level, everywhere), planes


def _average(flats: Sequence[Blocks], everywhere: NDArray[np.bool_]) -> Blocks:
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
        dark=merge_dark_errors(darks, shares),
    )
