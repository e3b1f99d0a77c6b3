"""Alignment of the bands of one capture: by the lens data of their files, then by correlation of edges."""

import math
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.frame.multispectral import RigGeometry
from radiometry.frame.opencv import cv2
from radiometry.frame.roi import Polygon
from radiometry.records import Record
from radiometry.reflectance import codes

Plane = NDArray[np.float32]
Matrix = NDArray[np.float64]
Grid = NDArray[np.float64]
Affine = tuple[float, ...]

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
_WIDEST_RAD = 1.4
_NOWHERE_PX = -10.0
_UNDISTORT_STEPS = 20


class Registration(Record):
    """Alignment of a band onto another by correlation, after that by the files' lens data."""

    # (a, b, c, d, e, f): the band shows what the other shows at (x, y) where the lens data put
    # (a x + b y + c, d x + e y + f)
    matrix: tuple[float, ...]
    shift_px: tuple[float, float]  # (x, y) in the middle of the frame
    residual_px: float | None  # rms distance of the patches from the others' fit; None if there are too few
    patches: int  # that follow the correction
    tried: int
    trusted: bool  # True if the correction was applied


def register(fixed: Plane, moving: Plane, *, reach_px: int = 0) -> Registration:
    """Find by how much a band is displaced against another after the alignment by lens data.

    Bands of one scene differ in contrast, and its sign, but share edges: what is correlated is the strength
    of the gradient over its local mean. Patches of 64 px are searched by normalised correlation, with a
    parabola through the peak. A patch counts if the correlation is at least 0.3, its peak lies inside the
    search, and the search back from the other band ends within 0.7 px of its start; on water or bare noise
    few do. An affine correction is fitted to them without outliers, three times; only a shift to fewer than
    16, or to those that do not span half of the frame both ways. It is trusted with 8 patches and 15 % of
    those tried, and a residual of 1.5 px or less. Each patch's distance is that from the fit of the others: e
    / (1 - h) with the leverage h. Outliers count in the residual: they are mostly relief, which displaces the
    region too.
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


def align(
    plane: NDArray[np.float32], *, of: RigGeometry | None, onto: RigGeometry | None, matrix: Affine = IDENTITY
) -> NDArray[np.float32]:
    """Resample a band's whole frame to the pixels of another band of the same capture.

    A pixel's direction in one camera and in the other is related by [1]::

        d_of = R_of^T R_onto d_onto

    R = R_x(omega) R_y(phi) R_z(kappa) rotates a band's directions into the rig's reference band's. A DJI
    camera states for each capture by how many pixels a band is moved instead, which is all that is corrected
    then: on a real capture 4 px or less remain of 11. Otherwise only the rotation is corrected. Lenses b [m]
    apart see a surface h [m] away shifted by c b/h pixels, c = 1055 px in a Sequoia: half a pixel for 2 cm
    and 40 m, tens for a panel close by; `register` finds it. The sense of R was determined on a real Sequoia
    capture (see the tests).

    [1] Pix4D, "How are the internal and external camera parameters defined?" (lens models)
    """
    rows, cols = (np.arange(size, dtype=np.float64) for size in plane.shape)
    x, y = _find_positions(
        np.broadcast_to(cols, plane.shape),
        np.broadcast_to(rows[:, None], plane.shape),
        of=require_lens_data(of),
        onto=require_lens_data(onto),
        matrix=matrix,
    )
    found = scipy.ndimage.map_coordinates(
        plane, [y, x], order=1, mode="constant", cval=np.nan, output=np.float32
    )
    return np.asarray(found, np.float32)


def move_region(
    polygon: Polygon,
    *,
    of: RigGeometry | None,
    onto: RigGeometry | None,
    height_px: int,
    width_px: int,
    matrix: Affine = IDENTITY,
) -> tuple[Polygon, Polygon]:
    """Return a region of band `onto` as both bands see it: the part of it that both frames contain.

    The corners are moved as `align` moves pixels; the lines between them stay straight.
    """
    lenses = (require_lens_data(of), require_lens_data(onto))
    try:
        moved = _move_points(np.array(polygon.points), of=lenses[0], onto=lenses[1], matrix=matrix)
        held = np.clip(moved, 0.0, (width_px, height_px))
        if np.array_equal(held, moved):
            return polygon, Polygon.from_points(held.tolist())
        back = _move_points(held, of=lenses[1], onto=lenses[0])
        unmoved = np.linalg.solve(
            np.array((*matrix, 0.0, 0.0, 1.0)).reshape(3, 3),
            np.column_stack((back - 0.5, np.ones(len(back)))).T,
        )
        back = np.asarray(0.5 + unmoved.T[:, :2], np.float64)
        return Polygon.from_points(np.clip(back, 0.0, (width_px, height_px)).tolist()), Polygon.from_points(
            held.tolist()
        )
    except InputRejected as refusal:
        raise shared.ROI_OUTSIDE_FRAME.reject(
            "The other band of this capture looks a little aside, and does not see this region. "
            "Draw it nearer to the middle of the frame."
        ) from refusal


def _move_points(points: Grid, *, of: RigGeometry, onto: RigGeometry, matrix: Affine = IDENTITY) -> Grid:
    """Move points (n, 2) [px] from where `onto` sees them: a region's 0.5 is the centre of pixel 0."""
    x, y = _find_positions(points[:, 0] - 0.5, points[:, 1] - 0.5, of=of, onto=onto, matrix=matrix)
    return np.column_stack((x, y)) + 0.5


