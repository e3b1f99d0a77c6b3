"""Position and attitude of a camera above level ground, as a file states them, and their uncertainties."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import shared
from radiometry.frame import FrameHeader
from radiometry.frame.place import HeightSource
from radiometry.records import Record, about
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.tools.motion import Attitude, rotate

Matrix = NDArray[np.float64]

_EQUATOR_M, _SQUARED_ECCENTRICITY = 6378137.0, 6.69437999014e-3
_HIGHEST_LATITUDE_DEG: Final = 89.0
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

    form: str  # Name of an angle
    axes: tuple[tuple[int, int, int], ...]
    u_tilt_deg: float
    u_yaw_deg: float


# Rows of `axes`: the body's forward, right and down in the camera's right, down and forward. At a pitch of
# 0 DJI's gimbal looks forward, and a camera by Pix4D's definition down, its upper edge forward.
_MOUNTS: Final = {
    "gimbal": _Mount("drone-dji:Gimbal{}Degree", ((0, 0, 1), (1, 0, 0), (0, 1, 0)), 1.0, 3.0),
    "camera": _Mount("camera:{}", ((0, -1, 0), (1, 0, 0), (0, 0, 1)), 2.0, 5.0),
}
_AXES: Final = ("Yaw", "Pitch", "Roll")


class GroundHeight(Record):
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


class Pose(Record):
    """Place and attitude of a camera, with standard uncertainties."""

    latitude_deg: float
    longitude_deg: float
    height_m: float = about("Height above the ground [m].")
    height_source: HeightSource
    mount: str = about('Whose angles were stated: "gimbal" or "camera".')
    yaw_deg: float
    pitch_deg: float
    roll_deg: float
    u_north_m: float
    u_east_m: float
    u_height_m: float
    u_tilt_deg: float = about("Of a rotation about each level axis.")
    u_yaw_deg: float

    @property
    def turn(self) -> Matrix:
        """Rotation of the camera's right, down and forward into north, east and down."""
        angles = {name: getattr(self, name) for name in ("yaw_deg", "pitch_deg", "roll_deg")}
        axes = np.array(_MOUNTS[self.mount].axes, np.float64)
        return rotate(Attitude(time_s=0.0, **angles)) @ axes


def find_pose(header: FrameHeader, ground: GroundHeight) -> Pose | str:
    """Return the pose of a frame's camera, or what is missing.

    Parameters
    ----------
    header : FrameHeader
        Position, quality of the position, and angles as the file states them.
    ground : GroundHeight
        Height as a person states it.

    Returns
    -------
    Pose or str
        The words of what the file does not state.
    """
    height_m, source = _find_height(header, ground)
    latitude_deg, longitude_deg = header.latitude_deg, header.longitude_deg
    if latitude_deg is None or longitude_deg is None or abs(latitude_deg) > _HIGHEST_LATITUDE_DEG:
        return "the file states no position between 89 degrees north and south"
    said = {angle.name: angle.value for angle in header.attitude}
    named = ((name, [each.form.format(axis) for axis in _AXES]) for name, each in _MOUNTS.items())
    stated = ((name, [said[key] for key in keys if key in said]) for name, keys in named)
    mount, angles = next((each for each in stated if len(each[1]) == len(_AXES)), ("", []))
    if not angles:
        return "the file states no yaw, pitch and roll of the camera itself"
    if height_m is None or source is None:
        return "the height above the ground is not known: state height_above_ground_m"
    fix = header.position_fix
    constant_m, share = _U_HEIGHT[source]
    if source == "ground_altitude" and fix is not None and fix.u_height_m is not None:
        constant_m = math.hypot(fix.u_height_m, 1.0)
    return Pose(
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        height_m=height_m,
        height_source=source,
        mount=mount,
        yaw_deg=angles[0],
        pitch_deg=angles[1],
        roll_deg=angles[2],
        u_north_m=(fix and fix.u_latitude_m) or _U_POSITION_M,
        u_east_m=(fix and fix.u_longitude_m) or _U_POSITION_M,
        u_height_m=ground.height_u_m or math.hypot(constant_m, share * height_m),
        u_tilt_deg=_MOUNTS[mount].u_tilt_deg,
        u_yaw_deg=_MOUNTS[mount].u_yaw_deg,
    )


def _find_height(header: FrameHeader, ground: GroundHeight) -> tuple[float | None, HeightSource | None]:
    stated, below = ground.height_above_ground_m, ground.ground_altitude_m
    if stated is not None and below is not None:
        raise shared.HEIGHT_UNUSABLE.refuse("Both height_above_ground_m and ground_altitude_m are stated.")
    if stated is not None:
        return stated, "request"
    if below is not None:
        if header.altitude_m is None or header.altitude_m <= below:
            at = "no altitude" if header.altitude_m is None else f"an altitude of {header.altitude_m:g} m"
            raise shared.HEIGHT_UNUSABLE.refuse(
                f"The file states {at}, and the ground is said to lie at {below:g} m."
            )
        return header.altitude_m - below, "ground_altitude"
    above = header.height_above_takeoff_m
    return (above, "take_off") if above is not None and above > 0.0 else (None, None)


def measure_degree(latitude_deg: float) -> Matrix:
    """Return the lengths of a degree of latitude and of longitude, by the radii of WGS 84 [m]."""
    latitude = math.radians(latitude_deg)
    square = 1.0 - _SQUARED_ECCENTRICITY * math.sin(latitude) ** 2
    normal_m = _EQUATOR_M / math.sqrt(square)
    meridian_m = normal_m * (1.0 - _SQUARED_ECCENTRICITY) / square
    return np.radians([meridian_m, normal_m * math.cos(latitude)])
