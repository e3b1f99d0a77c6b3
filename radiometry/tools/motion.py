"""Image motion during an exposure: from speed and rotation, and from the attitudes of neighbouring frames."""

import itertools
import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import shared
from radiometry.frame import FrameHeader
from radiometry.frame.multispectral import Multispectral
from radiometry.frame.opencv import cv2
from radiometry.records import Record, about

USUAL_LIMIT_PX = 0.5

# slower than this the picture stands still for every exposure that there is
_STILL_PX_S = 1e-12


class MotionCase(Record):
    """One lens, one exposure, one kind of motion."""

    pixel_pitch_um: float = about("Pixel pitch [um].")
    focal_length_mm: float = about("Focal length [mm].")
    exposure_time_s: float = about("Exposure time [s].")
    distance_m: float = about(
        "Distance along the line of sight [m]: the height above ground of a camera that looks straight down."
    )
    rotation_rate_deg_s: float | None = about(
        "Rotation rate about an axis across the line of sight [deg/s]; None if rotation is not considered.",
        default=None,
    )
    ground_speed_m_s: float | None = about(
        "Speed across the line of sight [m/s]; None if it is not considered.", default=None
    )
    limit_px: float = about("Limit of the theoretical motion [px].", default=USUAL_LIMIT_PX)

    def __post_init__(self) -> None:
        positive = (self.pixel_pitch_um, self.focal_length_mm, self.exposure_time_s, self.distance_m)
        rates = (self.rotation_rate_deg_s or 0.0, self.ground_speed_m_s or 0.0)
        if not (
            all(math.isfinite(each) and each > 0.0 for each in (*positive, self.limit_px))
            and all(math.isfinite(rate) and rate >= 0.0 for rate in rates)
        ):
            raise ValueError(f"a motion that cannot be: {self}")


class Motion(Record):
    """Image motion of a case; None for what was not asked, or does not exist."""

    gsd_m: float = about("Ground sampling distance [m].")
    rotation_angle_deg: float | None = about("Rotation during the exposure [deg].")
    rotation_ground_m: float | None = about("Movement of the line of sight at the distance [m].")
    rotation_blur_px: float | None = about("Theoretical motion from rotation alone [px].")
    forward_blur_px: float | None = about("Theoretical motion from speed alone [px].")
    theoretical_blur_px: float | None = about("Rotation and speed together, in the worst direction [px].")
    practical_blur_px: float | None = about("Half of the theoretical blur [px].")
    tolerable_rate_deg_s: float = about(
        "Rotation rate at which rotation alone reaches `limit_px` of theoretical motion [deg/s]."
    )
    longest_exposure_s: float | None = about(
        "Exposure time at which the theoretical motion reaches `limit_px` [s]; absent if nothing moves."
    )


def compute_motion(case: MotionCase) -> Motion:
    """Compute the image motion of one case.

    With s_p the pixel pitch, c the focal length, h the distance, t the exposure
    time and alpha in radian [1]::

        GSD = h s_p / c                       forward    u_th = v t / GSD                              (1)
        alpha = omega t,   b = alpha h        rotation   PD = alpha c / s_p                            (2)
        u = u_th / 2                          practical, of the sum of both

    These hold for small angles near the centre of the image: at an angle d from it
    PD grows by 1 / cos^2 d in its direction. The source prints PD = (s_p / c) r,
    which is the GSD at r, not a displacement; its table 3 follows (2).

    [1] G. Grenzdoerffer, F. Niemeyer, F. Schmidt, Development of four vision camera system for a micro-UAV,
    ISPRS 2012, equations 1 to 6, table 3

    Parameters
    ----------
    case : MotionCase
        Lens, exposure and motion.

    Returns
    -------
    Motion
        Motion on the ground and in pixels, and the limits.
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
    """Compute the rotation rate omega = s_p u / (c t) whose theoretical motion is the limit [deg/s]."""
    return math.degrees(_pixel_angle(case) * case.limit_px / exposure_time_s)


def _pixel_angle(case: MotionCase) -> float:
    return case.pixel_pitch_um * 1e-3 / case.focal_length_mm


Basis = Literal["during", "nearest", "largest"]


class Attitude(Record):
    """Attitude record: yaw, pitch and roll, applied in that order, from north-east-down to the body."""

    time_s: float  # Time of the record [s]
    yaw_deg: float  # Angles [deg]
    pitch_deg: float
    roll_deg: float


class Turn(Record):
    """Rotation of the body from one record to the next, about its own axes: forward, right, down."""

    start_s: float = about("Times of the two records on the camera's clock [s].")
    end_s: float = about("Times of the two records on the camera's clock [s].")
    roll_rate_deg_s: float = about("Mean rotation rates about the three axes [deg/s].")
    pitch_rate_deg_s: float = about("Mean rotation rates about the three axes [deg/s].")
    yaw_rate_deg_s: float = about("Mean rotation rates about the three axes [deg/s].")

    @property
    def tilt_rate_deg_s(self) -> float:
        """Rotation rate of the line of sight of a camera that looks along the body's down axis [deg/s]."""
        return math.hypot(self.roll_rate_deg_s, self.pitch_rate_deg_s)


