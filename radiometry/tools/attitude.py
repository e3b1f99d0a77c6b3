"""Motion blur of frames whose file records the aircraft's attitude, from rates between records."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.frame import FrameHeader
from radiometry.frame.multispectral import Multispectral
from radiometry.frame.opencv import cv2

Basis = Literal["during", "nearest", "largest"]


@dataclass(frozen=True, kw_only=True)
class Attitude:
    """Attitude record: yaw, pitch and roll, applied in that order, from north-east-down to the body.

    Attributes
    ----------
    time_s : float
        Time of the record [s].
    yaw_deg, pitch_deg, roll_deg : float
        Angles [deg].
    """

    time_s: float
    yaw_deg: float
    pitch_deg: float
    roll_deg: float


@dataclass(frozen=True, kw_only=True)
class Turn:
    """Rotation of the body from one record to the next, about its own axes: forward, right, down.

    Attributes
    ----------
    start_s, end_s : float
        Times of the two records on the camera's clock [s].
    roll_rate_deg_s, pitch_rate_deg_s, yaw_rate_deg_s : float
        Mean rotation rates about the three axes [deg/s].
    """

    start_s: float
    end_s: float
    roll_rate_deg_s: float
    pitch_rate_deg_s: float
    yaw_rate_deg_s: float

    @property
    def tilt_rate_deg_s(self) -> float:
        """Rotation rate of the line of sight of a camera that looks along the body's down axis [deg/s]."""
        return math.hypot(self.roll_rate_deg_s, self.pitch_rate_deg_s)


@dataclass(frozen=True, kw_only=True)
class Shot:
    """Exposure of one frame.

    Attributes
    ----------
    at_s : float or None
        Start of the exposure on the records' clock [s]; None if it is not known.
    exposure_time_s : float
        Exposure time [s].
    """

    at_s: float | None
    exposure_time_s: float


@dataclass(frozen=True, kw_only=True)
class Optics:
    """Camera dimensions that convert an angle to pixels.

    Attributes
    ----------
    pixel_pitch_um : float
        Pixel pitch [um].
    focal_length_mm : float
        Focal length [mm].
    corner_px : float
        Distance from the image centre to its corner [px].
    """

    pixel_pitch_um: float
    focal_length_mm: float
    corner_px: float


@dataclass(frozen=True, kw_only=True)
class FrameBlur:
    """Theoretical motion of one frame from rotation alone.

    Attributes
    ----------
    turn : Turn
        Rotation that was used.
    basis : Basis
        "during" if the records enclose the exposure, "nearest" for the two nearest
        to it, "largest" for the fastest two if its time is not known.
    centre_blur_px : float
        Motion from the rotation of the line of sight [px].
    corner_blur_px : float
        Theoretical motion with the yaw, in the worst corner [px].
    """

    turn: Turn
    basis: Basis
    centre_blur_px: float
    corner_blur_px: float


def read_attitudes(multispectral: Multispectral | None) -> tuple[Attitude, ...]:
    """Return the attitudes of a file's sunshine records in the order of time.

    Parameters
    ----------
    multispectral : Multispectral or None
        Multispectral metadata of the file, if it has any.

    Returns
    -------
    tuple of Attitude
        One attitude per time; empty if the file has none.
    """
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

    Parameters
    ----------
    attitudes : sequence of Attitude
        Records in order of time.

    Returns
    -------
    tuple of Turn
        One rotation per pair of successive records.

    Notes
    -----
    In the body's axes, with R = Rz(yaw) Ry(pitch) Rx(roll)::

        rate = log(R_i^T R_{i+1}) / (t_{i+1} - t_i)

    Differences of the angles themselves would jump at 360 degrees, and are not the
    rates of a tilted body.
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


