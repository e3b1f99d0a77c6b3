"""Refinement of the alignment of two bands by correlation of their edges, and what remains."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.opencv import cv2

Plane = NDArray[np.float32]
Matrix = NDArray[np.float64]

IDENTITY: Final = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)

_PATCH_PX = 64
_ACROSS = 12
_SEARCHES_PX = (12, 5, 5)
_LEAST_CORRELATION = 0.3
_MOST_BACK_PX = 0.7
_AFFINE_PATCHES = 16
_LEAST_PATCHES = 8
_LEAST_SHARE = 0.15
_WIDE_SHARE = 0.5
_MOST_RESIDUAL_PX = 1.5
_MAD_TO_SIGMA = 1.4826
_SMOOTHING_PX = 1.2
_EVEN_PX = 12.0


@dataclass(frozen=True, kw_only=True)
class Registration:
    """Alignment of a band onto another by correlation, after that by the files' lens data.

    Attributes
    ----------
    matrix : tuple of float
        (a, b, c, d, e, f): the band shows what the other shows at (x, y) where the lens data put
        (a x + b y + c, d x + e y + f) [px].
    shift_px : tuple[float, float]
        Correction (x, y) in the middle of the frame [px].
    residual_px : float or None
        Root mean square distance of all patches that were found from the correction that the others give
        [px]; None if there are too few patches.
    patches, tried : int
        Number of patches that follow the correction, and of those that were searched.
    trusted : bool
        True if the correction was applied.
    """

    matrix: tuple[float, ...]
    shift_px: tuple[float, float]
    residual_px: float | None
    patches: int
    tried: int
    trusted: bool


def register(fixed: Plane, moving: Plane, *, reach_px: int = 0) -> Registration:
    """Find by how much a band is displaced against another after the alignment by lens data.

    Parameters
    ----------
    fixed : ndarray of float32
        Band whose pixels are the result, (row, col); NaN where unknown.
    moving : ndarray of float32
        Other band on these pixels, as `align` gives it.
    reach_px : int, default: 0
        Distance up to which one common displacement is searched in the whole frame first [px].

    Returns
    -------
    Registration
        Correction with its residual.

    Notes
    -----
    Bands of one scene differ in contrast, and its sign, but share edges: what is correlated is the strength
    of the gradient over its local mean. Patches of 64 px are searched by normalised correlation, with a
    parabola through the peak. A patch counts if the correlation is at least 0.3, its peak lies inside the
    search, and the search back from the other band ends within 0.7 px of its start; on water or bare noise
    few do. An affine correction is fitted to them without outliers, three times; only a shift to fewer than
    16, or to those that do not span half of the frame both ways. It is trusted with 8 patches and 15 % of
    those tried, and a residual of 1.5 px or less.
    Each patch's distance is that from the fit of the others: e / (1 - h) with the leverage h. Outliers count
    in the residual: they are mostly relief, which displaces the region too.
    """
    edges = [_find_edges(plane) for plane in (fixed, moving)]
    size = (fixed.shape[1], fixed.shape[0])
    matrix = np.array(IDENTITY).reshape(2, 3)
    reach_px = min(reach_px, min(size) // 4)
    if reach_px:
        matrix[:, 2] = _find_common_shift(*edges, reach_px=reach_px)
    places, shifts, tried = np.empty((0, 2)), np.empty((0, 2)), 0
    residual: float | None = None
    kept = np.empty(0, np.bool_)
    for search_px in _SEARCHES_PX:
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        moved = np.asarray(cv2.warpAffine(edges[1], matrix, size, flags=flags), np.float32)
        places, shifts, tried = _find_patches(edges[0], moved, search_px)
        if len(places) < _LEAST_PATCHES:
            break
        change, kept, residual = _fit(places, shifts, size)
        # `change` leads from the fixed band's pixels to those of the band as corrected so far
        matrix = matrix @ np.vstack((change, (0.0, 0.0, 1.0)))
    found = int(np.count_nonzero(kept)) if len(places) >= _LEAST_PATCHES else len(places)
    trusted = (
        len(places) >= _LEAST_PATCHES
        and found >= max(_LEAST_PATCHES, _LEAST_SHARE * tried)
        and residual is not None
        and residual <= _MOST_RESIDUAL_PX
    )
    middle = np.array([size[0] / 2.0, size[1] / 2.0, 1.0])
    x, y = (matrix @ middle - middle[:2]).tolist()
    return Registration(
        matrix=tuple(matrix.ravel().tolist()),
        shift_px=(x, y),
        residual_px=residual,
        patches=found,
        tried=tried,
        trusted=trusted,
    )


def _find_edges(plane: Plane) -> Plane:
    """Return the strength of the gradient over its local mean; 0 where it is unknown."""
    unknown = ~np.isfinite(plane)
    filled = np.where(unknown, np.float32(np.nanmedian(plane)) if not unknown.all() else 0.0, plane)
    smooth = cv2.GaussianBlur(filled.astype(np.float32), (0, 0), _SMOOTHING_PX)
    strength = cv2.magnitude(cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1))
    strength = strength / (cv2.GaussianBlur(strength, (0, 0), _EVEN_PX) + np.float32(1e-12))
    rim = cv2.dilate(unknown.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    strength[rim] = 0.0
    return np.asarray(np.minimum(strength, 6.0), np.float32)


def _find_common_shift(fixed: Plane, moving: Plane, *, reach_px: int) -> tuple[float, float]:
    """Return the shift (x, y) with the largest normalised correlation of the frames' inner parts."""
    rows, cols = fixed.shape
    inner = fixed[reach_px : rows - reach_px, reach_px : cols - reach_px]
    found = cv2.matchTemplate(moving, inner, cv2.TM_CCOEFF_NORMED)
    _, _, _, (x, y) = cv2.minMaxLoc(found)
    return float(x - reach_px), float(y - reach_px)


