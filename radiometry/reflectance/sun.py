"""Position of the sun over a frame, irradiance on a level surface, and the place of a frame on the ground."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame import FrameHeader, has_set_clock, place, writes_utc
from radiometry.frame.pose import GroundHeight, Pose, find_pose, measure_degree
from radiometry.records import Record
from radiometry.reflectance import alignment, codes
from radiometry.specification.parameters import check_parameters, parameter

LOWEST_SUN_DEG = 10.0
FURTHEST_FROM_SUN_DEG = 80.0
_SHARE_NM: Final = 650.0  # the middle of the cameras' bands
# A clock's zone may be ahead of its meridian's solar time by so much [h]: borders of zones, and summer time.
_ZONES_H: Final = (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5)
# The part of the attitude's uncertainty that differs between captures; the rest is the sensor's own mount.
# The correlation of two captures is not known: the variance expected for any from 0 to 1 is that of a half.
UNSHARED: Final = math.sqrt(0.5)


class SunPosition(Record):
    """Direction of the sun."""

    elevation_deg: float  # above the horizon, without refraction
    azimuth_deg: float  # from north over east


def locate_sun(at: datetime, *, latitude_deg: float, longitude_deg: float) -> SunPosition:
    """Compute the sun's direction at a place and time.

    The Astronomical Almanac's low-precision formulae [1] are within 0.012 degrees of NREL's SPA from 2000 to
    2050 (2,000 places and times), apart from refraction (0.03 degrees at 30 degrees of elevation, 0.09 at
    10), which is left out.

    [1] J. J. Michalsky, Solar Energy 40 (3), 227 (1988), doi:10.1016/0038-092X(88)90045-X
    """
    days = (at - datetime(2000, 1, 1, 12, tzinfo=UTC)).total_seconds() / 86400.0
    mean_longitude_deg = (280.460 + 0.9856474 * days) % 360.0
    anomaly = math.radians((357.528 + 0.9856003 * days) % 360.0)
    ecliptic = math.radians(mean_longitude_deg + 1.915 * math.sin(anomaly) + 0.020 * math.sin(2.0 * anomaly))
    obliquity = math.radians(23.439 - 0.0000004 * days)
    right_ascension = math.atan2(math.cos(obliquity) * math.sin(ecliptic), math.cos(ecliptic))
    declination = math.asin(math.sin(obliquity) * math.sin(ecliptic))
    sidereal_deg = (280.46062 + 360.98564737 * days) % 360.0
    hour_angle = math.radians(sidereal_deg + longitude_deg) - right_ascension
    latitude = math.radians(latitude_deg)
    elevation = math.asin(
        math.sin(declination) * math.sin(latitude)
        + math.cos(declination) * math.cos(latitude) * math.cos(hour_angle)
    )
    azimuth = math.atan2(
        -math.cos(declination) * math.sin(hour_angle),
        math.sin(declination) * math.cos(latitude)
        - math.cos(declination) * math.sin(latitude) * math.cos(hour_angle),
    )
    return SunPosition(elevation_deg=math.degrees(elevation), azimuth_deg=math.degrees(azimuth) % 360.0)


class TiltParams(Record):
    """Assumptions about sky and sensor of the tilt correction."""

    diffuse_share: float = parameter(
        1.0 / 6.0,
        label="Diffuse fraction",
        description="Diffuse fraction of the horizontal irradiance at 650 nm, 1/6 under a clear sky. That of "
        "a band follows by its wavelength.",
        bounds="[0, 1]",
    )
    refractive_index: float = parameter(
        1.38,
        label="Refractive index",
        description="Refractive index of the sensor's diffuser, 1.38 for PTFE.",
        bounds="[1, 3]",
    )
    diffuse_share_u: float = parameter(
        0.1,
        label="Uncertainty of the diffuse fraction",
        description="Its standard uncertainty at 650 nm, by the haze; a fraction that the file states has "
        "the same.",
        bounds="[0, 1]",
    )
    attitude_u_deg: float = parameter(
        2.0,
        label="Uncertainty of the attitude",
        description="Standard uncertainty of the sensor's attitude towards the sun.",
        unit="deg",
        bounds="[0, 45]",
    )

    def __post_init__(self) -> None:
        check_parameters(self)


def share_at(share: float, wavelength_nm: float | None) -> float:
    """Compute the diffuse fraction at a wavelength from that at 650 nm.

    Diffuse over direct light follows what scatters, a quarter molecules and three quarters haze [1]::

        d / (1 - d) = d0 / (1 - d0) (r^-4 + 3 r^-1.3) / 4        r = wavelength / 650 nm

    At 1/6 that is 0.29 at 475 nm and 0.11 at 840; under a cloud it is white.

    [1] R. E. Bird, C. Riordan, J. Climate Appl. Meteor. 25, 87 (1986)
    """
    molecules, haze = _scatter(wavelength_nm)
    scattered = share * (molecules + 3.0 * haze) / 4.0
    return scattered / (scattered + 1.0 - share)


def share_u_at(params: TiltParams, wavelength_nm: float | None) -> float:
    """Compute the uncertainty of the diffuse fraction at a wavelength: the haze is not known, the air is."""
    if params.diffuse_share == 1.0:
        return params.diffuse_share_u
    direct = (1.0 - share_at(params.diffuse_share, wavelength_nm)) / (1.0 - params.diffuse_share)
    return min(1.0, params.diffuse_share_u * _scatter(wavelength_nm)[1] * direct**2)


def _scatter(wavelength_nm: float | None) -> tuple[float, float]:
    """Return what molecules and haze scatter, relative to 650 nm."""
    r = min(2.0, max(0.5, (wavelength_nm or _SHARE_NM) / _SHARE_NM))
    return math.pow(r, -4.0), math.pow(r, -1.3)


Angles = tuple[float, float, float]  # yaw, pitch and roll of a sensor [deg]


class Tilt(Record):
    """Position of the sun at the time of a capture, and the assumptions of the correction."""

    sun: SunPosition
    params: TiltParams
    by_zone: tuple[SunPosition, ...] = ()  # with every zone that the clock may have, if it states none

    @property
    def suns(self) -> tuple[SunPosition, ...]:
        return self.by_zone or (self.sun,)


def transmit(angle_deg: float, *, refractive_index: float) -> float:
    """Compute the fraction of unpolarised light that enters a diffuser at an angle.

    T = 1 - (R_s + R_p) / 2 by Fresnel's equations for one surface.
    """
    return _enter(math.radians(angle_deg), refractive_index) / _enter(0.0, refractive_index)


def _enter(angle: float, index: float) -> float:
    outside, inside = math.cos(angle), math.sqrt(1.0 - (math.sin(angle) / index) ** 2)
    r_s = ((outside - index * inside) / (outside + index * inside)) ** 2
    r_p = ((inside - index * outside) / (inside + index * outside)) ** 2
    return 1.0 - 0.5 * (r_s + r_p)


def sun_angle_deg(sun: SunPosition, *, yaw_deg: float, pitch_deg: float, roll_deg: float) -> float:
    """Compute the angle between a sensor's upward normal and the sun [deg].

    The attitude rotates the body (x forward, y right, z down) from north-east-down: yaw, pitch, then roll.
    """
    elevation, azimuth = math.radians(sun.elevation_deg), math.radians(sun.azimuth_deg)
    towards = (
        math.cos(azimuth) * math.cos(elevation),
        math.sin(azimuth) * math.cos(elevation),
        -math.sin(elevation),
    )
    return _angle_between(_point_up((yaw_deg, pitch_deg, roll_deg)), towards)


def turned_deg(a: Angles, b: Angles) -> float:
    """Compute the angle between the upward normals of two attitudes."""
    return _angle_between(_point_up(a), _point_up(b))


def _point_up(angles: Angles) -> Angles:
    yaw, pitch, roll = map(math.radians, angles)
    return (
        -(math.cos(yaw) * math.sin(pitch) * math.cos(roll) + math.sin(yaw) * math.sin(roll)),
        -(math.sin(yaw) * math.sin(pitch) * math.cos(roll) - math.cos(yaw) * math.sin(roll)),
        -math.cos(pitch) * math.cos(roll),
    )


def _angle_between(a: Angles, b: Angles) -> float:
    cosine = sum(x * y for x, y in zip(a, b, strict=True))
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


def level_factor(angle_deg: float, tilt: Tilt) -> float:
    """Compute the factor that converts a reading to the irradiance on a level surface.

    A reading is direct light times cosine times T plus diffuse light, which has no direction here [1]::

        reading = H ((1 - d) cos(a) T(a) / cos(z) + d)

    H is the horizontal irradiance, d its diffuse fraction (d/(1 - d) = 1/5 as in MicaSense's light sensor
    notes), a the angle to the sun, z the zenith angle. What the diffuser loses of diffuse light is a
    constant, which K contains. Limits: d is an assumption; part of the sky and the ground that a tilted
    sensor sees is left out; the yaw comes from a compass beside motors. At a sun of 45 degrees each degree
    of tilt towards it is 1.5 %.

    [1] J. A. Duffie, W. A. Beckman, Solar Engineering of Thermal Processes, 2.15 (isotropic sky)
    """
    return 1.0 / _respond(angle_deg, tilt.sun, tilt.params)


def level_attitudes(attitudes: Sequence[Angles], tilt: Tilt) -> list[float]:
    """Compute the mean logarithm of the factor over a sensor's attitudes, for each sun that may be."""
    return [
        statistics.fmean(
            -math.log(
                _respond(min(90.0, sun_angle_deg(sun, yaw_deg=y, pitch_deg=p, roll_deg=r)), sun, tilt.params)
            )
            for y, p, r in attitudes
        )
        for sun in tilt.suns
    ]


