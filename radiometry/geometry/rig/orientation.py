"""Orientation of the cameras of a rig, with the scatter between triggers."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import scipy

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity
from radiometry.geometry import codes
from radiometry.geometry.camera import Minimum, project, reduce
from radiometry.geometry.rig import adjustment
from radiometry.geometry.rig.adjustment import BoardPicture, Matrix, RigCamera, RigFit, RigPoint, Trigger
from radiometry.geometry.views import make_view
from radiometry.records import Record
from radiometry.specification.exports import RigMember

_POSE: Final = 6
# corners of a picture share errors of their search: 3.3 times at most in rendered pictures of rigid rigs
_CLEAR_RATIO: Final = 4.0


class Scatter(Record, kw_only=False):
    """Scale of the corners' noise, and scatter of a pose from trigger to trigger, per axis.

    ``significant`` : steps of triggers are more than four times as large as independent corners make them
    ``dof`` : degrees of freedom of each of the two scatters
    """

    scale: float
    rotation_rad: float
    translation_mm: float
    significant: bool
    dof: float


def estimate_scatter(reduced: Sequence[tuple[Matrix, Matrix]], *, within: tuple[float, int]) -> Scatter:
    """Estimate the scatter of the poses between triggers (REML).

    d_k = H_k^-1 g_k is the step that trigger k alone would take, of variance s^2 H_k^-1 + T; its gain
    g_k' H_k^-1 g_k is what frees s^2 from the scatter.
    """
    steps, precise, gained = [], [], 0.0
    for information, right in reduced:
        active = np.flatnonzero(np.diag(information) > 0.0)
        mine = information[np.ix_(active, active)]
        if not len(active) or np.linalg.cond(_scale(mine)) > 1e12:
            continue
        inverse = np.linalg.inv(mine)
        gained += float(right[active] @ inverse @ right[active])
        steps.append((active, inverse @ right[active]))
        precise.append(inverse)
    cost, dof = within
    scale2 = max(cost - gained, 0.0) / dof
    size = len(reduced[0][1])
    free = sum(len(active) for active, _ in steps) - size
    if free <= 0 or scale2 == 0.0:
        return Scatter(math.sqrt(scale2), 0.0, 0.0, significant=False, dof=1.0)
    typical = [
        max(
            1e-12,
            float(
                np.sqrt(
                    np.mean(
                        np.concatenate([step[active % _POSE // 3 == half] ** 2 for active, step in steps])
                    )
                )
            ),
        )
        for half in (0, 1)
    ]

    def deviance(logs: Matrix) -> float:
        t = [(one * size_) ** 2 for one, size_ in zip(logs, typical, strict=True)]
        total, information, right, squares = 0.0, np.zeros((size, size)), np.zeros(size), 0.0
        for (active, step), inverse in zip(steps, precise, strict=True):
            variance = scale2 * inverse + np.diag(np.array(t)[active % _POSE // 3])
            weight = np.linalg.inv(variance)
            total += float(np.linalg.slogdet(variance)[1])
            squares += float(step @ weight @ step)
            information[np.ix_(active, active)] += weight
            right[active] += weight @ step
        squares -= float(right @ np.linalg.solve(information, right))
        return total + squares + float(np.linalg.slogdet(information)[1])

    found = scipy.optimize.minimize(
        deviance, np.array([0.7, 0.7]), method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-4}
    )
    rotation, translation = (abs(float(one)) * size_ for one, size_ in zip(found.x, typical, strict=True))
    return Scatter(
        math.sqrt(scale2),
        rotation,
        translation,
        significant=gained > _CLEAR_RATIO**2 * scale2 * free,
        dof=free / 2.0,
    )


def _scale(matrix: Matrix) -> Matrix:
    scale = np.sqrt(np.diag(matrix))
    return np.asarray(matrix / np.outer(scale, scale), np.float64)


FEWEST_TRIGGERS: Final = 3
GOOD_TRIGGERS: Final = 6
OUTLIER_RATIO: Final = 4.0
_FLOOR: Final = 3.0  # of an outlier, in units of the corners' own scatter


def orient_rig(cameras: Sequence[RigCamera], pictures: Sequence[BoardPicture]) -> RigFit:
    """Find the pose of every camera against the first from pictures taken together.

    With the cameras fixed at their calibrations, the poses x of the cameras and one pose of the board per
    trigger minimise the sum of squared distances of all corners, each over its camera's noise. Then::

        C = s^2 H^-1 + H^-1 (sum H_k T H_k) H^-1 + G C_cameras G'

    H_k is the information of trigger k on x, its board's pose eliminated, and H their sum; s^2 the scatter
    of corners about poses that are free in each trigger; T the variance of the orientation from trigger to
    trigger beyond it (REML); G the change of x with the cameras' parameters. That the corners of the
    calibrations are used again costs nothing: what they tell of the cameras is orthogonal to what they tell
    of the poses.
    """
    triggers, why = adjustment.pair_pictures(pictures)
    start, triggers = adjustment.start_rig([each.model for each in cameras], triggers)
    if len(start) < len(cameras):
        lacking = ", ".join(each.serial for number, each in enumerate(cameras) if number not in start)
        raise codes.RIG_INCOMPLETE.refuse(f"No trigger links camera {lacking} to the others.")
    shared = np.concatenate([start[number] for number in range(1, len(cameras))])
    kept, rejected = list(triggers), list[tuple[BoardPicture, float]]()
    while True:
        _require_triggers(cameras, kept)
        found = adjustment.solve_rig(cameras, kept, shared)
        misses = _measure_misses(kept, found)
        typical = float(np.median([miss for each in misses for miss in each.values()]))
        worst = max(range(len(kept)), key=lambda place: max(misses[place].values()))
        if max(misses[worst].values()) <= max(OUTLIER_RATIO * typical, _FLOOR):
            break
        others = [each for place, each in enumerate(kept) if place != worst]
        _require_triggers(cameras, others)
        found = adjustment.solve_rig(cameras, others, found.shared)
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
    placed = adjustment.compose(board, adjustment.read_pose(shared, picture.camera))
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
            alone = adjustment.fit_board(cameras, rest, shared)
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
    within = 2 * corners - adjustment.POSE * sum(count)
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
        mine = slice(adjustment.POSE * (number - 1), adjustment.POSE * number)
        used = sum(number in each for each in misses)
        poses.append(
            adjustment.describe_pose(
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
        degrees_of_freedom=2 * corners - len(found.shared) - adjustment.POSE * len(triggers),
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
        reduce(adjustment.linearise_rig(cameras, trigger, found.shared, board, whole=True))[0]
        for trigger, board in zip(triggers, found.poses, strict=True)
    ]
    whole = np.sum(blocks, axis=0)
    inverse = np.linalg.inv(whole[:size, :size])
    spread = np.tile(
        np.repeat([scatter.rotation_rad**2, scatter.translation_mm**2], adjustment.POSE // 2),
        size // adjustment.POSE,
    )
    between = np.sum([block[:size, :size] * spread @ block[:size, :size] for block in blocks], axis=0)
    gain = -inverse @ whole[:size, size:]
    own = np.zeros((adjustment.CAMERA * len(cameras),) * 2)
    for number, camera in enumerate(cameras):
        mine = slice(adjustment.CAMERA * number, adjustment.CAMERA * (number + 1))
        own[mine, mine] = camera.covariance
    corners, swaying, given = (
        (part + part.T) / 2.0
        for part in (scatter.scale**2 * inverse, inverse @ between @ inverse, gain @ own @ gain.T)
    )
    return corners, swaying, given


COMPARED: Final = ("yaw", "pitch", "roll", "x", "y", "z")


def orient_members(members: Sequence[RigMember]) -> RigFit:
    """Find the orientation of a rig from one version of each camera."""
    pictures = [each for number, member in enumerate(members) for each in list_pictures(member, number)]
    return orient_rig([_read_camera(member) for member in members], pictures)


def count_shared(first: RigMember, second: RigMember) -> int:
    """Return how many triggers have a picture of both cameras."""
    return len(adjustment.pair_pictures([*list_pictures(first, 0), *list_pictures(second, 1)])[0])


def list_pictures(member: RigMember, number: int) -> list[BoardPicture]:
    used = {point.frame for point in member.fitted.points if point.used}
    return [
        BoardPicture(
            frame=row.frame,
            camera=number,
            scene=row.scene,
            header=row.header,
            target=row.features.target,
            view=make_view(row.features),
        )
        for row in member.rows
        if row.frame in used and row.features
    ]


def list_quantities(orientation: RigFit) -> dict[tuple[str, str], Quantity]:
    """Return the angles and the place of each camera."""
    return {(pose.camera, name): getattr(pose, name) for pose in orientation.poses for name in COMPARED}


def _read_camera(member: RigMember) -> RigCamera:
    fit = member.fitted
    return RigCamera(
        serial=member.serial,
        model=fit.camera,
        covariance=np.array(fit.covariance),
        noise_px=fit.rms_px * math.sqrt(fit.corners / fit.degrees_of_freedom),
        dof=float(fit.effective_dof or fit.degrees_of_freedom),
    )
