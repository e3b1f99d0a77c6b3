"""Place of a map's pixels on the ground."""

from typing import Literal

from radiometry.records import Record, about

HeightSource = Literal["request", "ground_altitude", "take_off"]


class PlaceShare(Record):
    """One source's share of the uncertainty of a place, in the frame's centre and its worst corner [m]."""

    source: str
    u_centre_m: float
    u_corner_m: float


class Place(Record):
    """Place of a frame's pixels on level ground."""

    form: Literal["affine", "tie_points", "none"] = about(
        '"affine" if one affine transformation is as good as the place is known; "tie_points" if lens '
        'and tilt bend the picture more than that; "none" if the place is not determined.'
    )
    detail: str = about("Reason of the form.")
    crs: str | None = about('"EPSG:4326".', default=None)
    transform: tuple[float, ...] | None = about(
        "(a, b, c, d, e, f) of longitude = a + b col + c row and latitude = d + e col + f row [deg], "
        "counted from the outer corner of the first pixel, as GDAL does. Stated of the form "
        '"tie_points" too.',
        default=None,
    )
    tie_points: tuple[tuple[float, ...], ...] = about(
        "(col, row, longitude, latitude) of a grid over the frame, counted likewise.", default=()
    )
    corners: tuple[tuple[float, float], ...] = about(
        "(longitude, latitude) of the frame's corners [deg]: top-left, top-right, bottom-right, bottom- "
        "left.",
        default=(),
    )
    height_above_ground_m: float | None = about("Height that was used [m].", default=None)
    height_source: HeightSource | None = about("Source of the height.", default=None)
    attitude_source: str | None = about('"gimbal" or "camera".', default=None)
    tilt_deg: float | None = about("Angle between the lens's axis and the vertical [deg].", default=None)
    pixel_m: float | None = about("Side of a pixel on the ground, root of its mean area [m].", default=None)
    residual_m: float | None = about(
        "Largest distance between the affine transformation and the projection [m].", default=None
    )
    u_centre_m: float | None = about(
        "Standard uncertainty of the place, both axes together (root mean square distance), in the "
        "centre and the worst corner [m].",
        default=None,
    )
    u_corner_m: float | None = about(
        "Standard uncertainty of the place, both axes together (root mean square distance), in the "
        "centre and the worst corner [m].",
        default=None,
    )
    budget: tuple[PlaceShare, ...] = about("Sources of the uncertainty.", default=())