def blur_of_frames(
    shots: Sequence[Shot], attitudes: Sequence[Attitude], *, optics: Optics
) -> tuple[FrameBlur, ...]:
    """Compute the blur of frames whose camera is fixed to the body and looks along its down axis.

    Parameters
    ----------
    shots : sequence of Shot
        Frames, each with its time and exposure time.
    attitudes : sequence of Attitude
        Records in order of time.
    optics : Optics
        Dimensions of the camera.

    Returns
    -------
    tuple of FrameBlur
        Blur of each frame, in the order of `shots`.

    Raises
    ------
    InputRejected
        `attitude_missing` if there are fewer than two records.

    Notes
    -----
    With c the focal length and s_p the pixel pitch::

        centre = (c / s_p) hypot(roll, pitch) t,    corner = centre + r_corner |yaw| t

    Both are theoretical motions (the practical one is half), to first order in the
    image's angles. Records some tenths of a second apart show the slow part of the
    rotation only and do not include vibration.
    """
    turns = compute_turns(attitudes)
    if not turns:
        raise InputRejected(
            shared.ATTITUDE_MISSING,
            "The file carries no two records of yaw, pitch and roll with their times: how fast the camera "
            "turned is not known. Enter the rotation rate instead.",
        )
    return tuple(_blur(shot, turns, optics) for shot in shots)


def blur_of_file(
    header: FrameHeader, *, exposure_time_s: float, pixel_pitch_um: float, focal_length_mm: float
) -> FrameBlur:
    """Compute the blur of one frame from the attitudes that its own file records.

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
        Blur as computed by `blur_of_frames`.

    Raises
    ------
    InputRejected
        `attitude_missing` if there are fewer than two records.
    """
    multispectral = header.multispectral
    at_us = multispectral.exposed_at_us if multispectral else None
    (blur,) = blur_of_frames(
        [Shot(at_s=None if at_us is None else at_us * 1e-6, exposure_time_s=exposure_time_s)],
        read_attitudes(multispectral),
        optics=Optics(
            pixel_pitch_um=pixel_pitch_um,
            focal_length_mm=focal_length_mm,
            corner_px=math.hypot(header.width_px, header.height_px) / 2,
        ),
    )
    return blur


def _blur(shot: Shot, turns: Sequence[Turn], optics: Optics) -> FrameBlur:
    turn, basis = _choose(shot, turns)
    per_rad = optics.focal_length_mm * 1e3 / optics.pixel_pitch_um
    centre = per_rad * math.radians(turn.tilt_rate_deg_s) * shot.exposure_time_s
    twist = optics.corner_px * math.radians(abs(turn.yaw_rate_deg_s)) * shot.exposure_time_s
    return FrameBlur(turn=turn, basis=basis, centre_blur_px=centre, corner_blur_px=centre + twist)


def _choose(shot: Shot, turns: Sequence[Turn]) -> tuple[Turn, Basis]:
    """Return the rotation nearest to a shot; of equals the first."""
    if shot.at_s is None:
        return max(turns, key=lambda turn: turn.tilt_rate_deg_s), "largest"
    middle_s = shot.at_s + shot.exposure_time_s / 2
    nearest = min(turns, key=lambda turn: max(turn.start_s - middle_s, middle_s - turn.end_s, 0.0))
    return nearest, "during" if nearest.start_s <= middle_s <= nearest.end_s else "nearest"


def rotate(attitude: Attitude) -> NDArray[np.float64]:
    """Compute Rz(yaw) Ry(pitch) Rx(roll), which rotates the body's axes into north, east and down.

    Parameters
    ----------
    attitude : Attitude
        Yaw, pitch and roll.

    Returns
    -------
    ndarray of float64
        Rotation matrix, (3, 3).
    """
    yaw, pitch, roll = (
        math.radians(angle) for angle in (attitude.yaw_deg, attitude.pitch_deg, attitude.roll_deg)
    )
    about_x = [[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]]
    about_y = [[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]]
    about_z = [[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
    turned: NDArray[np.float64] = np.array(about_z) @ np.array(about_y) @ np.array(about_x)
    return turned