def _find_positions(
    x: Grid, y: Grid, *, of: RigGeometry, onto: RigGeometry, matrix: Affine
) -> tuple[Grid, Grid]:
    """Return where (x, y) [px] band `of` sees what `onto` sees at x, y, or a position beside the image.

    A file may state any number, and resampling at a position that is not finite reads outside the memory:
    what is not finite, or behind the lens, is put beside the image.
    """
    a, b, c, d, e, f = matrix
    x, y = a * x + b * y + c, d * x + e * y + f
    if of.offset_px is not None and onto.offset_px is not None:
        (dx, dy), (x0, y0) = of.offset_px, onto.offset_px
        return x + (dx - x0), y + (dy - y0)
    with np.errstate(all="ignore"):
        directions = find_directions(onto, x=x, y=y)
        turned = directions @ (rotate_into_rig(of).T @ rotate_into_rig(onto)).T
        x, y = project(of, turned)
        seen = np.isfinite(x) & np.isfinite(y) & (turned[..., 2] > 0.0)
    return np.where(seen, x, _NOWHERE_PX), np.where(seen, y, _NOWHERE_PX)


def find_directions(lens: RigGeometry, *, x: Grid, y: Grid) -> Grid:
    u, v = x - lens.principal_point_px[0], y - lens.principal_point_px[1]
    if lens.model == "fisheye":
        c, d, e, f = lens.fisheye_affine
        u, v = (f * u - d * v) / (c * f - d * e), (c * v - e * u) / (c * f - d * e)
        radius = np.hypot(u, v)
        angles = np.linspace(0.0, _WIDEST_RAD, 4096)
        angle = np.interp(radius, _fisheye_radius(lens, angles), angles)
        along = np.sin(angle) / np.maximum(radius, 1e-12)
        return np.stack((u * along, v * along, np.cos(angle)), axis=-1)
    focal = lens.focal_length_px or 1.0
    u, v = u / focal, v / (lens.focal_length_y_px or focal)
    plain_u, plain_v = u, v
    for _ in range(_UNDISTORT_STEPS):
        seen_u, seen_v = _distort(lens, plain_u, plain_v)
        plain_u, plain_v = plain_u + u - seen_u, plain_v + v - seen_v
    norm = np.sqrt(plain_u**2 + plain_v**2 + 1.0)
    return np.stack((plain_u / norm, plain_v / norm, 1.0 / norm), axis=-1)


def project(lens: RigGeometry, directions: Grid) -> tuple[Grid, Grid]:
    a, b, forward = directions[..., 0], directions[..., 1], directions[..., 2]
    if lens.model == "fisheye":
        sideways = np.hypot(a, b)
        ratio = _fisheye_radius(lens, np.arctan2(sideways, forward)) / np.maximum(sideways, 1e-12)
        c, d, e, f = lens.fisheye_affine
        u, v = (c * a + d * b) * ratio, (e * a + f * b) * ratio
    else:
        u, v = _distort(lens, a / forward, b / forward)
        focal = lens.focal_length_px or 1.0
        u, v = focal * u, (lens.focal_length_y_px or focal) * v
    return u + lens.principal_point_px[0], v + lens.principal_point_px[1]


def _fisheye_radius(lens: RigGeometry, angle: Grid) -> Grid:
    """Compute rho = p0 + p1 t + p2 t^2 + ..., t = 2 angle / pi."""
    return np.asarray(
        np.polynomial.polynomial.polyval(2.0 * angle / math.pi, np.array(lens.fisheye_polynomial))
    )


def _distort(lens: RigGeometry, u: Grid, v: Grid) -> tuple[Grid, Grid]:
    """Apply Brown's model, k1 k2 k3 p1 p2."""
    k1, k2, k3, p1, p2 = lens.distortion
    square = u * u + v * v
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))
    return (
        u * radial + 2.0 * p1 * u * v + p2 * (square + 2.0 * u * u),
        v * radial + p1 * (square + 2.0 * v * v) + 2.0 * p2 * u * v,
    )


def rotate_into_rig(lens: RigGeometry) -> Grid:
    """Compute the rotation of a band's directions into the rig's reference band, as far as it is stated."""
    omega, phi, kappa = (math.radians(angle) for angle in lens.rotation_deg or (0.0, 0.0, 0.0))
    about_x = [[1, 0, 0], [0, math.cos(omega), -math.sin(omega)], [0, math.sin(omega), math.cos(omega)]]
    about_y = [[math.cos(phi), 0, math.sin(phi)], [0, 1, 0], [-math.sin(phi), 0, math.cos(phi)]]
    about_z = [[math.cos(kappa), -math.sin(kappa), 0], [math.sin(kappa), math.cos(kappa), 0], [0, 0, 1]]
    return np.asarray(np.array(about_x) @ np.array(about_y) @ np.array(about_z), np.float64)


def require_lens_data(lens: RigGeometry | None, *, turned: bool = True) -> RigGeometry:
    """Refuse a band whose file does not state enough to align it."""
    if lens is not None and lens.offset_px is not None:
        return lens
    whole = lens is not None and (lens.rotation_deg is not None or not turned)
    if whole and lens is not None and lens.model == "fisheye":
        affine, terms = lens.fisheye_affine, lens.fisheye_polynomial
        whole = len(affine) == 4 and affine[0] * affine[3] != affine[1] * affine[2] and len(terms) > 1
        whole = whole and bool(
            np.all(np.diff(_fisheye_radius(lens, np.linspace(0.0, _WIDEST_RAD, 64))) > 0.0)
        )
    elif whole and lens is not None:
        whole = lens.focal_length_px is not None and lens.focal_length_px > 0.0 and len(lens.distortion) == 5
    if not whole or lens is None:
        raise codes.BANDS_NOT_ALIGNED.reject(
            "A file of this capture does not state how its band lies against the others (RigRelatives), and "
            "too few edges agree between the bands to find it: an index would compare different places. "
            "Align them with photogrammetry software and compute the index there."
        )
    return lens