def _find_patches(fixed: Plane, moving: Plane, search_px: int) -> tuple[Matrix, Matrix, int]:
    """Return middles (x, y) and shifts of the patches that are found both ways, and how many were tried."""
    rows, cols = fixed.shape
    half, rim = _PATCH_PX // 2, _PATCH_PX // 2 + search_px
    step = max(_PATCH_PX // 2, (cols - 2 * rim) // _ACROSS)
    places, shifts, tried = [], [], 0
    for y in range(rim, rows - rim + 1, step):
        for x in range(rim, cols - rim + 1, step):
            here = np.s_[y - half : y + half, x - half : x + half]
            if np.mean(fixed[here] == 0.0) > 0.25 or np.mean(moving[here] == 0.0) > 0.25:
                continue
            tried += 1
            there = _match(fixed[here], moving, x, y, search_px)
            back = _match(moving[here], fixed, x, y, search_px)
            if there is None or back is None or math.dist(there, (-back[0], -back[1])) > _MOST_BACK_PX:
                continue
            places.append((float(x), float(y)))
            shifts.append(((there[0] - back[0]) / 2.0, (there[1] - back[1]) / 2.0))
    return np.array(places).reshape(-1, 2), np.array(shifts).reshape(-1, 2), tried


def _match(patch: Plane, plane: Plane, x: int, y: int, search_px: int) -> tuple[float, float] | None:
    reach = _PATCH_PX // 2 + search_px
    area = plane[y - reach : y + reach, x - reach : x + reach]
    found = cv2.matchTemplate(area, patch, cv2.TM_CCOEFF_NORMED)
    _, best, _, (col, row) = cv2.minMaxLoc(found)
    if not best >= _LEAST_CORRELATION or not (0 < col < 2 * search_px and 0 < row < 2 * search_px):
        return None
    dx = _peak(*found[row, col - 1 : col + 2].tolist())
    dy = _peak(*found[row - 1 : row + 2, col].tolist())
    return col - search_px + dx, row - search_px + dy


def _peak(before: float, at: float, after: float) -> float:
    curvature = before - 2.0 * at + after
    return 0.5 * (before - after) / curvature if curvature < 0.0 else 0.0


def _fit(places: Matrix, shifts: Matrix, size: tuple[int, int]) -> tuple[Matrix, NDArray[np.bool_], float]:
    """Fit places + shifts by an affine map or a shift, without outliers; the map, the kept, the residual."""
    kept = np.ones(len(places), np.bool_)
    change, distances = np.zeros((2, 3)), np.zeros(len(places))
    middle = places.mean(axis=0)
    scale = max(float(np.ptp(places)), 1.0)
    offsets = (places - middle) / scale
    ones = np.ones((len(places), 1))
    for _ in range(6):
        spans = np.ptp(places[kept], axis=0) >= _WIDE_SHARE * np.array(size)
        affine = np.count_nonzero(kept) >= _AFFINE_PATCHES and bool(spans.all())
        design = np.hstack((ones, offsets)) if affine else ones
        if not affine:
            kept = _near(shifts - np.median(shifts[kept], axis=0)) if kept.all() else kept
        solved, *_ = np.linalg.lstsq(design[kept], shifts[kept])
        errors = shifts - design @ solved
        near = _near(errors, of=kept)
        distances = np.hypot(*errors.T)
        if np.array_equal(near, kept) or np.count_nonzero(near) < _LEAST_PATCHES:
            break
        kept = near
    leverage = np.sum(design[kept] @ np.linalg.pinv(design[kept].T @ design[kept]) * design[kept], axis=1)
    # what is left out of the fit is still displaced: relief, or a wrong match
    distances[kept] /= 1.0 - np.minimum(leverage, 0.9)
    residual = math.sqrt(float(np.mean(distances**2)))
    slopes = solved[1:].T / scale if affine else np.zeros((2, 2))
    change = np.hstack((np.eye(2) + slopes, (solved[0] - slopes @ middle)[:, None]))
    return change, kept, residual


def _near(errors: Matrix, of: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
    """Return True for the errors that are within 3 sigma of a robust scale, and at least 0.5 px."""
    distances = np.hypot(*errors.T)
    scale = _MAD_TO_SIGMA * float(np.median(distances if of is None else distances[of])) / 1.1774
    return np.asarray(distances <= max(3.0 * scale, 0.5), np.bool_)
