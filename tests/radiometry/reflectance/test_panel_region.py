"""Regions of a panel that no code gave: as the camera states it, and from another band of the capture."""

from dataclasses import replace

import numpy as np
import pytest

from radiometry.frame import Frame
from radiometry.frame.multispectral import Multispectral, RigGeometry
from radiometry.reflectance.method import find_region
from radiometry.reflectance.panel_code import take_region
from tests.radiometry.reflectance.captures import make_header
from tests.radiometry.reflectance.test_panel_code import EARLY, draw, finish, ground, place, require_within

TURN_DEG, FOCAL_PX, PARALLAX_PX = 4.0, 1000.0, 25
SHIFT_PX = FOCAL_PX * np.tan(np.radians(TURN_DEG))


def make_band(**more):
    return Multispectral(system="micasense", band="nir", band_name="NIR", **more)


def frame_of(samples):
    levels = {"black_level_dn": (2000.0,), "white_level_dn": (65520.0,)}
    return Frame(row0=0, col0=0, height_px=480, width_px=640, samples_dn=samples, cfa="grey", **levels)


def header_of(band):
    return make_header(band, width_px=640, height_px=480, black_level_dn=(2000.0,))


def find(samples, corners, serial=EARLY):
    band = make_band(panel_region=tuple(map(tuple, np.asarray(corners).tolist())), panel_serial=serial)
    return find_region(frame_of(samples), header=header_of(band))


def take_card(centre=(200, 200)):
    picture = ground()
    panel = draw(picture, place(5, 90, centre))
    return finish(picture), panel


def test_the_camera_s_own_statement_is_the_region():
    samples, panel = take_card()
    found = find(samples, panel[[0, 2, 1, 3]])
    assert (found.by, found.serial) == ("reflect_area", None)
    require_within(found, panel)


def test_a_stated_region_without_a_serial_number_takes_that_of_the_code():
    samples, panel = take_card()
    assert (find(samples, panel, serial=None).by, find(samples, panel, serial=None).serial) == (
        "reflect_area",
        EARLY,
    )


@pytest.mark.parametrize(
    "change",
    [
        lambda panel: panel + 400,
        lambda panel: panel * [1.0, 0.01],
        lambda panel: panel.mean(axis=0) + 0.05 * (panel - panel.mean(axis=0)),
        lambda _: np.array(((0, 0), (640, 0), (640, 480), (0, 480))),
        lambda panel: panel + 60,
        lambda panel: np.vstack([panel[:3], panel[:3].mean(axis=0)]),
    ],
    ids=["beside the frame", "oblong", "tiny", "all of it", "over the rim", "a triangle"],
)
def test_what_a_camera_states_is_checked_and_the_code_takes_its_place(change):
    samples, panel = take_card()
    found = find(samples, change(panel))
    assert found.by == "code"
    require_within(found, panel)


def rotated(turn_deg):
    return RigGeometry(
        model="perspective",
        principal_point_px=(320.0, 240.0),
        focal_length_px=FOCAL_PX,
        distortion=(0.0,) * 5,
        rotation_deg=(0.0, turn_deg, 0.0),
    )


@pytest.mark.parametrize(
    ("geometry", "shift"),
    [((rotated(0.0), rotated(TURN_DEG)), SHIFT_PX + PARALLAX_PX), ((None, None), PARALLAX_PX)],
    ids=["by RigRelatives", "where a file states none"],
)
def test_a_panel_is_found_where_another_band_shows_it(geometry, shift):
    """Lenses 4 degrees apart by the files, and 25 px of parallax that no file states."""
    here, panel = take_card((220 + shift, 210))
    there, _ = take_card((220, 210))
    headers = [header_of(make_band(geometry=each)) for each in geometry]
    region = find_region(frame_of(there), header=headers[1]).region
    # the code is left out of what is searched, which another exposure shows
    moved = take_region(
        frame_of((here // 3).astype(np.uint16)),
        header=replace(headers[0], black_level_dn=(600.0,)),
        other=frame_of(there),
        other_header=headers[1],
        region=region,
    )
    assert moved is not None
    assert np.linalg.norm(np.mean(moved[0].points, axis=0) - panel.mean(axis=0)) < 4.0


def test_where_there_is_no_panel_none_is_taken_over():
    there, _ = take_card()
    header = header_of(make_band())
    region = find_region(frame_of(there), header=header).region
    empty = finish(ground())
    assert (
        take_region(frame_of(empty), header=header, other=frame_of(there), other_header=header, region=region)
        is None
    )
