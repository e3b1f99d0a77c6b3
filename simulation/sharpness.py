"""Simulated edges and stars of known blur, for tests and for the demonstration."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

from radiometry.fitting.evidence import Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.roi import Polygon

Matrix = NDArray[np.float64]

COLOURS: Mapping[str, float] = {"R": 0.55, "G": 1.0, "B": 0.7}

_FINE = 4


@dataclass(frozen=True, kw_only=True)
class SimulatedEdge:
    """An edge in a box of the frame, (row, col) of its corner, through the box's middle.

    ``blur_px`` : standard deviation of a Gaussian, or full width of a box, normal to the edge. It is the
        whole blur: the scene is sampled at points, so the pixel's own aperture must be in it
    ``angle_deg`` : from the columns (vertical) or rows; ``rising`` : brighter to the right, or below
    ``bend_px`` : of a parabola, at the ends
    """

    name: str
    row0: int
    col0: int
    height: int = 100
    width: int = 64
    blur: str = "gaussian"  # | "box"
    blur_px: float = 0.7
    angle_deg: float = 5.0
    horizontal: bool = False
    rising: bool = True
    bend_px: float = 0.0

    @property
    def region(self) -> Region:
        """The box as a region."""
        return _box(self.name, self.row0, self.col0, self.height, self.width)


@dataclass(frozen=True, kw_only=True)
class SimulatedStar:
    """A star in a square box, blurred by a Gaussian of ``blur_px``; its centre as (row, col) indices."""

    name: str
    row0: int
    col0: int
    size: int
    centre_row_px: float
    centre_col_px: float
    cycles: int = 48
    blur_px: float = 0.7
    bars: bool = False

    @property
    def region(self) -> Region:
        """The box as a region."""
        return _box(self.name, self.row0, self.col0, self.size, self.size)


@dataclass(frozen=True, kw_only=True)
class SimulatedCamera:
    """Levels [DN] of a linear camera. ``gain_dn`` : per electron; 0: no photon noise."""

    height_px: int = 240
    width_px: int = 320
    cfa: str = "grey"
    black_level_dn: float = 256.0
    white_level_dn: float = 16383.0
    dark_dn: float = 1000.0
    bright_dn: float = 9000.0
    gain_dn: float = 0.0
    read_noise_dn: float = 0.0

    @property
    def header(self) -> FrameHeader:
        """What a file of this camera says."""
        sites = {"grey": 1, "rgb": 3}.get(self.cfa, 4)
        return FrameHeader(
            container="dng",
            decoder="stilb",
            rendered=self.cfa == "rgb",
            compression="none",
            bits_per_sample=14,
            width_px=self.width_px,
            height_px=self.height_px,
            cfa=self.cfa,
            black_level_dn=(self.black_level_dn,) * sites,
            black_level_origin="tag",
            white_level_dn=(self.white_level_dn,) * sites,
            white_level_origin="tag",
        )


def render_chart(
    camera: SimulatedCamera,
    chart: Sequence[SimulatedEdge | SimulatedStar],
    random: np.random.Generator,
) -> Frame:
    """Photograph a chart: its edges and stars in their boxes, noise, rounding, clipping."""
    share = np.full((camera.height_px, camera.width_px), 0.5)
    for each in chart:
        drawn = _draw_edge(each) if isinstance(each, SimulatedEdge) else _draw_star(each)
        share[each.row0 : each.row0 + drawn.shape[0], each.col0 : each.col0 + drawn.shape[1]] = drawn
    signal = _colour(camera, camera.dark_dn + (camera.bright_dn - camera.dark_dn) * share)
    if camera.gain_dn > 0.0:
        signal = camera.gain_dn * random.poisson(signal / camera.gain_dn).astype(np.float64)
    noisy = camera.black_level_dn + signal + camera.read_noise_dn * random.standard_normal(signal.shape)
    header = camera.header
    return Frame(
        samples_dn=np.clip(np.round(noisy), 0, camera.white_level_dn).astype(np.uint16),
        row0=0,
        col0=0,
        height_px=camera.height_px,
        width_px=camera.width_px,
        cfa=camera.cfa,
        black_level_dn=header.black_level_dn,
        white_level_dn=header.white_level_dn,
    )


def _colour(camera: SimulatedCamera, light: Matrix) -> Matrix:
    """Give the signal of every sample of a lit sensor: as it is, in three planes, or behind its mosaic."""
    if camera.cfa == "grey":
        return light
    if camera.cfa == "rgb":
        return np.stack([light * COLOURS[name] for name in "RGB"], axis=2)
    pattern = np.array([COLOURS[name] for name in camera.cfa]).reshape(2, 2)
    tiles = np.tile(pattern, (camera.height_px // 2 + 1, camera.width_px // 2 + 1))
    return np.asarray(light * tiles[: camera.height_px, : camera.width_px], np.float64)


def true_mtf(frequency: Matrix, *, blur: str, blur_px: float) -> Matrix:
    """Give the transfer of a blur: exp(-2 (pi s f)^2) of a Gaussian, |sinc(w f)| of a box."""
    if blur == "box":
        return np.asarray(np.abs(np.sinc(blur_px * frequency)), np.float64)
    return np.asarray(np.exp(-2.0 * (np.pi * blur_px * frequency) ** 2), np.float64)


def _box(name: str, row0: int, col0: int, height: int, width: int) -> Region:
    corners = [(col0, row0), (col0 + width, row0), (col0 + width, row0 + height), (col0, row0 + height)]
    return Region(name=name, polygon=Polygon.from_points(corners))


def _draw_edge(edge: SimulatedEdge) -> Matrix:
    """Give the share of light between dark, 0, and bright, 1, in the edge's box."""
    row, col = np.mgrid[: edge.height, : edge.width].astype(np.float64)
    across, along = (row, col) if edge.horizontal else (col, row)
    extent, length = (edge.height, edge.width) if edge.horizontal else (edge.width, edge.height)
    angle = math.radians(edge.angle_deg)
    bow = edge.bend_px * (2.0 * (along - (length - 1) / 2.0) / length) ** 2
    normal = (across - (extent - 1) / 2.0 - bow) * math.cos(angle) - (along - (length - 1) / 2.0) * math.sin(
        angle
    )
    if not edge.rising:
        normal = -normal
    if edge.blur == "box":
        return np.asarray(np.clip(normal / edge.blur_px + 0.5, 0.0, 1.0), np.float64)
    return np.asarray(ndtr(normal / edge.blur_px), np.float64)


def _draw_star(star: SimulatedStar) -> Matrix:
    """Draw a star four times finer than the pixels, blur it, and sample it at points."""
    fine = (np.arange(star.size * _FINE) + 0.5) / _FINE - 0.5
    rows, cols = star.row0 + fine - star.centre_row_px, star.col0 + fine - star.centre_col_px
    wave = np.cos(star.cycles * np.arctan2(rows[:, None], cols[None, :]))
    if star.bars:
        wave = np.sign(wave)
    blurred = gaussian_filter(wave, star.blur_px * _FINE, truncate=6.0)
    pixels = blurred.reshape(star.size, _FINE, star.size, _FINE)[:, 1:3, :, 1:3].mean(axis=(1, 3))
    return np.asarray(0.5 + 0.5 * pixels, np.float64)