def list_level_effects(attitudes: Sequence[Angles], tilt: Tilt) -> tuple[float, ...]:
    """List the relative effects of what other captures of a flight share, with their signs.

    By zone, by diffuse fraction, and by pitch and roll of the sensor's mount::

        u(ln R)^2 = sum (panel_i - frame_i)^2

    Each is an independent standard deviation: what two captures lean alike cancels between them.
    """
    found = level_attitudes(attitudes, tilt)
    mean = statistics.fmean(found)
    zones = (
        [(each - mean) / math.sqrt(len(found)) for each in found] if tilt.by_zone else [0.0] * len(_ZONES_H)
    )
    share, u_deg = tilt.params.diffuse_share, tilt.params.attitude_u_deg * math.sqrt(1.0 - UNSHARED**2)

    def level(*, pitch_deg: float = 0.0, roll_deg: float = 0.0, share: float = share) -> float:
        turned = [(yaw, pitch + pitch_deg, roll + roll_deg) for yaw, pitch, roll in attitudes]
        assumed = replace(tilt, params=replace(tilt.params, diffuse_share=share))
        return statistics.fmean(level_attitudes(turned, assumed))

    low, high = max(0.0, share - 0.01), min(1.0, share + 0.01)
    diffuse = (level(share=high) - level(share=low)) / (high - low) * tilt.params.diffuse_share_u
    pitch = 0.5 * (level(pitch_deg=u_deg) - level(pitch_deg=-u_deg))
    roll = 0.5 * (level(roll_deg=u_deg) - level(roll_deg=-u_deg))
    return (*zones, diffuse, pitch, roll)


