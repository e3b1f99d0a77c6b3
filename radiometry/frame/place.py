"""Place of a map's pixels on the ground."""

from dataclasses import dataclass, field
from typing import Literal

from radiometry.specification.parameters import about

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
    """Place of a frame's pixels on level ground."""

    form: Form = field(
        metadata=about(
            '"affine" if one affine transformation is as good as the place is known; "tie_points" if lens '
            'and tilt bend the picture more than that; "none" if the place is not determined.'
        )
    )
    detail: str = field(metadata=about("Reason of the form."))
    crs: str | None = field(default=None, metadata=about('"EPSG:4326".'))
    transform: tuple[float, ...] | None = field(
        default=None,
        metadata=about(
            "(a, b, c, d, e, f) of longitude = a + b col + c row and latitude = d + e col + f row [deg], "
            "counted from the outer corner of the first pixel, as GDAL does. Stated of the form "
            '"tie_points" too.'
        ),
    )
    tie_points: tuple[tuple[float, ...], ...] = field(
        default=(),
        metadata=about("(col, row, longitude, latitude) of a grid over the frame, counted likewise."),
    )
    corners: tuple[tuple[float, float], ...] = field(
        default=(),
        metadata=about(
            "(longitude, latitude) of the frame's corners [deg]: top-left, top-right, bottom-right, bottom- "
            "left."
        ),
    )
    height_above_ground_m: float | None = field(default=None, metadata=about("Height that was used [m]."))
    height_source: HeightSource | None = field(default=None, metadata=about("Source of the height."))
    attitude_source: str | None = field(default=None, metadata=about('"gimbal" or "camera".'))
    tilt_deg: float | None = field(
        default=None, metadata=about("Angle between the lens's axis and the vertical [deg].")
    )
    pixel_m: float | None = field(
        default=None, metadata=about("Side of a pixel on the ground, root of its mean area [m].")
    )
    residual_m: float | None = field(
        default=None,
        metadata=about("Largest distance between the affine transformation and the projection [m]."),
    )
    u_centre_m: float | None = field(
        default=None,
        metadata=about(
            "Standard uncertainty of the place, both axes together (root mean square distance), in the "
            "centre and the worst corner [m]."
        ),
    )
    u_corner_m: float | None = field(
        default=None,
        metadata=about(
            "Standard uncertainty of the place, both axes together (root mean square distance), in the "
            "centre and the worst corner [m]."
        ),
    )
    budget: tuple[PlaceShare, ...] = field(default=(), metadata=about("Sources of the uncertainty."))
