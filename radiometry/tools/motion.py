"""Image motion during an exposure, and its limits.

The theoretical motion is the whole distance that a point of the scene covers on the
sensor. The practical motion is half of it: a moving edge is smeared by a box as
wide as the theoretical motion, and the image that remains looks like one moved by
about half (see `compute_motion`). Every limit here is one of the THEORETICAL
motion.
"""

import math
from dataclasses import dataclass

USUAL_LIMIT_PX = 0.5

# slower than this the picture stands still for every exposure that there is
_STILL_PX_S = 1e-12


@dataclass(frozen=True, kw_only=True)
class MotionCase:
    """One lens, one exposure, one kind of motion.

    Attributes
    ----------
    pixel_pitch_um : float
        Pixel pitch [um].
    focal_length_mm : float
        Focal length [mm].
    exposure_time_s : float
        Exposure time [s].
    distance_m : float
        Distance along the line of sight [m]: the height above ground of a camera
        that looks straight down.
    rotation_rate_deg_s : float or None, default: None
        Rotation rate about an axis across the line of sight [deg/s]; None if
        rotation is not considered.
    ground_speed_m_s : float or None, default: None
        Speed across the line of sight [m/s]; None if it is not considered.
    limit_px : float, default: USUAL_LIMIT_PX
        Limit of the theoretical motion [px].

    Raises
    ------
    ValueError
        If a length, the exposure time or the limit is not positive and finite, or a
        rate is negative.
    """

    pixel_pitch_um: float
    focal_length_mm: float
    exposure_time_s: float
    distance_m: float
    rotation_rate_deg_s: float | None = None
    ground_speed_m_s: float | None = None
    limit_px: float = USUAL_LIMIT_PX

    def __post_init__(self) -> None:
        """Check what every caller must have checked at its interface."""
        positive = (self.pixel_pitch_um, self.focal_length_mm, self.exposure_time_s, self.distance_m)
        rates = (self.rotation_rate_deg_s or 0.0, self.ground_speed_m_s or 0.0)
        if not (
            all(math.isfinite(each) and each > 0.0 for each in (*positive, self.limit_px))
            and all(math.isfinite(rate) and rate >= 0.0 for rate in rates)
        ):
            raise ValueError(f"a motion that cannot be: {self}")


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Image motion of a case; None for what was not asked, or does not exist.

    Attributes
    ----------
    gsd_m : float
        Ground sampling distance [m].
    rotation_angle_deg : float or None
        Rotation during the exposure [deg].
    rotation_ground_m : float or None
        Movement of the line of sight at the distance [m].
    rotation_blur_px : float or None
        Theoretical motion from rotation alone [px].
    forward_blur_px : float or None
        Theoretical motion from speed alone [px].
    theoretical_blur_px : float or None
        Rotation and speed together, in the worst direction [px].
    practical_blur_px : float or None
        Half of the theoretical blur [px].
    tolerable_rate_deg_s : float
        Rotation rate at which rotation alone reaches `limit_px` of THEORETICAL
        motion [deg/s].
    longest_exposure_s : float or None
        Exposure time at which the theoretical motion reaches `limit_px` [s]; None
        if nothing moves.
    """

    gsd_m: float
    rotation_angle_deg: float | None
    rotation_ground_m: float | None
    rotation_blur_px: float | None
    forward_blur_px: float | None
    theoretical_blur_px: float | None
    practical_blur_px: float | None
    tolerable_rate_deg_s: float
    longest_exposure_s: float | None


def compute_motion(case: MotionCase) -> Motion:
    """Compute the image motion of one case.

    Parameters
    ----------
    case : MotionCase
        Lens, exposure and motion.

    Returns
    -------
    Motion
        Motion on the ground and in pixels, and the limits.

    Notes
    -----
    With s_p the pixel pitch, c the focal length, h the distance, t the exposure
    time and alpha in radian [1]_::

        GSD = h s_p / c                       forward    u_th = v t / GSD                              (1)
        alpha = omega t,   b = alpha h        rotation   PD = alpha c / s_p                            (2)
        u = u_th / 2                          practical, of the sum of both

    These hold for small angles near the centre of the image: at an angle d from it
    PD grows by 1 / cos^2 d in its direction. The source prints PD = (s_p / c) r,
    which is the GSD at r, not a displacement; its table 3 follows (2).

    References
    ----------
    .. [1] G. Grenzdoerffer, F. Niemeyer, F. Schmidt, Development of four vision
           camera system for a micro-UAV, ISPRS 2012, equations 1 to 6, table 3
    """
    gsd_m = case.distance_m * _pixel_angle(case)
    angle = rotation_blur = forward_blur = None
    if case.rotation_rate_deg_s is not None:
        angle = math.radians(case.rotation_rate_deg_s) * case.exposure_time_s
        rotation_blur = angle / _pixel_angle(case)
    if case.ground_speed_m_s is not None:
        forward_blur = case.ground_speed_m_s * case.exposure_time_s / gsd_m
    known = [blur for blur in (rotation_blur, forward_blur) if blur is not None]
    whole = math.fsum(known) if known else None
    speed_px_s = (whole or 0.0) / case.exposure_time_s
    return Motion(
        gsd_m=gsd_m,
        rotation_angle_deg=None if angle is None else math.degrees(angle),
        rotation_ground_m=None if angle is None else angle * case.distance_m,
        rotation_blur_px=rotation_blur,
        forward_blur_px=forward_blur,
        theoretical_blur_px=whole,
        practical_blur_px=None if whole is None else whole / 2,
        tolerable_rate_deg_s=tolerable_rate_deg_s(case, case.exposure_time_s),
        longest_exposure_s=case.limit_px / speed_px_s if speed_px_s > _STILL_PX_S else None,
    )


def tolerable_rate_deg_s(case: MotionCase, exposure_time_s: float) -> float:
    """Compute the rotation rate whose theoretical motion is the case's limit.

    Parameters
    ----------
    case : MotionCase
        Lens and limit.
    exposure_time_s : float
        Exposure time used instead of the case's own, for a curve [s].

    Returns
    -------
    float
        Rotation rate omega = s_p u / (c t) [deg/s], as in figure 7 of reference 1
        of `compute_motion`.
    """
    return math.degrees(_pixel_angle(case) * case.limit_px / exposure_time_s)


def _pixel_angle(case: MotionCase) -> float:
    """Return the angle of one pixel [rad]."""
    return case.pixel_pitch_um * 1e-3 / case.focal_length_mm
