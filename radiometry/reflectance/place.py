"""Place of a frame's pixels on level ground, from the position, attitude and height that are stated."""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame import FrameHeader
from radiometry.frame.place import HeightSource, Place, PlaceShare
from radiometry.reflectance import codes
from radiometry.reflectance.alignment import find_directions, require_lens_data, rotate_into_rig
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.tools.motion import Attitude, rotate

Plane = NDArray[np.float64]

CRS: Final = "EPSG:4326"
_WGS84_M, _WGS84_E2 = 6378137.0, 6.69437999014e-3
_HIGHEST_LATITUDE_DEG: Final = 89.0
_LARGEST_ANGLE_DEG: Final = 80.0
_POINTS: Final = 21
_TIE_POINTS: Final = slice(None, None, 2)
_STEP_RAD: Final = 1e-4
_CENTRE: Final = (_POINTS // 2, _POINTS // 2)
_CORNERS: Final = ((0, 0), (0, -1), (-1, -1), (-1, 0))
_U_POSITION_M: Final = 2.5
"""Along each axis, of a receiver that states no deviation; DJI's at times is off by this without RTK."""

_U_HEIGHT: Final[dict[HeightSource, tuple[float, float]]] = {
    "request": (1.0, 0.05),
    "ground_altitude": (5.0, 0.0),
    "take_off": (3.0, 0.05),
}
"""Standard uncertainty of a height, a constant [m] and a share, relief of usual fields included."""


class _Mount(NamedTuple):
    """Angles of a camera and their standard uncertainties, which no file states."""

    family: str
    suffix: str
    axes: tuple[tuple[int, int, int], ...]
    u_tilt_deg: float
    u_yaw_deg: float


# Rows of `axes`: the body's forward, right and down in the camera's right, down and forward. At a pitch of
# 0 DJI's gimbal looks forward, and a camera by Pix4D's definition down, its upper edge forward.
_MOUNTS: Final = {
    "gimbal": _Mount("drone-dji:Gimbal", "Degree", ((0, 0, 1), (1, 0, 0), (0, 1, 0)), 1.0, 3.0),
    "camera": _Mount("camera:", "", ((0, -1, 0), (1, 0, 0), (0, 0, 1)), 2.0, 5.0),
}


@dataclass(frozen=True, kw_only=True)
class GroundHeight:
    """Height of the camera above the ground, as a measurement states it; None for what is not known."""

    height_above_ground_m: float | None = parameter(
        None,
        label="Height above the ground",
        description="Of the camera, above ground that is taken as level: places the map.",
        default_text="that above take-off, where the file states it",
        unit="m",
        example=60.0,
        bounds="(0, 1e4]",
    )
    ground_altitude_m: float | None = parameter(
        None,
        label="Altitude of the ground",
        description="In place of the height above the ground, in the height system of the file's altitude.",
        default_text="unknown",
        unit="m",
        example=183.0,
        bounds="[-500, 9000]",
    )
    height_u_m: float | None = parameter(
        None,
        label="Uncertainty of the height",
        description="Standard uncertainty of the height above the ground, relief of the ground included.",
        default_text="that of its source",
        unit="m",
        example=2.0,
        bounds="(0, 1e3]",
    )

    def __post_init__(self) -> None:
        check_parameters(self)


def find_place(header: FrameHeader, ground: GroundHeight) -> Place:
    """Return where the pixels of a frame lie on level ground, as far as the file and a request state it.

    A pixel's direction d in the camera is turned by the body's axes A and by yaw, pitch and roll into north,
    east and down, and meets the ground at the height h::

        g = Rz(yaw) Ry(pitch) Rx(roll) A d,    (north, east) = h (g_n, g_e) / g_d

    Metres become degrees by the radii of curvature of WGS 84 at the camera; over 1 km the rest is below 0.1
    m. The uncertainty is that of position, height, tilt and yaw, each propagated by its own change of (north,
    east). Relief is part of the height's; an object above the ground is displaced by its height.
    """
    height_m, source = _find_height(header, ground)
    mount, attitude, missing = _find_attitude(header)
    if height_m is None:
        missing = missing or "the height above the ground is not known: state height_above_ground_m"
    latitude_deg, longitude_deg = header.latitude_deg, header.longitude_deg
    if latitude_deg is None or longitude_deg is None or abs(latitude_deg) > _HIGHEST_LATITUDE_DEG:
        missing = "the file states no position between 89 degrees north and south"
    lens = header.multispectral.geometry if header.multispectral is not None else None
    try:
        lens = require_lens_data(lens, turned=False)
    except InputRejected:
        missing = "the file does not state its lens"
    if missing or height_m is None or source is None or lens is None or attitude is None:
        return Place(form="none", detail=f"Not placed: {missing}.")
    assert latitude_deg is not None  # noqa: S101  else something is missing
    assert longitude_deg is not None  # noqa: S101
    cols, rows = np.meshgrid(
        np.linspace(0.0, header.width_px, _POINTS), np.linspace(0.0, header.height_px, _POINTS)
    )
    seen = find_directions(lens, x=cols - 0.5, y=rows - 0.5)
    of = _MOUNTS[mount]
    turn = rotate(attitude) @ np.array(of.axes) @ rotate_into_rig(lens)
    turned = seen @ turn.T
    if not np.all(turned[..., 2] > math.cos(math.radians(_LARGEST_ANGLE_DEG))):
        detail = f"Not placed: part of the frame looks more than {_LARGEST_ANGLE_DEG:g} deg off the vertical."
        return Place(form="none", detail=detail)
    shown = _meet_ground(turned, height_m)
    sources = _list_uncertainties(header, ground, turned, height_m=height_m, source=source, mount=of)
    known = np.sqrt(sum(np.square(each) for each in sources.values()))
    matrix = np.stack((np.ones_like(cols), cols, rows), axis=-1).reshape(-1, 3)
    fitted, *_ = np.linalg.lstsq(matrix, shown.reshape(-1, 2), rcond=None)
    left = np.linalg.norm(shown.reshape(-1, 2) - matrix @ fitted, axis=1).reshape(cols.shape)
    affine, residual_m = bool(np.all(left <= known)), float(left.max())
    sources |= {"affine transformation": left} if affine else {}
    total = np.sqrt(sum(np.square(each) for each in sources.values()))
    worst = max(_CORNERS, key=lambda corner: total[corner])
    per_m = _degrees_per_metre(latitude_deg)
    origin = np.array((latitude_deg, longitude_deg))
    places = origin + shown * per_m
    coefficients = (fitted * per_m + np.array((origin, (0.0, 0.0), (0.0, 0.0)))).T
    thinned = [
        each[_TIE_POINTS, _TIE_POINTS].ravel() for each in (cols, rows, places[..., 1], places[..., 0])
    ]
    return Place(
        form="affine" if affine else "tie_points",
        detail=f"Lens and tilt leave {residual_m:.2g} m of an affine transformation, "
        + ("less than the place is uncertain." if affine else "more than the place is uncertain."),
        crs=CRS,
        transform=tuple(coefficients[::-1].ravel().tolist()),
        tie_points=() if affine else tuple(tuple(map(float, each)) for each in zip(*thinned, strict=True)),
        corners=tuple((float(places[at][1]), float(places[at][0])) for at in _CORNERS),
        height_above_ground_m=height_m,
        height_source=source,
        attitude_source=mount,
        tilt_deg=math.degrees(math.acos(min(1.0, float(turn[2, 2])))),
        pixel_m=math.sqrt(abs(float(np.linalg.det(fitted[1:])))),
        residual_m=residual_m,
        u_centre_m=float(total[_CENTRE]),
        u_corner_m=float(total[worst]),
        budget=tuple(
            PlaceShare(source=name, u_centre_m=float(each[_CENTRE]), u_corner_m=float(each[worst]))
            for name, each in sources.items()
        ),
    )


def _find_height(header: FrameHeader, ground: GroundHeight) -> tuple[float | None, HeightSource | None]:
    stated, below = ground.height_above_ground_m, ground.ground_altitude_m
    if stated is not None and below is not None:
        raise codes.HEIGHT_UNUSABLE.refuse("Both height_above_ground_m and ground_altitude_m are stated.")
    if stated is not None:
        return stated, "request"
    if below is not None:
        if header.altitude_m is None or header.altitude_m <= below:
            at = "no altitude" if header.altitude_m is None else f"an altitude of {header.altitude_m:g} m"
            raise codes.HEIGHT_UNUSABLE.refuse(
                f"The file states {at}, and the ground is said to lie at {below:g} m."
            )
        return header.altitude_m - below, "ground_altitude"
    above = header.height_above_takeoff_m
    return (above, "take_off") if above is not None and above > 0.0 else (None, None)


def _find_attitude(header: FrameHeader) -> tuple[str, Attitude | None, str]:
    """Return the mount, its attitude, and "" or what is missing."""
    said = {angle.name: angle.value for angle in header.attitude}
    for name, mount in _MOUNTS.items():
        found = (said.get(f"{mount.family}{axis}{mount.suffix}") for axis in ("Yaw", "Pitch", "Roll"))
        yaw, pitch, roll = found
        if yaw is not None and pitch is not None and roll is not None:
            return name, Attitude(time_s=0.0, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll), ""
    return "", None, "the file states no yaw, pitch and roll of the camera itself"


def _meet_ground(turned: Plane, height_m: float) -> Plane:
    return np.asarray(height_m * turned[..., :2] / turned[..., 2:], np.float64)


def _list_uncertainties(
    header: FrameHeader,
    ground: GroundHeight,
    turned: Plane,
    *,
    height_m: float,
    source: HeightSource,
    mount: _Mount,
) -> dict[str, Plane]:
    """Return the root mean square distance that each source moves each point by [m]."""
    fix, shown = header.position_fix, _meet_ground(turned, height_m)
    constant_m, share = _U_HEIGHT[source]
    if source == "ground_altitude" and fix is not None and fix.u_height_m is not None:
        constant_m = math.hypot(fix.u_height_m, 1.0)
    u_height_m = ground.height_u_m or math.hypot(constant_m, share * height_m)
    across = (fix.u_latitude_m, fix.u_longitude_m) if fix is not None else (None, None)
    u_position_m = math.hypot(*(each or _U_POSITION_M for each in across))

    def turn(axis: int, u_deg: float) -> Plane:
        step = _STEP_RAD * np.cross(np.eye(3)[axis], turned)
        moved = _meet_ground(turned + step, height_m) - shown
        return np.asarray(np.linalg.norm(moved, axis=-1) * (math.radians(u_deg) / _STEP_RAD), np.float64)

    return {
        "position": np.full(shown.shape[:2], u_position_m),
        "height above ground": np.linalg.norm(shown, axis=-1) * (u_height_m / height_m),
        "tilt": np.hypot(turn(0, mount.u_tilt_deg), turn(1, mount.u_tilt_deg)),
        "yaw": turn(2, mount.u_yaw_deg),
    }


def _degrees_per_metre(latitude_deg: float) -> Plane:
    square = 1.0 - _WGS84_E2 * math.sin(math.radians(latitude_deg)) ** 2
    normal_m = _WGS84_M / math.sqrt(square)
    meridian_m = normal_m * (1.0 - _WGS84_E2) / square
    return np.degrees((1.0 / meridian_m, 1.0 / (normal_m * math.cos(math.radians(latitude_deg)))))