class FrameBlur(Record):
    """Theoretical motion of one frame from rotation alone."""

    turn: Turn = about("Rotation that was used.")
    basis: Basis = about(
        '"during" if the records enclose the exposure, "nearest" for the two nearest to it, "largest" '
        "for the fastest two if its time is not known."
    )
    centre_blur_px: float = about("Motion from the rotation of the line of sight [px].")
    corner_blur_px: float = about("Theoretical motion with the yaw, in the worst corner [px].")


def read_attitudes(multispectral: Multispectral | None) -> tuple[Attitude, ...]:
    """Return the attitudes of a file's sunshine records in the order of time; empty if it has none."""
    if multispectral is None or multispectral.counts is None:
        return ()
    found = {
        record.time_us: Attitude(
            time_s=record.time_us * 1e-6,
            yaw_deg=record.yaw_deg,
            pitch_deg=record.pitch_deg,
            roll_deg=record.roll_deg,
        )
        for record in multispectral.counts.records
        if record.yaw_deg is not None and record.pitch_deg is not None and record.roll_deg is not None
    }
    return tuple(found[time] for time in sorted(found))


def compute_turns(attitudes: Sequence[Attitude]) -> tuple[Turn, ...]:
    """Compute the rotation rates between successive records.

    In the body's axes, with R = Rz(yaw) Ry(pitch) Rx(roll)::

        rate = log(R_i^T R_{i+1}) / (t_{i+1} - t_i)

    Differences of the angles themselves would jump at 360 degrees, and are not the rates of a tilted body.
    """
    turns = []
    for first, second in itertools.pairwise(attitudes):
        step, _ = cv2.Rodrigues(rotate(first).T @ rotate(second))
        elapsed_s = second.time_s - first.time_s
        roll, pitch, yaw = (math.degrees(angle) / elapsed_s for angle in step.ravel())
        turns.append(
            Turn(
                start_s=first.time_s,
                end_s=second.time_s,
                roll_rate_deg_s=roll,
                pitch_rate_deg_s=pitch,
                yaw_rate_deg_s=yaw,
            )
        )
    return tuple(turns)


def blur_of_file(
    header: FrameHeader, *, exposure_time_s: float, pixel_pitch_um: float, focal_length_mm: float
) -> FrameBlur:
    """Compute the blur of one frame from the attitudes that its own file records.

    With c the focal length and s_p the pixel pitch::

        centre = (c / s_p) hypot(roll, pitch) t,    corner = centre + r_corner |yaw| t

    Both are theoretical motions (the practical one is half), to first order in the image's angles. Records
    some tenths of a second apart show the slow part of the rotation only and do not include vibration.

    Parameters
    ----------
    header : FrameHeader
        Metadata of the file.
    exposure_time_s : float
        Exposure time [s].
    pixel_pitch_um : float
        Pixel pitch [um].
    focal_length_mm : float
        Focal length [mm].

    Returns
    -------
    FrameBlur
        Blur of a camera that is fixed to the body and looks along its down axis.

    Raises
    ------
    InputRejected
        `attitude_missing` if there are fewer than two records.
    """
    turns = compute_turns(read_attitudes(header.multispectral))
    if not turns:
        raise shared.ATTITUDE_MISSING.reject(
            "The file carries no two records of yaw, pitch and roll with their times: how fast the camera "
            "turned is not known. Enter the rotation rate instead."
        )
    at_us = header.multispectral.exposed_at_us if header.multispectral else None
    turn, basis = _choose(turns, None if at_us is None else at_us * 1e-6, exposure_time_s)
    per_rad = focal_length_mm * 1e3 / pixel_pitch_um
    corner_px = math.hypot(header.width_px, header.height_px) / 2
    centre = per_rad * math.radians(turn.tilt_rate_deg_s) * exposure_time_s
    twist = corner_px * math.radians(abs(turn.yaw_rate_deg_s)) * exposure_time_s
    return FrameBlur(turn=turn, basis=basis, centre_blur_px=centre, corner_blur_px=centre + twist)


def _choose(turns: Sequence[Turn], at_s: float | None, exposure_time_s: float) -> tuple[Turn, Basis]:
    """Return the rotation nearest to an exposure that begins then; of equals the first."""
    if at_s is None:
        return max(turns, key=lambda turn: turn.tilt_rate_deg_s), "largest"
    middle_s = at_s + exposure_time_s / 2
    nearest = min(turns, key=lambda turn: max(turn.start_s - middle_s, middle_s - turn.end_s, 0.0))
    return nearest, "during" if nearest.start_s <= middle_s <= nearest.end_s else "nearest"


def rotate(attitude: Attitude) -> NDArray[np.float64]:
    """Compute Rz(yaw) Ry(pitch) Rx(roll), which rotates the body's axes into north, east and down."""
    yaw, pitch, roll = (
        math.radians(angle) for angle in (attitude.yaw_deg, attitude.pitch_deg, attitude.roll_deg)
    )
    about_x = [[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]]
    about_y = [[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]]
    about_z = [[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
    turned: NDArray[np.float64] = np.array(about_z) @ np.array(about_y) @ np.array(about_x)
    return turned
