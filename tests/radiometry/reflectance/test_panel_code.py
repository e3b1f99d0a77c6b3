"""A panel is found by its code, wherever it lies beside it, and not at all where that is not certain."""

import cv2
import numpy as np
import pytest
import tifffile

from radiometry.reflectance import panel_code
from radiometry.reflectance.panel_code import SHRINK, find_panel
from simulation.sequoia import Card, fill
from tests.support.data import data_file

EARLY, LATE = "RP02-1603036-SC", "RP04-1901231-SC"
LAYOUTS = {EARLY: (1.68, 1.30), LATE: (1.57, 0.75)}
SHAPE = (480, 640)
GROUND, BLACK, PANEL, WHITE = 9000, 8000, 38000, 45000
CODE_PX = 100

# The hand-drawn panel's corners in band 1, and by how much the other bands see it moved, (x, y).
CORNERS = np.array(((809, 613), (648, 615), (646, 454), (808, 452)), dtype=np.float32)
SHIFTS = ((0, 0), (-35, 10), (-35, 38), (20, 43), (0, 20))


def place(angle_deg, size, centre, *, mirrored=False):
    """The affine map from sides of the code, about its centre, to the picture [px]."""
    turn = np.radians(angle_deg)
    linear = size * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    if mirrored:
        linear[:, 0] *= -1.0
    return np.column_stack([linear, centre])


def draw(picture, pose, *, text=EARLY, way=(1, 0), level=PANEL):
    """A card with its code and its panel; where the panel's corners are."""
    distance, side = LAYOUTS.get(text, LAYOUTS[EARLY])
    tones = {"ink": BLACK, "panel": level, "paper": WHITE}
    card = Card(text=text, pose=pose, way=way, distance=distance, side=side, **tones)
    card.paint(picture)
    return card.panel_corners


def find_region(picture):
    """The region alone: a code that is read may leave open where its panel lies."""
    found = find_panel(picture)
    return found.region if found else None


def ground():
    return np.full(SHAPE, float(GROUND))


def finish(picture):
    """Blurred a little, with the noise of a sensor."""
    noise = np.random.default_rng(7).normal(0.0, 300.0, SHAPE)
    return np.clip(cv2.GaussianBlur(picture, (0, 0), 0.7) + noise, 0, 65520).astype(np.uint16)


def require_within(found, panel, *, share=SHRINK):
    """The region lies in the panel, about its middle, and covers what it should."""
    region = np.array(found.region.points, dtype=np.float32)
    side = np.sqrt(cv2.contourArea(panel))
    for x, y in region.tolist():
        assert cv2.pointPolygonTest(panel, (x, y), True) > 0.08 * side
    assert np.linalg.norm(region.mean(axis=0) - panel.mean(axis=0)) < 0.06 * side
    assert np.sqrt(cv2.contourArea(region)) == pytest.approx(share * side, rel=0.05)


@pytest.mark.parametrize("text", [EARLY, LATE])
@pytest.mark.parametrize("way", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_the_side_is_read_off_the_picture(text, way):
    picture = ground()
    panel = draw(picture, place(0, CODE_PX, (320, 240)), text=text, way=way)
    found = find_panel(finish(picture))
    assert found.serial == text
    require_within(found, panel)


@pytest.mark.parametrize(
    ("angle_deg", "size", "mirrored"),
    [(17, 100, False), (45, 90, False), (-70, 70, True), (180, 120, False), (200, 75, False)],
)
def test_turn_and_size_follow_from_the_code(angle_deg, size, mirrored):
    picture = ground()
    panel = draw(picture, place(angle_deg, size, (320, 240), mirrored=mirrored))
    require_within(find_panel(finish(picture)), panel)


def test_a_large_picture_is_searched_smaller_and_answered_in_its_own_pixels(monkeypatch):
    picture = ground()
    panel = draw(picture, place(5, 140, (250, 240)))
    monkeypatch.setattr(panel_code, "LONGEST_SIDE_PX", 400)  # half of it
    require_within(find_panel(finish(picture)), panel)


def test_a_code_that_names_no_panel_finds_nothing():
    picture = ground()
    draw(picture, place(0, CODE_PX, (320, 240)), text="a poster")
    assert find_panel(finish(picture)) is None


def draw_two(text):
    """A panel, and a second code: the detector reads one of them, and the other once that is covered."""
    picture = ground()
    panel = draw(picture, place(0, 90, (200, 120)))
    draw(picture, place(25, 90, (250, 330)), text=text)
    return picture, panel


def test_a_code_that_names_no_panel_hides_none():
    picture, panel = draw_two("a poster")
    require_within(find_panel(finish(picture)), panel)


@pytest.mark.parametrize("text", [EARLY, "RP02-1603099-SC"])
def test_of_two_panels_none_is_chosen(text):
    picture, _ = draw_two(text)
    assert find_region(finish(picture)) is None


@pytest.mark.parametrize("level", [GROUND, 20000, 65520])
def test_grass_is_no_panel_and_a_saturated_one_is(level):
    """That it is saturated is for the verdict to say."""
    picture = ground()
    panel = draw(picture, place(0, CODE_PX, (320, 240)), level=level)
    if level < 65520:
        assert find_region(finish(picture)) is None
    else:
        require_within(find_panel(finish(picture)), panel)


@pytest.mark.parametrize("what", ["two sides", "shadow", "over the rim"])
def test_a_panel_that_is_not_certain_is_not_found(what):
    picture, pose = ground(), place(0, CODE_PX, (500 if what == "over the rim" else 320, 240))
    panel = draw(picture, pose)
    if what == "two sides":
        fill(picture, 2 * pose[:, 2] - panel, PANEL)
    elif what == "shadow":
        left, right = int(panel[:, 0].min()), int(panel[:, 0].mean())
        picture[:, left:right] = np.minimum(picture[:, left:right], 28000)
    assert find_region(finish(picture)) is None


@pytest.mark.parametrize("shape", [SHAPE, (1, 1), (10, 3000), (70, 70, 3)])
def test_where_there_is_nothing_nothing_is_found(shape):
    noise = np.random.default_rng(3).integers(0, 65520, shape).astype(np.uint16)
    for picture in (np.zeros(shape, np.uint16), np.full(shape, 65520, np.uint16), noise):
        assert find_panel(picture) is None


@pytest.mark.parametrize("band", range(1, 6))
def test_a_real_panel_is_found_within_the_one_that_was_drawn(band):
    samples = tifffile.imread(data_file(f"rededge/0000SET_000_IMG_0000_{band}.tif"))
    found = find_panel(samples)
    assert found.serial == EARLY
    require_within(found, CORNERS + np.array(SHIFTS[band - 1], dtype=np.float32))


def test_a_flight_s_frame_shows_no_panel():
    assert find_panel(tifffile.imread(data_file("rededge/0000SET_000_IMG_0001_1.tif"))) is None
