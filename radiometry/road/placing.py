"""Place of a frame over a road: from marked points, or from the frame's own place."""

import math
from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.frame.grid import map_plane
from radiometry.frame.opencv import cv2
from radiometry.frame.pose import Pose
from radiometry.frame.roi import Polygon
from radiometry.records import Record, about
from radiometry.road import codes
from radiometry.road.geojson import place_on_road, turn_axes
from radiometry.road.grid import outline_points
from radiometry.road.site import PLACES_M, Origin

Array = NDArray[np.float64]

FEWEST_MARKS = 4
MARK_U_PX = 1.0
_EXACT, _WORST_CONDITION = 1e-12, 1e7
_PIXELS = (-1e5, 1e6)
# Standard uncertainty of a nominal focal length, what a lens bends included, relative
NOMINAL_FOCAL_U = 0.02


class Lens(NamedTuple):
    """A camera in OpenCV's notation: its matrix, (3, 3) [px], and k1, k2, p1, p2, k3."""

    matrix: Array
    distortion: Array = np.zeros(5)

    @classmethod
    def of_focal_length(cls, focal_px: float, *, height_px: int, width_px: int) -> "Lens":
        """Return a camera of which no geometry is known but its nominal focal length."""
        x, y = (width_px - 1) / 2.0, (height_px - 1) / 2.0
        return cls(np.array([[focal_px, 0.0, x], [0.0, focal_px, y], [0.0, 0.0, 1.0]]))


class Mark(Record):
    """A point of the road that was found in the picture."""

    x_px: float = about("Column in the picture, from its left edge [px].", within=_PIXELS)
    y_px: float = about("Row in the picture, from its upper edge [px].", within=_PIXELS)
    x_m: float = about("Place along the road [m].", within=PLACES_M)
    y_m: float = about("Place across [m].", within=PLACES_M)
    u_m: float = about(
        "Standard uncertainty of each coordinate on the road [m].", default=0.03, within=(1e-4, 100.0)
    )


class Placement(Record):
    """Homography from the road to the picture of a lens without distortion, with its errors."""

    h: Array  # (3, 3), from (x, y, 1) on the road to (x, y) at unit distance from the lens; h[2, 2] = 1
    errors: Array  # Changes of h by one standard uncertainty of each of its errors, (errors, 3, 3)
    camera: Lens

    def to_image(self, places_m: Array) -> Array:
        """Compute where places on the road, (n, 2) [m], lie in the picture: (n, 2), x before y [px].

        Brown's model folds what is far outside the picture back into it: such places are shown unbent.
        """
        ideal, none = map_plane(self.h, places_m), np.zeros(3)
        rays = np.column_stack([ideal, np.ones(len(ideal))])
        seen, _ = cv2.projectPoints(rays, none, none, self.camera.matrix, self.camera.distortion)
        is_bent = np.linalg.norm(ideal, axis=1) <= _find_reach(self.camera.distortion)
        unbent = map_plane(self.camera.matrix, ideal)
        return np.asarray(np.where(is_bent[:, None], seen.reshape(-1, 2), unbent) + 0.5, np.float64)

    def outline(self, places_m: Array, sides_m: Array) -> tuple[Polygon, ...]:
        """Return the images of rectangles around places on the road."""
        corners = outline_points(places_m, sides_m)
        seen = self.to_image(corners.reshape(-1, 2)).reshape(corners.shape)
        return tuple(Polygon.from_points(each) for each in cast("list[list[list[float]]]", seen.tolist()))

    def estimate_u_m(self, places_m: Array) -> Array:
        """Estimate the standard uncertainty of places on the road, the larger of both axes, (n,) [m]."""
        return np.asarray(np.sqrt(np.linalg.eigvalsh(self.find_covariances(places_m))[:, -1]), np.float64)

    def find_covariances(self, places_m: Array) -> Array:
        """Estimate the covariance of each place on the road, (n, 2, 2) [m2]."""
        seen, places = map_plane(self.h, places_m), np.column_stack([places_m, np.ones(len(places_m))])
        moved = places @ self.errors.transpose(0, 2, 1)
        shifts = (moved[..., :2] - seen * moved[..., 2:]).transpose(1, 2, 0)
        moves = np.linalg.solve(self.h[:2, :2] - seen[:, :, None] * self.h[2:, :2], shifts)
        return np.asarray(moves @ moves.transpose(0, 2, 1), np.float64)

    def find_off_axis(self, places_m: Array) -> Array:
        """Compute the angles between the view of places and the lens's axis, (n,) [deg]."""
        return np.asarray(np.degrees(np.arctan(np.hypot(*map_plane(self.h, places_m).T))), np.float64)

    def find_views(self, places_m: Array) -> Array:
        """Compute the angles between the view of places and the vertical of the road, (n,) [deg].

        With a camera at c and the columns of h = s [r1 r2 -R c], the vertical is r1 x r2.
        """
        vertical = np.cross(self.h[:, 0], self.h[:, 1])
        rays = np.column_stack([map_plane(self.h, places_m), np.ones(len(places_m))])
        cosines = np.abs(rays @ vertical) / (np.linalg.norm(rays, axis=1) * np.linalg.norm(vertical))
        return np.asarray(np.degrees(np.arccos(np.clip(cosines, 0.0, 1.0))), np.float64)