def take_away(u: float, parts: Sequence[float]) -> float:
    """Return what a standard uncertainty is without parts of it."""
    return math.sqrt(max(0.0, u**2 - math.hypot(*parts) ** 2))


def attitude_u_rel(angle_deg: float, tilt: Tilt, *, u_deg: float) -> float:
    """Compute the relative standard uncertainty of a reading from that of its attitude."""
    low, middle, high = (
        _respond(angle, tilt.sun, tilt.params)
        for angle in (abs(angle_deg - u_deg), angle_deg, min(90.0, angle_deg + u_deg))
    )
    return math.hypot((high - low) / 2.0, (high + low) / 2.0 - middle) / middle


def _respond(angle_deg: float, sun: SunPosition, params: TiltParams) -> float:
    direct = math.cos(math.radians(angle_deg)) * transmit(angle_deg, refractive_index=params.refractive_index)
    level, share = math.cos(math.radians(90.0 - sun.elevation_deg)), params.diffuse_share
    return (1.0 - share) * direct / level + share


def read_clock(header: FrameHeader) -> datetime | None:
    if header.taken_at is None:
        return None
    at = datetime.fromisoformat(header.taken_at)
    return at if at.tzinfo is not None else at.replace(tzinfo=UTC)


def read_clock_s(header: FrameHeader) -> float | None:
    """Return the time of the exposure in seconds since 1970."""
    at = read_clock(header)
    return at.timestamp() if at is not None else None


