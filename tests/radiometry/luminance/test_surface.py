"""A lit surface: cells in perspective, and figures whose shared errors cancel only where they do."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiometry.findings import InputRejected
from radiometry.frame.grid import Grid
from radiometry.frame.roi import Window, mask
from radiometry.luminance import surface
from radiometry.luminance.surface import Cells, judge_uniformity, lay_grid, outline

ROAD = [[1.2, 0.9, 0.8, 0.9, 1.1], [1.0, 0.8, 0.6, 0.7, 1.0], [0.7, 0.5, 0.45, 0.5, 0.65]]
SQUARE = ((0.0, 0.0), (80.0, 0.0), (80.0, 60.0), (0.0, 60.0))
TRAPEZOID = ((30.0, 10.0), (70.0, 10.0), (95.0, 60.0), (5.0, 60.0))


def cells_of(values, noise=0.0, shared=(), local=()):
    values = np.array(values)
    effects, apart = (
        np.array([np.broadcast_to(effect, values.shape) for effect in each]).reshape(-1, *values.shape)
        for each in (shared, local)
    )
    return Cells(
        values_cd_m2=values,
        noise_cd_m2=np.broadcast_to(noise, values.shape),
        shared_cd_m2=effects,
        local_cd_m2=apart,
    )


def test_the_example_of_the_procedure():
    found = judge_uniformity(cells_of(ROAD))
    assert found.l_av_cd_m2.value == pytest.approx(0.78667, abs=5e-6)
    assert found.u_o.value == pytest.approx(0.57203, abs=5e-6)
    assert found.max_to_min.value == pytest.approx(2.6667, abs=5e-5)
    assert found.average_to_min.value == pytest.approx(0.786667 / 0.45, abs=5e-6)
    assert [line.value for line in found.u_l] == pytest.approx([0.8 / 1.2, 0.6, 0.45 / 0.7])
    assert (found.l_min_cd_m2.value, found.l_max_cd_m2.value) == (0.45, 1.2)


def test_an_error_of_k_is_whole_in_the_average_and_absent_from_ratios():
    found = judge_uniformity(cells_of(ROAD, shared=[0.03 * np.array(ROAD)]))
    assert found.l_av_cd_m2.standard_uncertainty == pytest.approx(0.03 * 0.786667, rel=1e-5)
    ratios = [found.u_o, found.average_to_min, found.max_to_min, *found.u_l]
    assert max(ratio.standard_uncertainty for ratio in ratios) < 1e-15


def test_an_error_of_the_dark_signal_does_not_cancel_in_a_ratio():
    """U = (m - d) / (a - d): dU/dd = (m - a) / a^2, and likewise for the others."""
    found = judge_uniformity(cells_of(ROAD, shared=[0.01]))
    average = np.mean(ROAD)
    assert found.l_av_cd_m2.standard_uncertainty == pytest.approx(0.01)
    assert found.u_o.standard_uncertainty == pytest.approx(0.01 * (average - 0.45) / average**2)
    assert found.max_to_min.standard_uncertainty == pytest.approx(0.01 * (1.2 - 0.45) / 0.45**2)
    assert found.average_to_min.standard_uncertainty == pytest.approx(0.01 * (average - 0.45) / 0.45**2)
    assert found.u_l[1].standard_uncertainty == pytest.approx(0.01 * (1.0 - 0.6) / 1.0**2)


def test_flicker_neither_averages_nor_cancels():
    """10 % of each cell: whole in the average, and in ratios as of cells that err on their own."""
    found = judge_uniformity(cells_of(ROAD, local=[0.1 * np.array(ROAD)]))
    assert found.l_av_cd_m2.standard_uncertainty == pytest.approx(0.0786667, rel=1e-5)
    assert found.max_to_min.standard_uncertainty == pytest.approx(0.1 * np.sqrt(2) * 1.2 / 0.45)


def test_noise_averages_down_and_the_smallest_cell_is_part_of_the_average():
    found = judge_uniformity(cells_of(ROAD, noise=0.002))
    average, n = np.mean(ROAD), 15
    assert found.l_av_cd_m2.standard_uncertainty == pytest.approx(0.002 / np.sqrt(n))
    others = (n - 1) * (0.45 / (n * average**2)) ** 2
    own = (1 / average - 0.45 / (n * average**2)) ** 2
    assert found.u_o.standard_uncertainty == pytest.approx(0.002 * np.sqrt(others + own))
    assert found.max_to_min.standard_uncertainty == pytest.approx(0.002 * np.hypot(1 / 0.45, 1.2 / 0.45**2))


def test_a_dark_cell_that_lies_apart_stays_as_it_is_read():
    lone = np.ones((6, 10))
    lone[3, 4] = 0.6
    noisy = lone * (1 + 0.05 * np.random.default_rng(3).standard_normal(lone.shape))
    found = judge_uniformity(cells_of(noisy, noise=0.05 * noisy))
    assert found.l_min_cd_m2.value == pytest.approx(noisy[3, 4], rel=0.005)


def test_a_cell_that_may_lie_apart_is_read_with_its_odds(monkeypatch):
    """Of 25 cells one is 0.15 dark, the others +-0.05: odds exp(z^2 / 2) / 25, unless the next does too."""
    cells = cells_of(np.reshape([0.85, *[0.95, 1.05] * 12], (5, 5)), noise=0.05)
    found = judge_uniformity(cells).l_min_cd_m2
    monkeypatch.setattr(surface, "_FEWEST", 26)
    crowd = judge_uniformity(cells).l_min_cd_m2
    first = 1.0 / (1.0 + 25.0 * math.exp(-0.5 * 0.15**2 / (0.05**2 * 24 / 23)))
    z2 = (1.0 + 1 / 23) ** 2 / ((1.0 - 1 / 23**2) * 23 / 22)
    apart, left = first * (1.0 - 1.0 / (1.0 + 25.0 * math.exp(-0.5 * z2))), 0.85 - crowd.value
    assert found.value == pytest.approx(crowd.value + apart * left)
    between = apart * (1.0 - apart) * left**2
    assert between < found.standard_uncertainty**2 < crowd.standard_uncertainty**2 + between + 0.05**2


def test_ratios_over_nothing_are_left_out():
    found = judge_uniformity(cells_of([[1.0, 0.0], [-2.0, -3.0]]))
    assert (found.u_o, found.average_to_min, found.max_to_min) == (None, None, None)
    assert (found.u_l[0].value, found.u_l[1]) == (0.0, None)


def test_a_tile_of_a_road_in_perspective_is_where_a_camera_sees_it():
    """A pinhole 10 m above a road, looking down by 30 degrees: its own projection is the truth."""

    def see(x_m, y_m):
        depth = y_m * np.cos(0.5) + 10 * np.sin(0.5)
        return (500 + 800 * x_m / depth, 400 - 800 * (y_m * np.sin(0.5) - 10 * np.cos(0.5)) / depth)

    corners = tuple(see(x, y) for x, y in ((-4, 60), (4, 60), (4, 20), (-4, 20)))
    cells = lay_grid(Grid(corners=corners, rows=4, columns=2))
    for row, col in itertools.product(range(4), range(2)):
        ys, xs = (60 - 10 * row, 50 - 10 * row), (-4 + 4 * col, 4 * col)
        expected = sorted(see(x, y) for x in xs for y in ys)
        assert np.array(sorted(cells[row][col].points)) == pytest.approx(np.array(expected), abs=1e-6)


@given(st.permutations(range(4)), st.integers(1, 5), st.integers(1, 5))
def test_every_pixel_of_the_surface_is_in_one_cell(order, rows, columns):
    """Whichever corner the surface begins with; out of order it is refused."""
    corners = tuple(TRAPEZOID[index] for index in order)
    window = Window(row0=0, col0=0, height=70, width=100)
    grid = Grid(corners=corners, rows=rows, columns=columns)
    steps = {(b - a) % 4 for a, b in zip(order, [*order[1:], order[0]], strict=True)}
    if len(steps) != 1:
        with pytest.raises(InputRejected, match="not those of a surface"):
            lay_grid(grid)
        return
    counted = sum(mask(cell, window).astype(int) for line in lay_grid(grid) for cell in line)
    assert counted.max() == 1
    # the grid's outer lines and the outline run alike up to rounding of the lattice
    assert np.count_nonzero(counted != mask(outline(grid), window)) == 0


@pytest.mark.parametrize(
    "corners",
    [
        ((0, 0), (10, 0), (20, 0), (0, 10)),
        ((0, 0), (10, 10), (10, 0), (0, 10)),
        ((0, 0), (10, 0), (3, 3), (0, 10)),
        ((5, 5),) * 4,
    ],
    ids=["on a line", "crossed", "dented", "a point"],
)
def test_what_is_no_surface_is_refused(corners):
    with pytest.raises(InputRejected) as refused:
        lay_grid(Grid(corners=corners, rows=1, columns=1))
    assert refused.value.code == "grid_invalid"


@pytest.mark.parametrize("shape", [(0, 1), (1, 51)])
def test_too_many_or_no_cells_are_refused(shape):
    with pytest.raises(InputRejected, match="1 to 50 rows"):
        lay_grid(Grid(corners=SQUARE, rows=shape[0], columns=shape[1]))
