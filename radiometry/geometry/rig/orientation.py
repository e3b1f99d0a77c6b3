"""Relative orientation of the cameras of a rig by least squares over all corners of all triggers."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from radiometry.findings import Raised
from radiometry.geometry.camera import project
from radiometry.geometry.descent import Minimum, reduce
from radiometry.geometry.rig import codes
from radiometry.geometry.rig.adjustment import (
    CAMERA,
    POSE,
    Matrix,
    RigCamera,
    fit_board,
    linearise_rig,
    read_pose,
    solve_rig,
)
from radiometry.geometry.rig.angles import describe_pose
from radiometry.geometry.rig.results import RigFit, RigPoint
from radiometry.geometry.rig.scatter import Scatter, estimate_scatter
from radiometry.geometry.rig.start import compose, start_rig
from radiometry.geometry.rig.triggers import BoardPicture, Trigger, pair_pictures

FEWEST_TRIGGERS: Final = 3
GOOD_TRIGGERS: Final = 6
OUTLIER_RATIO: Final = 4.0
_FLOOR: Final = 3.0  # of an outlier, in units of the corners' own scatter


def orient_rig(cameras: Sequence[RigCamera], pictures: Sequence[BoardPicture]) -> RigFit:
    """Find the pose of every camera against the first from pictures taken together.

    Parameters
    ----------
    cameras : sequence of RigCamera
        Cameras, the reference first.
    pictures : sequence of BoardPicture
        Pictures of one set.

    Returns
    -------
    RigFit
        Poses with uncertainties, every picture, and flags.

    Raises
    ------
    InputRejected
        `rig_incomplete` if fewer than three triggers link a camera to the others.

    Notes
    -----
    With the cameras fixed at their calibrations, the poses x of the cameras and one pose of the board per
    trigger minimise the sum of squared distances of all corners, each over its camera's noise. Then::

        C = s^2 H^-1 + H^-1 (sum H_k T H_k) H^-1 + G C_cameras G'

    H_k is the information of trigger k on x, its board's pose eliminated, and H their sum; s^2 the scatter
    of corners about poses that are free in each trigger; T the variance of the orientation from trigger to
    trigger beyond it (REML); G the change of x with the cameras' parameters. That the corners of the
    calibrations are used again costs nothing: what they tell of the cameras is orthogonal to what they tell
    of the poses.
    """
    triggers, why = pair_pictures(pictures)
    start, triggers = start_rig([each.model for each in cameras], triggers)
    if len(start) < len(cameras):
        lacking = ", ".join(each.serial for number, each in enumerate(cameras) if number not in start)
        raise codes.RIG_INCOMPLETE.refuse(f"No trigger links camera {lacking} to the others.")
    shared = np.concatenate([start[number] for number in range(1, len(cameras))])
    kept, rejected = list(triggers), list[tuple[BoardPicture, float]]()
    while True:
        _require_triggers(cameras, kept)
        found = solve_rig(cameras, kept, shared)
        misses = _measure_misses(kept, found)
        typical = float(np.median([miss for each in misses for miss in each.values()]))
        worst = max(range(len(kept)), key=lambda place: max(misses[place].values()))
        if max(misses[worst].values()) <= max(OUTLIER_RATIO * typical, _FLOOR):
            break
        others = [each for place, each in enumerate(kept) if place != worst]
        _require_triggers(cameras, others)
        found = solve_rig(cameras, others, found.shared)
        kept[worst : worst + 1], gone = _split(
            cameras, kept[worst], found.shared, max(OUTLIER_RATIO * typical, _FLOOR)
        )
        rejected += gone
    flags = []
    for picture, px in rejected:
        fits = _find_fitting(cameras, picture, kept, found)
        why[picture.frame] = f"the rig's other pictures put its board {px:.1f} px from where it shows it" + (
            f"; it fits trigger {fits}" if fits else ""
        )
        detail = f"Camera {cameras[picture.camera].serial}: {why[picture.frame]}."
        flags.append(codes.TRIGGER_LEFT_OUT.at(f"frame {picture.frame}", detail))
    return _conclude(cameras, pictures, kept, found, why, flags, misses)


def _require_triggers(cameras: Sequence[RigCamera], triggers: Sequence[Trigger]) -> None:
    for number, each in enumerate(cameras):
        count = sum(number in {picture.camera for picture in trigger.pictures} for trigger in triggers)
        if count < FEWEST_TRIGGERS:
            raise codes.RIG_INCOMPLETE.refuse(
                f"Camera {each.serial} has {count} triggers that can be used; {FEWEST_TRIGGERS} are needed."
            )


def _measure_misses(triggers: Sequence[Trigger], found: Minimum) -> list[dict[int, float]]:
    """Return, per trigger, the rms of each camera's corners over its noise."""
    misses = []
    for trigger, block in zip(triggers, found.linear, strict=True):
        ends = np.cumsum([2 * len(each.view.points_mm) for each in trigger.pictures])[:-1]
        parts = np.split(block.residuals, ends)
        misses.append(
            {
                each.camera: math.sqrt(float(part @ part) / (len(part) / 2))
                for each, part in zip(trigger.pictures, parts, strict=True)
            }
        )
    return misses


def _miss_px(cameras: Sequence[RigCamera], picture: BoardPicture, board: Matrix, shared: Matrix) -> float:
    placed = compose(board, read_pose(shared, picture.camera))
    there = project(cameras[picture.camera].model, picture.view.points_mm, placed[:3], placed[3:])
    return math.sqrt(float(((picture.view.seen_px - there) ** 2).sum()) / len(there))


