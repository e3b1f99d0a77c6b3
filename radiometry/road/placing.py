"""Place of a frame over a road: from marked points, or from the frame's own place."""

import math
from collections.abc import Sequence
from typing import Protocol, cast

import numpy as np
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
_ITERATIONS = 20
_WORST_CONDITION = 1e7
# Standard uncertainty of a nominal focal length, what a lens bends included, relative
NOMINAL_FOCAL_U = 0.02


class Camera(Protocol):
    """A camera in OpenCV's notation, such as a version of the geometry method makes."""

    @property
    def matrix(self) -> Array:
        """Camera matrix, (3, 3) [px]."""

    @property
    def distortion(self) -> Array:
        """Distortion coefficients k1, k2, p1, p2, k3."""


class PlainCamera(Record):
    """A camera of which no geometry is known but its nominal focal length."""

    focal_px: float
    height_px: int
    width_px: int

    @property
    def matrix(self) -> Array:
        """Camera matrix about the middle of the picture."""
        middle = (self.width_px - 1) / 2.0, (self.height_px - 1) / 2.0
        return np.array([[self.focal_px, 0.0, middle[0]], [0.0, self.focal_px, middle[1]], [0.0, 0.0, 1.0]])

    @property
    def distortion(self) -> Array:
        """No distortion."""
        return np.zeros(5)


_PIXELS = (-1e5, 1e6)


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
    """Homography from the road to the picture of a lens without distortion, with its covariance."""

    h: Array  # (3, 3), from (x, y, 1) on the road to (x, y) at unit distance from the lens; h[2, 2] = 1
    covariance: Array  # of its first eight elements, (8, 8)
    camera: Camera

    def to_image(self, places_m: Array) -> Array:
        """Compute where places on the road, (n, 2) [m], lie in the picture: (n, 2), x before y [px].

        Brown's model folds what is far outside the picture back into it: such places are shown unbent.
        """
        ideal = map_plane(self.h, places_m)
        rays = np.column_stack([ideal, np.ones(len(ideal))])
        none = np.zeros(3)
        seen, _ = cv2.projectPoints(rays, none, none, self.camera.matrix, self.camera.distortion)
        is_bent = np.linalg.norm(ideal, axis=1) <= _find_reach(self.camera.distortion)
        unbent = map_plane(self.camera.matrix, ideal)
        return np.asarray(np.where(is_bent[:, None], seen.reshape(-1, 2), unbent) + 0.5, np.float64)

    def outline(self, places_m: Array, sides_m: Array) -> tuple[Polygon, ...]:
        """Return the images of rectangles around places on the road."""
        corners = outline_points(places_m, sides_m)
        seen = self.to_image(corners.reshape(-1, 2)).reshape(corners.shape)
        return tuple(Polygon.from_points(each) for each in cast("list[list[list[float]]]", seen.tolist()))

    def to_road(self, places_px: Array) -> Array:
        """Compute where places in the picture, (n, 2), x before y [px], lie on the road: (n, 2) [m]."""
        back = np.asarray(np.linalg.inv(self.h), np.float64)
        return map_plane(back, _straighten(self.camera, places_px))

    def estimate_u_m(self, places_m: Array) -> Array:
        """Estimate the standard uncertainty of places on the road, the larger of both axes, (n,) [m]."""
        return np.asarray(np.sqrt(np.linalg.eigvalsh(self.find_covariances(places_m))[:, -1]), np.float64)

    def find_covariances(self, places_m: Array) -> Array:
        """Estimate the covariance of each place on the road, (n, 2, 2) [m2]."""
        design = _differentiate(self.h, places_m)
        spread = design @ self.covariance @ design.transpose(0, 2, 1)
        back = np.linalg.inv(_differentiate_places(self.h, places_m))
        return np.asarray(back @ spread @ back.transpose(0, 2, 1), np.float64)

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


