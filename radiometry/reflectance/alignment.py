"""Alignment of the bands of one capture by the lens data that the files state."""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.frame.multispectral import RigGeometry
from radiometry.frame.roi import Polygon
from radiometry.reflectance import codes
from radiometry.reflectance.registration import IDENTITY

Grid = NDArray[np.float64]
Matrix = tuple[float, ...]

_WIDEST_RAD = 1.4
_NOWHERE_PX = -10.0
_UNDISTORT_STEPS = 20


def align(
    plane: NDArray[np.float32],
    *,
    of: RigGeometry | None,
    onto: RigGeometry | None,
    matrix: Matrix = IDENTITY,
) -> NDArray[np.float32]:
    """Resample a band's whole frame to the pixels of another band of the same capture.

    Parameters
    ----------
    plane : ndarray of float32
        Whole frame of band `of`, (row, col).
    of : RigGeometry or None
        Lens of the band to resample.
    onto : RigGeometry or None
        Lens of the band whose pixels are the result.
    matrix : tuple of float, default: IDENTITY
        Correction of `Registration.matrix`, applied to the pixels of the result first.

    Returns
    -------
    ndarray of float32
        Bilinear values, (row, col); NaN where the other band did not look, or was
        saturated.

    Raises
    ------
    InputRejected
        `bands_not_aligned` if a file does not state the rotation of its band.

    Notes
    -----
    A pixel's direction in one camera and in the other is related by [1]_::

        d_of = R_of^T R_onto d_onto

    R = R_x(omega) R_y(phi) R_z(kappa) rotates a band's directions into the rig's
    reference band's. A DJI camera states for each capture by how many pixels a band
    is moved instead, which is all that is corrected then: on a real capture 4 px or
    less remain of 11. Otherwise only the rotation is corrected. Lenses b [m] apart see a
    surface h [m] away shifted by c b/h pixels, c = 1055 px in a Sequoia: half a
    pixel for 2 cm and 40 m, tens for a panel close by; `register` finds it. The sense
    of R was determined on a real Sequoia capture (see the tests).

    References
    ----------
    .. [1] Pix4D, "How are the internal and external camera parameters defined?"
           (lens models)
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
    matrix: Matrix = IDENTITY,
) -> tuple[Polygon, Polygon]:
    """Return a region of band `onto` as both bands see it: the part of it that both frames contain.

    Parameters
    ----------
    polygon : Polygon
        Region in the frame of `onto`.
    of, onto : RigGeometry or None
        Lenses of the two bands.
    height_px, width_px : int
        Size of the frames [px].
    matrix : tuple of float, default: IDENTITY
        Correction as in `align`.

    Returns
    -------
    tuple[Polygon, Polygon]
        Region in the frame of `onto`, and in that of `of`.

    Raises
    ------
    InputRejected
        `bands_not_aligned` as in `align`; `roi_outside_frame` if the other band
        sees nothing of the region.

    Notes
    -----
    The corners are moved as `align` moves pixels; the lines between them stay
    straight.
    """
    lenses = (require_lens_data(of), require_lens_data(onto))
    try:
        moved = _move_points(np.array(polygon.points), of=lenses[0], onto=lenses[1], matrix=matrix)
        held = np.clip(moved, 0.0, (width_px, height_px))
        if np.array_equal(held, moved):
            return polygon, Polygon.from_points(held.tolist())
        back = _move_points(held, of=lenses[1], onto=lenses[0])
        unmoved = np.linalg.solve(_square(matrix), _homogeneous(back - 0.5).T)
        back = np.asarray(0.5 + unmoved.T[:, :2], np.float64)
        return Polygon.from_points(np.clip(back, 0.0, (width_px, height_px)).tolist()), Polygon.from_points(
            held.tolist()
        )
    except InputRejected as refusal:
        raise InputRejected(
            shared.ROI_OUTSIDE_FRAME,
            "The other band of this capture looks a little aside, and does not see this region. "
            "Draw it nearer to the middle of the frame.",
        ) from refusal


def _move_points(points: Grid, *, of: RigGeometry, onto: RigGeometry, matrix: Matrix = IDENTITY) -> Grid:
    """Move points (n, 2) [px] from where `onto` sees them: a region's 0.5 is the centre of pixel 0."""
    x, y = _find_positions(points[:, 0] - 0.5, points[:, 1] - 0.5, of=of, onto=onto, matrix=matrix)
    return np.column_stack((x, y)) + 0.5


def _homogeneous(points: Grid) -> Grid:
    return np.column_stack((points, np.ones(len(points))))


def _square(matrix: Matrix) -> Grid:
    return np.array((*matrix, 0.0, 0.0, 1.0)).reshape(3, 3)


def _find_positions(
    x: Grid, y: Grid, *, of: RigGeometry, onto: RigGeometry, matrix: Matrix
) -> tuple[Grid, Grid]:
    """Return where (x, y) [px] band `of` sees what `onto` sees at x, y, or a position beside the image.

    A file may state any number, and resampling at a position that is not finite
    reads outside the memory: what is not finite, or behind the lens, is put beside
    the image.
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
    """Compute the unit direction of each pixel position in the band's own frame.

    Parameters
    ----------
    lens : RigGeometry
        Lens of the band.
    x, y : Grid
        Pixel positions [px].

    Returns
    -------
    Grid
        Unit vectors, (..., 3), with z forward.
    """
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
    """Compute the pixel position of directions in the band's own frame.

    Parameters
    ----------
    lens : RigGeometry
        Lens of the band.
    directions : Grid
        Directions, (..., 3).

    Returns
    -------
    tuple[Grid, Grid]
        x and y [px].
    """
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
    """Compute the rotation of a band's directions into the rig's reference band; none where none is stated.

    Parameters
    ----------
    lens : RigGeometry
        Lens of the band.

    Returns
    -------
    Grid
        R_x(omega) R_y(phi) R_z(kappa), (3, 3).
    """
    omega, phi, kappa = (math.radians(angle) for angle in lens.rotation_deg or (0.0, 0.0, 0.0))
    about_x = [[1, 0, 0], [0, math.cos(omega), -math.sin(omega)], [0, math.sin(omega), math.cos(omega)]]
    about_y = [[math.cos(phi), 0, math.sin(phi)], [0, 1, 0], [-math.sin(phi), 0, math.cos(phi)]]
    about_z = [[math.cos(kappa), -math.sin(kappa), 0], [math.sin(kappa), math.cos(kappa), 0], [0, 0, 1]]
    return np.asarray(np.array(about_x) @ np.array(about_y) @ np.array(about_z), np.float64)


def require_lens_data(lens: RigGeometry | None, *, turned: bool = True) -> RigGeometry:
    """Refuse a band whose file does not state enough to align it.

    Parameters
    ----------
    lens : RigGeometry or None
        Lens of the band.
    turned : bool, default: True
        True if its rotation must be stated too; without it the band can be aligned by correlation alone.

    Returns
    -------
    RigGeometry
        The lens.

    Raises
    ------
    InputRejected
        `bands_not_aligned`.
    """
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
        raise InputRejected(
            codes.BANDS_NOT_ALIGNED,
            "A file of this capture does not state how its band lies against the others (RigRelatives), and "
            "too few edges agree between the bands to find it: an index would compare different places. "
            "Align them with photogrammetry software and compute the index there.",
        )
    return lens