def _split(
    cameras: Sequence[RigCamera], trigger: Trigger, shared: Matrix, limit: float
) -> tuple[list[Trigger], list[tuple[BoardPicture, float]]]:
    """Return what is left of a trigger in which a picture is wrong, and the pictures that are left out.

    Of three pictures the two that agree stay; of two, none can be told from the other.
    """
    gone: list[tuple[BoardPicture, float]] = []
    kept = trigger
    while len(kept.pictures) > 1:
        trials = []
        for picture in kept.pictures:
            rest = replace(kept, pictures=tuple(each for each in kept.pictures if each is not picture))
            alone = fit_board(cameras, rest, shared)
            misses = [
                _miss_px(cameras, each, alone, shared) / cameras[each.camera].noise_px
                for each in rest.pictures
            ]
            trials.append((max(misses), rest, picture, _miss_px(cameras, picture, alone, shared)))
        left, rest, picture, px = min(trials, key=lambda trial: trial[0])
        gone.append((picture, px))
        if len(rest.pictures) == 1:
            return [], [*gone, (rest.pictures[0], px)]
        kept = rest
        if left <= limit:
            return [kept], gone
    return [], gone


def _find_fitting(
    cameras: Sequence[RigCamera], picture: BoardPicture, triggers: Sequence[Trigger], found: Minimum
) -> str:
    """Return the trigger whose board a picture shows, "" if there is none."""
    misses = {
        trigger.name: _miss_px(cameras, picture, board, found.shared)
        for trigger, board in zip(triggers, found.poses, strict=True)
    }
    best = min(misses, key=lambda name: misses[name], default="")
    return best if best and misses[best] <= OUTLIER_RATIO * _FLOOR * cameras[picture.camera].noise_px else ""


def _conclude(
    cameras: Sequence[RigCamera],
    pictures: Sequence[BoardPicture],
    triggers: Sequence[Trigger],
    found: Minimum,
    why: Mapping[str, str],
    flags: list[Raised],
    misses: Sequence[Mapping[int, float]],
) -> RigFit:
    reduced = [reduce(block)[:2] for block in found.linear]
    count = [len(trigger.pictures) for trigger in triggers]
    corners = sum(len(each.view.points_mm) for trigger in triggers for each in trigger.pictures)
    within = 2 * corners - POSE * sum(count)
    scatter = estimate_scatter(reduced, within=(found.cost, within))
    parts = list(
        zip(
            _find_covariances(cameras, triggers, found, scatter),
            (float(within), scatter.dof, min(camera.dof for camera in cameras)),
            strict=True,
        )
    )
    poses = []
    for number, camera in enumerate(cameras[1:], start=1):
        mine = slice(POSE * (number - 1), POSE * number)
        used = sum(number in each for each in misses)
        poses.append(
            describe_pose(
                camera.serial,
                found.shared[mine],
                [(part[mine, mine], dof) for part, dof in parts],
                triggers=used,
            )
        )
        if used < GOOD_TRIGGERS:
            flags.append(codes.FEW_TRIGGERS.at(f"camera {camera.serial}", f"Triggers: {used}."))
    if scatter.significant:
        flags.append(
            codes.RIG_NOT_RIGID.at(
                "",
                f"From trigger to trigger {math.degrees(scatter.rotation_rad):.2g} degrees about each axis "
                f"and {scatter.translation_mm:.2g} mm.",
            )
        )
    rms = {
        picture.frame: miss * cameras[picture.camera].noise_px
        for trigger, each in zip(triggers, misses, strict=True)
        for picture, miss in zip(trigger.pictures, each.values(), strict=True)
    }
    names = {picture.frame: trigger.name for trigger in triggers for picture in trigger.pictures}
    return RigFit(
        reference=cameras[0].serial,
        poses=tuple(poses),
        corner_scatter_rel=scatter.scale,
        scatter_deg=math.degrees(scatter.rotation_rad),
        scatter_mm=scatter.translation_mm,
        triggers=len(triggers),
        corners=corners,
        degrees_of_freedom=2 * corners - len(found.shared) - POSE * len(triggers),
        points=tuple(
            RigPoint(
                camera=cameras[each.camera].serial,
                frame=each.frame,
                trigger=names.get(each.frame, each.scene or ""),
                used=each.frame in rms,
                left_out=why.get(each.frame, ""),
                rms_px=rms.get(each.frame),
            )
            for each in sorted(pictures, key=lambda each: (each.camera, each.frame))
        ),
        flags=tuple(flags),
    )


def _find_covariances(
    cameras: Sequence[RigCamera], triggers: Sequence[Trigger], found: Minimum, scatter: Scatter
) -> tuple[Matrix, Matrix, Matrix]:
    """Return the covariances of the poses from corners, triggers and the cameras' own uncertainties."""
    size = len(found.shared)
    blocks = [
        reduce(linearise_rig(cameras, trigger, found.shared, board, whole=True))[0]
        for trigger, board in zip(triggers, found.poses, strict=True)
    ]
    whole = np.sum(blocks, axis=0)
    inverse = np.linalg.inv(whole[:size, :size])
    spread = np.tile(np.repeat([scatter.rotation_rad**2, scatter.translation_mm**2], POSE // 2), size // POSE)
    between = np.sum([block[:size, :size] * spread @ block[:size, :size] for block in blocks], axis=0)
    gain = -inverse @ whole[:size, size:]
    own = np.zeros((CAMERA * len(cameras),) * 2)
    for number, camera in enumerate(cameras):
        mine = slice(CAMERA * number, CAMERA * (number + 1))
        own[mine, mine] = camera.covariance
    corners, swaying, given = (
        (part + part.T) / 2.0
        for part in (scatter.scale**2 * inverse, inverse @ between @ inverse, gain @ own @ gain.T)
    )
    return corners, swaying, given