def place_frame(marks: Sequence[Mark], camera: Camera, *, u_px: float = MARK_U_PX) -> Placement:
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
    camera : Camera
        Camera of the frame.
    u_px : float, optional
        Standard uncertainty of each coordinate of a mark [px].
    """
    if len(marks) < FEWEST_MARKS:
        raise codes.PLACE_UNDETERMINED.refuse(f"{len(marks)} points are marked; four or more place a frame.")
    road = np.array([(mark.x_m, mark.y_m) for mark in marks], np.float64)
    seen = _straighten(camera, np.array([(mark.x_px, mark.y_px) for mark in marks], np.float64))
    h = _start(road, seen)
    u_ideal = u_px / np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1])
    for _ in range(_ITERATIONS):
        scale = np.abs(np.linalg.det(_differentiate_places(h, road))) ** 0.5
        weights = 1.0 / np.hypot(u_ideal, scale * [mark.u_m for mark in marks])
        design = (_differentiate(h, road) * weights[:, None, None]).reshape(-1, 8)
        residual = ((seen - map_plane(h, road)) * weights[:, None]).ravel()
        sizes = np.linalg.norm(design, axis=0)
        if not np.all(np.isfinite(design)) or np.linalg.cond(design / sizes) > _WORST_CONDITION:
            raise _undetermined()
        step = np.linalg.lstsq(design / sizes, residual, rcond=None)[0] / sizes
        h = h + np.append(step, 0.0).reshape(3, 3)
        if np.max(np.abs(step * sizes)) < 1e-6:
            break
    dof = 2 * len(marks) - 8
    excess = max(1.0, float(residual @ residual) / dof) if dof else 1.0
    inverse = np.linalg.inv((design / sizes).T @ (design / sizes)) / np.outer(sizes, sizes)
    return Placement(h=h, covariance=excess * inverse, camera=camera)


def place_by_pose(pose: Pose, origin: Origin, camera: Camera, *, focal_u_rel: float = 0.0) -> Placement:
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
    camera : Camera
        Camera of the frame.
    focal_u_rel : float, optional
        Relative standard uncertainty of its focal length.
    """
    axes = turn_axes(origin)[::-1]
    above = axes @ place_on_road(origin, np.array([(pose.longitude_deg, pose.latitude_deg)]))[0]
    level = math.radians(pose.u_tilt_deg)
    u = np.array([pose.u_north_m, pose.u_east_m, pose.u_height_m, level, level, math.radians(pose.u_yaw_deg)])

    def project(moved: Array, focal_rel: float = 0.0) -> Array:
        ground = np.zeros((3, 3))
        ground[:2, :2], ground[:2, 2], ground[2, 2] = axes, -above - moved[:2], pose.height_m + moved[2]
        h = (cv2.Rodrigues(moved[3:])[0] @ pose.turn).T @ ground
        h[:2] *= 1.0 + focal_rel
        if not abs(h[2, 2]) > 0.0:
            raise codes.PLACE_UNDETERMINED.refuse("The camera looks past the road.")
        return np.asarray(h / h[2, 2], np.float64)

    middle = project(np.zeros(6))
    ends = [(project(move), project(-move)) for move in np.diag(u)]
    ends.append((project(np.zeros(6), focal_u_rel), project(np.zeros(6), -focal_u_rel)))
    changes = np.array([(up - down).ravel()[:8] / 2.0 for up, down in ends])
    return Placement(h=middle, covariance=changes.T @ changes, camera=camera)


def _straighten(camera: Camera, places_px: Array) -> Array:
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


def _undetermined() -> Exception:
    return codes.PLACE_UNDETERMINED.refuse("The marked points lie on one line, or three of four do.")


def _start(road: Array, seen: Array) -> Array:
    """Return the homography that OpenCV finds, in single precision."""
    h, _ = cv2.findHomography(road, seen)
    if h is None or not abs(h[2, 2]) > 0.0:
        raise _undetermined()
    return np.asarray(h / h[2, 2], np.float64)


def _differentiate(h: Array, places_m: Array) -> Array:
    """Return the derivative of the images of places to the first eight elements of h, (n, 2, 8)."""
    ones = np.column_stack([places_m, np.ones(len(places_m))])
    depth = ones @ h[2]
    seen = map_plane(h, places_m)
    slope = np.zeros((len(places_m), 2, 8))
    slope[:, 0, 0:3] = slope[:, 1, 3:6] = ones / depth[:, None]
    slope[:, :, 6:8] = -seen[:, :, None] * places_m[:, None, :] / depth[:, None, None]
    return slope


def _differentiate_places(h: Array, places_m: Array) -> Array:
    """Return the derivative of the images of places to the places, (n, 2, 2)."""
    depth = np.column_stack([places_m, np.ones(len(places_m))]) @ h[2]
    seen = map_plane(h, places_m)
    slope: Array = (h[None, :2, :2] - seen[:, :, None] * h[None, 2:, :2]) / depth[:, None, None]
    return slope
