"""The orientation of simulated cameras comes out, as exactly as its uncertainties say."""

import math
from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.fitting.curve import coverage_factor
from radiometry.geometry import codes
from radiometry.geometry.camera import CameraModel, View, choose_free_parameters, solve
from radiometry.geometry.rig.adjustment import BoardPicture, RigCamera, describe_pose, pair_pictures
from radiometry.geometry.rig.orientation import COMPARED, orient_rig
from radiometry.geometry.target import locate_corners_mm
from simulation.boards import Mounted, draw_boards, see
from tests.radiometry.geometry.boards import BOARD, make_header

LENS = CameraModel(
    height_px=480, width_px=640, fx_px=520.0, fy_px=520.0, cx_px=332.0, cy_px=229.0, k1=-0.25, k2=0.08
)
NOISE_PX = 0.1
INDICES = np.arange(BOARD.corners)
POINTS = locate_corners_mm(BOARD, INDICES)
# a second camera turned by 11 degrees about y and 3 about x, and a third that looks the same way
RIG = (
    Mounted(LENS, np.zeros(6)),
    Mounted(
        replace(LENS, cx_px=310.0, fx_px=525.0, fy_px=525.0), np.array([0.05, 0.2, -0.02, -60.0, 5.0, 8.0])
    ),
    Mounted(replace(LENS, cy_px=250.0), np.array([-0.01, 0.004, 0.03, 0.0, -40.0, 1.0])),
)


def shoot(rig, random, *, count, noise_px=NOISE_PX, sway=(0.0, 0.0)):
    """Pictures of every trigger; ``sway`` of each camera's pose from one to the next [rad] and [mm]."""
    pictures = []
    for trigger, pose in enumerate(draw_boards(rig, BOARD, random, count=count)):
        for number, camera in enumerate(rig):
            by = random.normal(0.0, np.repeat(sway, 3)) if number else np.zeros(6)
            seen = see(camera, BOARD, pose, by=by) + random.normal(0.0, noise_px, (BOARD.corners, 2))
            pictures.append(
                BoardPicture(
                    frame=f"camera-{number}-{trigger:02}",
                    camera=number,
                    scene=f"trigger-{trigger:02}",
                    header=make_header(camera.model),
                    target=BOARD,
                    view=View(POINTS, seen),
                )
            )
    return pictures


def known(rig, noise_px=NOISE_PX):
    return [
        RigCamera(f"C{number}", camera.model, np.zeros((9, 9)), noise_px) for number, camera in enumerate(rig)
    ]


def difference(found, truth):
    """The error of a pose in radians and millimetres."""
    return np.array([*found.rotation, *(1000.0 * each for each in found.translation_m)]) - truth


@pytest.fixture(scope="module")
def pictures():
    return shoot(RIG, np.random.default_rng(3), count=8)


@pytest.fixture(scope="module")
def fitted(pictures):
    return orient_rig(known(RIG), pictures)


def test_without_noise_the_truth_comes_out():
    found = orient_rig(known(RIG), shoot(RIG, np.random.default_rng(1), count=4, noise_px=0.0))
    for pose, camera in zip(found.poses, RIG[1:], strict=True):
        np.testing.assert_allclose(difference(pose, camera.pose), 0.0, atol=1e-5)


def test_angles_and_places_by_hand(fitted):
    """A camera that looks 11 degrees to the right, of a pure turn about y, and stands 60 mm to the left."""
    turned = Mounted(LENS, np.array([0.0, -math.radians(11.0), 0.0, 0.0, 0.0, 0.0]))
    found = orient_rig(known((RIG[0], turned)), shoot((RIG[0], turned), np.random.default_rng(2), count=6))
    (pose,) = found.poses
    assert pose.yaw.value == pytest.approx(11.0, abs=4 * pose.yaw.standard_uncertainty)
    assert pose.pitch.value == pytest.approx(0.0, abs=4 * pose.pitch.standard_uncertainty)
    assert pose.roll.value == pytest.approx(0.0, abs=4 * pose.roll.standard_uncertainty)
    assert pose.boresight.value == pytest.approx(11.0, abs=4 * pose.yaw.standard_uncertainty)
    second = fitted.poses[0]
    centre = -np.array(second.matrix).T @ np.array(second.translation_m)
    assert (second.x.value, second.y.value, second.z.value) == pytest.approx(tuple(centre))
    assert (second.x.unit, second.yaw.unit) == ("m", "deg")
    assert [each.camera for each in fitted.poses] == ["C1", "C2"]
    assert (fitted.reference, fitted.triggers, fitted.corners) == ("C0", 8, 8 * 3 * 54)
    assert fitted.corner_scatter_rel == pytest.approx(1.0, abs=0.06)


def measure_coverage(rig, *, sets, count, calibrated=False, sway=(0.0, 0.0), seed=0):
    """Return the mean of e' C^-1 e of all poses, 6 is expected, and how often U holds an angle or a place."""
    random, squares, inside = np.random.default_rng(seed), [], []
    for _ in range(sets):
        cameras = known(rig)
        pictures = shoot(rig, random, count=count, sway=sway)
        if calibrated:
            cameras = [calibrate(number, pictures) for number in range(len(rig))]
        for pose, camera in zip(orient_rig(cameras, pictures).poses, rig[1:], strict=True):
            unit = np.array([1.0] * 3 + [1000.0] * 3)
            covariance = np.array(pose.covariance) * np.outer(unit, unit)
            error = difference(pose, camera.pose)
            squares.append(float(error @ np.linalg.solve(covariance, error)))
            truth = describe_pose("", camera.pose, [(np.eye(6), 1.0)], triggers=0)
            inside += [
                abs(getattr(pose, name).value - getattr(truth, name).value)
                < coverage_factor(pose.effective_dof[name]) * getattr(pose, name).standard_uncertainty
                for name in COMPARED
            ]
    return np.mean(squares), np.mean(inside)