def locate_suns_of(header: FrameHeader) -> tuple[SunPosition, ...]:
    """Return where the sun may have stood: without a zone of the clock, by each that its longitude allows."""
    at, latitude_deg, longitude_deg = _read_moment(header), header.latitude_deg, header.longitude_deg
    light = header.multispectral.irradiance if header.multispectral is not None else None
    placed = at is not None and latitude_deg is not None and longitude_deg is not None
    if (
        not (placed and not _lacks_zone(header))
        and light is not None
        and light.solar_elevation_deg is not None
        and light.solar_azimuth_deg is not None
    ):
        return (SunPosition(elevation_deg=light.solar_elevation_deg, azimuth_deg=light.solar_azimuth_deg),)
    if at is None or latitude_deg is None or longitude_deg is None:
        return ()
    meridian_h = round(longitude_deg / 7.5) / 2.0
    offsets_h = [meridian_h + zone for zone in _ZONES_H] if _lacks_zone(header) else [0.0]
    return tuple(
        locate_sun(at - timedelta(hours=each), latitude_deg=latitude_deg, longitude_deg=longitude_deg)
        for each in offsets_h
    )


def _read_moment(header: FrameHeader) -> datetime | None:
    at = read_clock(replace(header, taken_at=header.zoned_at))
    return at if at is not None and has_set_clock(at) else None


def _lacks_zone(header: FrameHeader) -> bool:
    stated = datetime.fromisoformat(header.zoned_at or "").tzinfo is not None
    return not stated and header.multispectral is not None and not writes_utc(header.multispectral.system)


