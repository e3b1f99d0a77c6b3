"""Place of a map's pixels on the ground."""

from dataclasses import dataclass
from typing import Literal

Form = Literal["affine", "tie_points", "none"]
HeightSource = Literal["request", "ground_altitude", "take_off"]


@dataclass(frozen=True, kw_only=True)
class PlaceShare:
    """One source's share of the uncertainty of a place, in the frame's centre and its worst corner [m]."""

    source: str
    u_centre_m: float
    u_corner_m: float


@dataclass(frozen=True, kw_only=True)
class Place:
    """Place of a frame's pixels on level ground.

    Attributes
    ----------
    form : {"affine", "tie_points", "none"}
        "affine" if one affine transformation is as good as the place is known; "tie_points" if lens and tilt
        bend the picture more than that; "none" if the place is not determined.
    detail : str
        Reason of the form.
    crs : str or None, default: None
        "EPSG:4326".
    transform : tuple of float or None, default: None
        (a, b, c, d, e, f) of longitude = a + b col + c row and latitude = d + e col + f row [deg], counted
        from the outer corner of the first pixel, as GDAL does. Stated of the form "tie_points" too.
    tie_points : tuple, default: ()
        (col, row, longitude, latitude) of a grid over the frame, counted likewise.
    corners : tuple, default: ()
        (longitude, latitude) of the frame's corners [deg]: top-left, top-right, bottom-right, bottom-left.
    height_above_ground_m : float or None, default: None
        Height that was used [m].
    height_source : {"request", "ground_altitude", "take_off"} or None, default: None
        Source of the height.
    attitude_source : str or None, default: None
        "gimbal" or "camera".
    tilt_deg : float or None, default: None
        Angle between the lens's axis and the vertical [deg].
    pixel_m : float or None, default: None
        Side of a pixel on the ground, root of its mean area [m].
    residual_m : float or None, default: None
        Largest distance between the affine transformation and the projection [m].
    u_centre_m, u_corner_m : float or None, default: None
        Standard uncertainty of the place, both axes together (root mean square distance), in the centre and
        the worst corner [m].
    budget : tuple of PlaceShare, default: ()
        Sources of the uncertainty.
    """

    form: Form
    detail: str
    crs: str | None = None
    transform: tuple[float, ...] | None = None
    tie_points: tuple[tuple[float, ...], ...] = ()
    corners: tuple[tuple[float, float], ...] = ()
    height_above_ground_m: float | None = None
    height_source: HeightSource | None = None
    attitude_source: str | None = None
    tilt_deg: float | None = None
    pixel_m: float | None = None
    residual_m: float | None = None
    u_centre_m: float | None = None
    u_corner_m: float | None = None
    budget: tuple[PlaceShare, ...] = ()