def calibrate(number, pictures):
    free = choose_free_parameters(fix_aspect_ratio=True, radial_terms=2, tangential=False)
    views = [each.view for each in pictures if each.camera == number]
    found = solve(views, free, height_px=480, width_px=640)
    noise_px = found.rms_px * math.sqrt(
        found.degrees_of_freedom and len(views) * 54 / found.degrees_of_freedom
    )
    return RigCamera(f"C{number}", found.camera, found.covariance, noise_px)


def test_errors_are_as_large_as_predicted():
    """With the cameras calibrated by the same pictures: 8 poses of 6 numbers, so 6 with 1.2."""
    squares, inside = measure_coverage(RIG[:2], sets=8, count=6, calibrated=True)
    assert 3.0 < squares < 9.6
    assert inside > 0.86


def test_a_mount_that_gives_way_is_in_the_uncertainty():
    """Half a milliradian and half a millimetre from trigger to trigger: far more than the corners scatter."""
    squares, inside = measure_coverage(RIG[:2], sets=5, count=8, sway=(5e-4, 0.5))
    assert squares < 20.0
    assert inside > 0.75
    found = orient_rig(known(RIG[:2]), shoot(RIG[:2], np.random.default_rng(8), count=12, sway=(5e-4, 0.5)))
    assert "rig_not_rigid" in {each.flag for each in found.flags}
    assert found.scatter_mm == pytest.approx(0.5, rel=0.6)
    assert found.scatter_deg == pytest.approx(math.degrees(5e-4), rel=0.6)


def test_a_rigid_rig_is_not_called_loose(fitted):
    assert {each.flag for each in fitted.flags} == set()


def swap(pictures, camera, first, second):
    names = {first: second, second: first}
    return [
        replace(each, scene=names[each.scene]) if each.camera == camera and each.scene in names else each
        for each in pictures
    ]


def test_a_wrong_pairing_is_left_out_with_the_reason(pictures, fitted):
    wrong = swap(pictures, 1, "trigger-02", "trigger-05")
    found = orient_rig(known(RIG), wrong)
    left_out = {each.frame: each.left_out for each in found.points if not each.used}
    assert set(left_out) == {"camera-1-02", "camera-1-05"}
    assert "px from where it shows it; it fits trigger trigger-02" in left_out["camera-1-02"]
    assert {each.where for each in found.flags if each.flag == "trigger_left_out"} == {
        f"frame {frame}" for frame in left_out
    }
    for pose, other in zip(found.poses, fitted.poses, strict=True):
        u = np.sqrt(np.diag(np.array(pose.covariance)))[:3]
        assert np.all(np.abs(np.subtract(pose.rotation, other.rotation)) < 2 * u)


def test_of_two_cameras_a_wrong_trigger_goes_whole(pictures):
    two = [each for each in pictures if each.camera < 2]
    random = np.random.default_rng(9)
    (pose,) = draw_boards(RIG, BOARD, random, count=1)
    wrong = [
        replace(each, view=View(POINTS, see(RIG[1], BOARD, pose))) if each.frame == "camera-1-03" else each
        for each in two
    ]
    found = orient_rig(known(RIG[:2]), wrong)
    assert {each.frame for each in found.points if not each.used} == {"camera-0-03", "camera-1-03"}
    assert found.triggers == 7


def test_a_board_numbered_from_its_other_end_is_the_same_board(pictures, fitted):
    turned = [
        replace(each, view=View(POINTS, each.view.seen_px[::-1])) if number % 3 == 1 else each
        for number, each in enumerate(pictures)
    ]
    found = orient_rig(known(RIG), turned)
    for pose, other in zip(found.poses, fitted.poses, strict=True):
        np.testing.assert_allclose(pose.rotation, other.rotation, atol=1e-7)


def test_the_order_of_pictures_changes_no_bit(pictures, fitted):
    assert orient_rig(known(RIG), pictures[::-1]) == fitted


def test_pictures_belong_together_by_scene_capture_or_time(pictures):
    def at(picture, time, scene=None):
        return replace(picture, scene=scene, header=replace(picture.header, taken_at=time))

    a, b, c, d = pictures[0], pictures[1], pictures[3], pictures[4]
    timed = [at(a, "2026-05-01T10:00:00"), at(b, "2026-05-01T10:00:01"), at(c, "2026-05-01T10:00:07")]
    triggers, why = pair_pictures([*timed, at(d, None)])
    assert [[each.frame for each in trigger.pictures] for trigger in triggers] == [[a.frame, b.frame]]
    assert why == {
        c.frame: "no other camera has a picture of trigger 2026-05-01T10:00:07",
        d.frame: "it has no scene, no capture identifier and no time",
    }
    _, why = pair_pictures([at(a, None, "x"), at(c, None, "x"), at(b, None, "x")])
    assert why[a.frame] == "its camera has 2 pictures of trigger x"


def test_too_few_triggers_are_refused(pictures):
    with pytest.raises(InputRejected, match="camera C2 to the others") as caught:
        orient_rig(known(RIG), [each for each in pictures if each.camera < 2])
    assert caught.value.code is codes.RIG_INCOMPLETE
    few = [each for each in pictures if each.scene in ("trigger-00", "trigger-01")]
    with pytest.raises(InputRejected, match="has 2 triggers"):
        orient_rig(known(RIG), few)