def find_tilt(header: FrameHeader, params: TiltParams | None) -> Tilt | None:
    """Return the tilt correction of a frame with the position of the sun."""
    if params is None:
        return None
    suns = locate_suns_of(header)
    if not suns:
        raise codes.TILT_NOT_CORRECTABLE.reject(
            "The file does not state when and where it was taken (no GPS fix): the sun is not located."
        )
    sun = suns[len(suns) // 2]
    if sun.elevation_deg < LOWEST_SUN_DEG:  # the correction is mostly the attitude's error
        raise codes.TILT_NOT_CORRECTABLE.reject(
            f"The sun stands at {sun.elevation_deg:.1f} degrees: under {LOWEST_SUN_DEG:g} the tilt of the "
            "sunshine sensor cannot be corrected. Fly when it is higher."
        )
    high = [replace(each, elevation_deg=max(each.elevation_deg, LOWEST_SUN_DEG)) for each in suns]
    return Tilt(sun=sun, params=params, by_zone=tuple(high) if len(suns) > 1 else ())


Plane = NDArray[np.float64]

CRS: Final = "EPSG:4326"
_LARGEST_ANGLE_DEG: Final = 80.0
_POINTS: Final = 21
_TIE_POINTS: Final = slice(None, None, 2)
_STEP_RAD: Final = 1e-4
_CENTRE: Final = (_POINTS // 2, _POINTS // 2)
_CORNERS: Final = ((0, 0), (0, -1), (-1, -1), (-1, 0))


def find_place(header: FrameHeader, ground: GroundHeight) -> place.Place:
    """Return where the pixels of a frame lie on level ground, as far as the file and a request state it.

    A pixel's direction d in the camera is turned by the body's axes A and by yaw, pitch and roll into north,
    east and down, and meets the ground at the height h::

        g = Rz(yaw) Ry(pitch) Rx(roll) A d,    (north, east) = h (g_n, g_e) / g_d

    Metres become degrees by the radii of curvature of WGS 84 at the camera; over 1 km the rest is below 0.1
    m. The uncertainty is that of position, height, tilt and yaw, each propagated by its own change of (north,
    east). Relief is part of the height's; an object above the ground is displaced by its height.
    """
    lens, found = header.multispectral.geometry if header.multispectral else None, find_pose(header, ground)
    try:
        lens = alignment.require_lens_data(lens, turned=False)
    except InputRejected:
        found = "the file does not state its lens"
    if isinstance(found, str) or lens is None:
        return place.Place(form="none", detail=f"Not placed: {found}.")
    cols, rows = np.meshgrid(
        np.linspace(0.0, header.width_px, _POINTS), np.linspace(0.0, header.height_px, _POINTS)
    )
    seen = alignment.find_directions(lens, x=cols - 0.5, y=rows - 0.5)
    turn = found.turn @ alignment.rotate_into_rig(lens)
    turned = seen @ turn.T
    if not np.all(turned[..., 2] > math.cos(math.radians(_LARGEST_ANGLE_DEG))):
        detail = f"Not placed: part of the frame looks more than {_LARGEST_ANGLE_DEG:g} deg off the vertical."
        return place.Place(form="none", detail=detail)
    shown = _meet_ground(turned, found.height_m)
    sources = _list_uncertainties(found, turned)
    known = np.sqrt(sum(np.square(each) for each in sources.values()))
    matrix = np.stack((np.ones_like(cols), cols, rows), axis=-1).reshape(-1, 3)
    fitted, *_ = np.linalg.lstsq(matrix, shown.reshape(-1, 2), rcond=None)
    left = np.linalg.norm(shown.reshape(-1, 2) - matrix @ fitted, axis=1).reshape(cols.shape)
    affine, residual_m = bool(np.all(left <= known)), float(left.max())
    sources |= {"affine transformation": left} if affine else {}
    total = np.sqrt(sum(np.square(each) for each in sources.values()))
    worst = max(_CORNERS, key=lambda corner: total[corner])
    per_m = 1.0 / measure_degree(found.latitude_deg)
    origin = np.array((found.latitude_deg, found.longitude_deg))
    places = origin + shown * per_m
    coefficients = (fitted * per_m + np.array((origin, (0.0, 0.0), (0.0, 0.0)))).T
    thinned = [
        each[_TIE_POINTS, _TIE_POINTS].ravel() for each in (cols, rows, places[..., 1], places[..., 0])
    ]
    return place.Place(
        form="affine" if affine else "tie_points",
        detail=f"Lens and tilt leave {residual_m:.2g} m of an affine transformation, "
        + ("less than the place is uncertain." if affine else "more than the place is uncertain."),
        crs=CRS,
        transform=tuple(coefficients[::-1].ravel().tolist()),
        tie_points=() if affine else tuple(tuple(map(float, each)) for each in zip(*thinned, strict=True)),
        corners=tuple((float(places[at][1]), float(places[at][0])) for at in _CORNERS),
        height_above_ground_m=found.height_m,
        height_source=found.height_source,
        attitude_source=found.mount,
        tilt_deg=math.degrees(math.acos(min(1.0, float(turn[2, 2])))),
        pixel_m=math.sqrt(abs(float(np.linalg.det(fitted[1:])))),
        residual_m=residual_m,
        u_centre_m=float(total[_CENTRE]),
        u_corner_m=float(total[worst]),
        budget=tuple(
            place.PlaceShare(source=name, u_centre_m=float(each[_CENTRE]), u_corner_m=float(each[worst]))
            for name, each in sources.items()
        ),
    )


def _meet_ground(turned: Plane, height_m: float) -> Plane:
    return np.asarray(height_m * turned[..., :2] / turned[..., 2:], np.float64)


def _list_uncertainties(pose: Pose, turned: Plane) -> dict[str, Plane]:
    """Return the root mean square distance that each source moves each point by [m]."""
    shown = _meet_ground(turned, pose.height_m)

    def turn(axis: int, u_deg: float) -> Plane:
        step = _STEP_RAD * np.cross(np.eye(3)[axis], turned)
        moved = _meet_ground(turned + step, pose.height_m) - shown
        return np.asarray(np.linalg.norm(moved, axis=-1) * (math.radians(u_deg) / _STEP_RAD), np.float64)

    return {
        "position": np.full(shown.shape[:2], math.hypot(pose.u_north_m, pose.u_east_m)),
        "height above ground": np.linalg.norm(shown, axis=-1) * (pose.u_height_m / pose.height_m),
        "tilt": np.hypot(turn(0, pose.u_tilt_deg), turn(1, pose.u_tilt_deg)),
        "yaw": turn(2, pose.u_yaw_deg),
    }
