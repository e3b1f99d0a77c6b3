"""Irradiance on a level surface from the reading of a tilted sunshine sensor."""

import math
from dataclasses import dataclass

from radiometry.findings import InputRejected
from radiometry.reflectance import codes
from radiometry.reflectance.sun import SunPosition
from radiometry.specification.parameters import check_parameters, parameter

LOWEST_SUN_DEG = 10.0
FURTHEST_FROM_SUN_DEG = 80.0


@dataclass(frozen=True, kw_only=True)
class TiltParams:
    """Assumptions about sky and sensor of the tilt correction."""

    diffuse_share: float = parameter(
        1.0 / 6.0,
        label="Diffuse fraction",
        description="Diffuse fraction of the horizontal irradiance, 1/6 under a clear sky.",
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
        description="Its standard uncertainty; a fraction that the file states has the same.",
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
        """Check every parameter against its range and choices."""
        check_parameters(self)


@dataclass(frozen=True, kw_only=True)
class Tilt:
    """Position of the sun at the time of a capture, and the assumptions of the correction.

    Attributes
    ----------
    sun : SunPosition
        Position of the sun.
    params : TiltParams
        Assumptions about sky and sensor.
    """

    sun: SunPosition
    params: TiltParams


def require_high_sun(sun: SunPosition) -> None:
    """Refuse a sun under 10 degrees: there the correction is mostly the attitude's error.

    Raises
    ------
    InputRejected
        `tilt_not_correctable`.
    """
    if sun.elevation_deg < LOWEST_SUN_DEG:
        raise InputRejected(
            codes.TILT_NOT_CORRECTABLE,
            f"The sun stands at {sun.elevation_deg:.1f} degrees: under {LOWEST_SUN_DEG:g} the tilt of the "
            "sunshine sensor cannot be corrected. Fly when it is higher.",
        )


def transmit(angle_deg: float, *, refractive_index: float) -> float:
    """Compute the fraction of unpolarised light that enters a diffuser at an angle.

    Parameters
    ----------
    angle_deg : float
        Angle of incidence [deg].
    refractive_index : float
        Refractive index of the diffuser.

    Returns
    -------
    float
        T(angle) / T(0), which is 1 at normal incidence.

    Notes
    -----
    T = 1 - (R_s + R_p) / 2 by Fresnel's equations for one surface.
    """
    return _enter(math.radians(angle_deg), refractive_index) / _enter(0.0, refractive_index)


def _enter(angle: float, index: float) -> float:
    outside, inside = math.cos(angle), math.sqrt(1.0 - (math.sin(angle) / index) ** 2)
    r_s = ((outside - index * inside) / (outside + index * inside)) ** 2
    r_p = ((inside - index * outside) / (inside + index * outside)) ** 2
    return 1.0 - 0.5 * (r_s + r_p)


def sun_angle_deg(sun: SunPosition, *, yaw_deg: float, pitch_deg: float, roll_deg: float) -> float:
    """Compute the angle between a sensor's upward normal and the sun.

    Parameters
    ----------
    sun : SunPosition
        Position of the sun.
    yaw_deg, pitch_deg, roll_deg : float
        Attitude [deg]. It rotates the body (x forward, y right, z down) from
        north-east-down: yaw, then pitch, then roll.

    Returns
    -------
    float
        Angle [deg].
    """
    yaw, pitch, roll = (math.radians(angle) for angle in (yaw_deg, pitch_deg, roll_deg))
    normal = (
        -(math.cos(yaw) * math.sin(pitch) * math.cos(roll) + math.sin(yaw) * math.sin(roll)),
        -(math.sin(yaw) * math.sin(pitch) * math.cos(roll) - math.cos(yaw) * math.sin(roll)),
        -math.cos(pitch) * math.cos(roll),
    )
    elevation, azimuth = math.radians(sun.elevation_deg), math.radians(sun.azimuth_deg)
    towards = (
        math.cos(azimuth) * math.cos(elevation),
        math.sin(azimuth) * math.cos(elevation),
        -math.sin(elevation),
    )
    cosine = sum(a * b for a, b in zip(normal, towards, strict=True))
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


def level_factor(angle_deg: float, tilt: Tilt) -> float:
    """Compute the factor that converts a reading to the irradiance on a level surface.

    Parameters
    ----------
    angle_deg : float
        Angle between the sensor's normal and the sun [deg].
    tilt : Tilt
        Position of the sun, and assumptions.

    Notes
    -----
    A reading is direct light times cosine times T plus diffuse light, which has no
    direction here [1]_::

        reading = H ((1 - d) cos(a) T(a) / cos(z) + d)

    H is the horizontal irradiance, d its diffuse fraction (d/(1 - d) = 1/5 as in
    MicaSense's light sensor notes), a the angle to the sun, z the zenith angle. What
    the diffuser loses of diffuse light is a constant, which K contains.

    Limits: the fraction d is an assumption; part of the sky and the ground that a
    tilted sensor sees is left out; the attitude's yaw comes from a compass beside
    motors. At a sun of 45 degrees each degree of tilt towards it is 1.5 %.

    References
    ----------
    .. [1] J. A. Duffie, W. A. Beckman, Solar Engineering of Thermal Processes,
           section 2.15 (isotropic sky)
    """
    zenith_deg = 90.0 - tilt.sun.elevation_deg
    return 1.0 / _respond(angle_deg, zenith_deg, tilt.params, tilt.params.diffuse_share)


def attitude_u_rel(angle_deg: float, tilt: Tilt, *, u_deg: float) -> float:
    """Compute the relative standard uncertainty of a reading from that of its attitude.

    Parameters
    ----------
    angle_deg : float
        Angle between the sensor's normal and the sun [deg].
    tilt : Tilt
        Position of the sun, and assumptions.
    u_deg : float
        Standard uncertainty of the angle [deg].

    Returns
    -------
    float
        Half of the change from one end of the interval to the other, and the shift of
        its middle, which alone remains with the sun in the normal.
    """
    zenith_deg, share = 90.0 - tilt.sun.elevation_deg, tilt.params.diffuse_share
    low, middle, high = (
        _respond(angle, zenith_deg, tilt.params, share)
        for angle in (abs(angle_deg - u_deg), angle_deg, min(90.0, angle_deg + u_deg))
    )
    return math.hypot((high - low) / 2.0, (high + low) / 2.0 - middle) / middle


def diffuse_u_rel(angle_deg: float, tilt: Tilt) -> float:
    """Compute the relative standard uncertainty of a levelled reading from that of the diffuse fraction.

    Parameters
    ----------
    angle_deg : float
        Angle between the sensor's normal and the sun [deg].
    tilt : Tilt
        Position of the sun, and assumptions.

    Returns
    -------
    float
        Effect of one standard uncertainty.
    """
    # the response is a line in the fraction, from direct light alone to 1
    direct = _respond(angle_deg, 90.0 - tilt.sun.elevation_deg, tilt.params, 0.0)
    return abs(1.0 - direct) * tilt.params.diffuse_share_u * level_factor(angle_deg, tilt)


def _respond(angle_deg: float, zenith_deg: float, params: TiltParams, share: float) -> float:
    direct = math.cos(math.radians(angle_deg)) * transmit(angle_deg, refractive_index=params.refractive_index)
    return (1.0 - share) * direct / math.cos(math.radians(zenith_deg)) + share
