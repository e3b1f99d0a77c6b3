"""How far the picture moves while the shutter is open, and what is tolerable.

The theoretical motion is the whole way that a point of the scene covers on the sensor. The practical motion
is half of it: a moving edge is smeared by a box as wide as the theoretical motion, and what is left of the
picture after it looks like one moved by about half [1]. Every limit here is one of the THEORETICAL motion.
"""

import math
from dataclasses import dataclass

USUAL_LIMIT_PX = 0.5

# slower than this the picture stands still for every exposure that there is
_STILL_PX_S = 1e-12


@dataclass(frozen=True, kw_only=True)
class MotionCase:
    """One lens, one exposure, one way of moving.

    ``distance_m`` : along the line of sight: the height above ground of a camera that looks straight down
    ``rotation_rate_deg_s`` : about an axis across the line of sight; None: it is not looked at
    ``ground_speed_m_s`` : across the line of sight; None: it is not looked at
    ``limit_px`` : of the theoretical motion
    """

    pixel_pitch_um: float
    focal_length_mm: float
    exposure_time_s: float
    distance_m: float
    rotation_rate_deg_s: float | None = None
    ground_speed_m_s: float | None = None
    limit_px: float = USUAL_LIMIT_PX

    def __post_init__(self) -> None:
        """Hold what every caller must have checked at its edge."""
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
    rotation_ground_m : float or None
        How far the line of sight wanders at the distance.
    rotation_blur_px : float or None
        Theoretical, from rotation alone.
    forward_blur_px : float or None
        Theoretical, from speed alone.
    theoretical_blur_px : float or None
        Rotation and speed together, in the worst direction.
    practical_blur_px : float or None
        Half of the theoretical blur.
    tolerable_rate_deg_s : float
        Of rotation alone, at which the THEORETICAL blur reaches limit_px.
    longest_exposure_s : float or None
        At which the theoretical blur reaches limit_px; absent if nothing moves.
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
    """Give the image motion of one case.

    GSD = h s_p / c                       forward    u_th = v t / GSD                              (1)
    alpha = omega t,   b = alpha h        rotation   PD = alpha c / s_p                            (2)
    u = u_th / 2                          practical, of the sum of both

    with s_p the pixel pitch, c the focal length, h the distance, t the exposure time, alpha in radian. Small
    angles, near the centre of the picture: at an angle d from it PD grows by 1 / cos^2 d in its direction.
    The source prints PD = (s_p / c) r, which is the GSD at r, not a displacement; its table 3 follows (2).

    References [1] Grenzdoerffer, Niemeyer, Schmidt, Development of four vision camera system for a
    micro-UAV, ISPRS 2012, equations 1 to 6, table 3
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
    """Give the rotation whose theoretical motion is the case's limit: omega = s_p u / (c t), figure 7 of [1].

    Takes
      exposure_time_s : in place of the case's own, for a curve
    """
    return math.degrees(_pixel_angle(case) * case.limit_px / exposure_time_s)


def _pixel_angle(case: MotionCase) -> float:
    """Give the angle of one pixel [rad]."""
    return case.pixel_pitch_um * 1e-3 / case.focal_length_mm