def place_frame(marks: Sequence[Mark], camera: Lens, *, u_px: float = MARK_U_PX) -> Placement:
    """Place a frame by points of the road that were marked in it.

    The homography h minimises the distances in the picture, lens corrected, each over its uncertainty: that
    of the mark in the picture, and that of its place on the road. Its covariance is that of the fit, times
    chi^2 / dof where that exceeds 1 [1].

    [1] R. Hartley, A. Zisserman, Multiple View Geometry in Computer Vision, Cambridge 2004, section 5.2,
    doi:10.1017/CBO9780511811685

    Parameters
    ----------
    marks : sequence of Mark
        Points of the road in the picture, four or more.
    camera : Lens
        Camera of the frame.
    u_px : float, optional
        Standard uncertainty of each coordinate of a mark [px].
    """
    if len(marks) < FEWEST_MARKS:
        raise codes.PLACE_UNDETERMINED.refuse(f"{len(marks)} points are marked; four or more place a frame.")
    road = np.array([(mark.x_m, mark.y_m) for mark in marks], np.float64)
    u_m = np.array([mark.u_m for mark in marks])
    seen = straighten(camera, np.array([(mark.x_px, mark.y_px) for mark in marks], np.float64))
    u_ideal = u_px / np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1])

    def miss(eight: Array) -> Array:
        h = np.append(eight, 1.0).reshape(3, 3)
        # the square root of the area in the picture of a square metre
        scale = np.sqrt(np.abs(np.linalg.det(h) / (road @ h[2, :2] + 1.0) ** 3))
        return np.asarray(((map_plane(h, road) - seen) / np.hypot(u_ideal, scale * u_m)[:, None]).ravel())

    start, _ = cv2.findHomography(road, seen)
    undetermined = codes.PLACE_UNDETERMINED.refuse("The marked points lie on one line, or three of four do.")
    if start is None or not abs(start[2, 2]) > 0.0 or not np.all(np.isfinite(start / start[2, 2])):
        raise undetermined
    exact = dict.fromkeys(("ftol", "xtol", "gtol"), _EXACT)
    first = (start / start[2, 2]).ravel()[:8]
    try:
        fit = scipy.optimize.least_squares(miss, first, method="lm", x_scale="jac", **exact)
        sizes = np.linalg.norm(fit.jac, axis=0)
        _, strengths, axes = np.linalg.svd(fit.jac / np.where(sizes > 0.0, sizes, 1.0))
    except ValueError:  # a mark on the horizon
        raise undetermined from None
    if not strengths[0] <= _WORST_CONDITION * strengths[-1]:
        raise undetermined
    dof = 2 * len(marks) - 8
    excess = max(1.0, 2.0 * fit.cost / dof) if dof else 1.0
    errors = np.pad(math.sqrt(excess) * axes / strengths[:, None] / sizes, ((0, 0), (0, 1)))
    return Placement(h=np.append(fit.x, 1.0).reshape(3, 3), errors=errors.reshape(-1, 3, 3), camera=camera)


def place_by_pose(pose: Pose, origin: Origin, camera: Lens, *, focal_u_rel: float = 0.0) -> Placement:
    """Place a frame by its camera's own place and attitude over a level road.

    With the turn T of the camera's axes into north, east and down, axes N of the road in north and east, and
    the camera at c on the road and z above it::

        h ~ T' [[N, -N c], [0, 0, z]]

    Its covariance is that of position, height, attitude and focal length, by their changes of h.

    Parameters
    ----------
    pose : Pose
        Place and attitude with their uncertainties.
    origin : Origin
        Place of the road on the earth.
    camera : Lens
        Camera of the frame.
    focal_u_rel : float, optional
        Relative standard uncertainty of its focal length.
    """
    axes = turn_axes(origin)[::-1]
    above = axes @ place_on_road(origin, np.array([(pose.longitude_deg, pose.latitude_deg)]))[0]
    level, yaw = math.radians(pose.u_tilt_deg), math.radians(pose.u_yaw_deg)
    u = np.diag([pose.u_north_m, pose.u_east_m, pose.u_height_m, level, level, yaw, focal_u_rel])

    def project(moved: Array) -> Array:
        ground = np.zeros((3, 3))
        ground[:2, :2], ground[:2, 2], ground[2, 2] = axes, -above - moved[:2], pose.height_m + moved[2]
        h = (cv2.Rodrigues(moved[3:6])[0] @ pose.turn).T @ ground
        h[:2] *= 1.0 + moved[6]
        if not abs(h[2, 2]) > 0.0:
            raise codes.PLACE_UNDETERMINED.refuse("The camera looks past the road.")
        return np.asarray(h / h[2, 2], np.float64)

    errors = np.array([(project(move) - project(-move)) / 2.0 for move in u])
    return Placement(h=project(np.zeros(7)), errors=errors, camera=camera)


def straighten(camera: Lens, places_px: Array) -> Array:
    """Compute the directions that places in the picture, x before y [px], see: (n, 2), at unit distance."""
    seen = np.ascontiguousarray(places_px, np.float64).reshape(-1, 1, 2) - 0.5
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-12)
    ideal = cv2.undistortPoints(seen, camera.matrix, camera.distortion, criteria=stop)
    return np.asarray(ideal, np.float64).reshape(-1, 2)


def _find_reach(distortion: Array) -> float:
    """Return the radius at unit distance up to which a lens shows larger radii further outside."""
    k1, k2, _, _, k3 = distortion
    squares = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    turns = squares.real[(np.abs(squares.imag) < 1e-9) & (squares.real > 0.0)]
    return math.sqrt(min(turns, default=math.inf))
