"""Targets: what the camera sees, as shares of the lamp's luminance."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

from radiometry.fitting.evidence import Region
from radiometry.frame import Frame
from radiometry.frame.exposure import Settings
from radiometry.frame.roi import Polygon, Window
from radiometry.vignetting.blocks import Grid
from simulation.camera import Camera, Shot, Target, change, take
from simulation.light import Lamp
from simulation.parts import Plane

_SETTINGS = Settings(exposure_time_s=0.01, f_number=4.0, iso=100.0)
_FINE = 4  # samples of a star along each side of a pixel


@dataclass(frozen=True, kw_only=True)
class Surface:
    """An even surface, unless told otherwise.

    Attributes
    ----------
    share : float
        Share of the lamp's luminance in the middle of the frame.
    gradient : tuple of float
        Relative change per half diagonal, down and to the right.
    spots : sequence
        (row, col, radius, depth) of discs that lack the share ``depth`` of the light [px, px, px, 1].

    """

    share: float = 1.0
    gradient: tuple[float, float] = (0.0, 0.0)
    spots: Sequence[tuple[float, float, float, float]] = ()

    def draw(self, camera: Camera, window: Window) -> Plane:
        """Return the shares of the window's pixels."""
        grid = Grid.over(camera.sensor.height_px, camera.sensor.width_px)
        rows = np.arange(window.row0, window.row0 + window.height)[:, None]
        cols = np.arange(window.col0, window.col0 + window.width)[None, :]
        down, right = (
            (at - at0) / grid.half_diagonal_px for at, at0 in zip((rows, cols), grid.middle_px, strict=True)
        )
        light = self.share * (1.0 + self.gradient[0] * down + self.gradient[1] * right)
        for row, col, radius_px, depth in self.spots:
            light = light * (1.0 - depth * ((rows - row) ** 2 + (cols - col) ** 2 <= radius_px**2))
        return np.asarray(light)


@dataclass(frozen=True, eq=False)
class Picture:
    """A target given by its shares: one for all pixels, or (row, col) of the whole frame."""

    shares: Plane | float

    def draw(self, camera: Camera, window: Window) -> Plane:  # noqa: ARG002  as every target
        """Return the shares of the window's pixels."""
        shares = np.asarray(self.shares, np.float64)
        rows = slice(window.row0, window.row0 + window.height)
        return shares[rows, window.col0 : window.col0 + window.width] if shares.ndim else shares


@dataclass(frozen=True, kw_only=True)
class Edge:
    """An edge through the middle of a box of the frame, whose corner is (row0, col0).

    Attributes
    ----------
    blur, blur_px : str, float
        "gaussian" with a standard deviation or "box" with a full width, normal to the edge [px]. It is the
        whole blur: the edge is sampled at points, so it includes the pixel's own aperture.
    angle_deg : float
        Angle from the columns, or from the rows if ``horizontal`` [deg].
    rising : bool
        True if it is brighter to the right, or below.
    bend_px : float
        Deviation of a parabola from the straight line at its ends [px].

    """

    name: str
    row0: int
    col0: int
    height: int = 100
    width: int = 64
    blur: str = "gaussian"
    blur_px: float = 0.7
    angle_deg: float = 5.0
    horizontal: bool = False
    rising: bool = True
    bend_px: float = 0.0

    @property
    def region(self) -> Region:
        """The box as a region."""
        return _box(self.name, self.row0, self.col0, self.height, self.width)

    @property
    def normal(self) -> Plane:
        """Unit normal of the edge in its middle, (row, col)."""
        angle = math.radians(self.angle_deg)
        across, along = math.cos(angle), -math.sin(angle)
        return np.array([across, along] if self.horizontal else [along, across])

    def fill(self, *, moved_px: float = 0.0) -> Plane:
        """Return the shares in the box, moved along the normal: 0 on the dark side, 1 on the bright side."""
        row, col = np.mgrid[: self.height, : self.width].astype(np.float64)
        row, col = row - (self.height - 1) / 2.0, col - (self.width - 1) / 2.0
        across, along, length = (row, col, self.width) if self.horizontal else (col, row, self.height)
        angle = math.radians(self.angle_deg)
        bow = self.bend_px * (2.0 * along / length) ** 2
        normal = (across - bow) * math.cos(angle) - along * math.sin(angle) - moved_px
        normal = (normal if self.rising else -normal) / self.blur_px
        return np.asarray(np.clip(normal + 0.5, 0.0, 1.0) if self.blur == "box" else ndtr(normal), np.float64)


@dataclass(frozen=True, kw_only=True)
class Star:
    """A Siemens star of sines or ``bars`` in a square box, blurred by a Gaussian; its centre in indices."""

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

    def fill(self) -> Plane:
        """Return the shares in the box, drawn and blurred four times finer than its pixels."""
        fine = (np.arange(self.size * _FINE) + 0.5) / _FINE - 0.5
        rows, cols = self.row0 + fine - self.centre_row_px, self.col0 + fine - self.centre_col_px
        wave = np.cos(self.cycles * np.arctan2(rows[:, None], cols[None, :]))
        blurred = gaussian_filter(np.sign(wave) if self.bars else wave, self.blur_px * _FINE, truncate=6.0)
        pixels = blurred.reshape(self.size, _FINE, self.size, _FINE)[:, 1:3, :, 1:3].mean(axis=(1, 3))
        return np.asarray(0.5 + 0.5 * pixels, np.float64)


def _box(name: str, row0: int, col0: int, height: int, width: int) -> Region:
    corners = [(col0, row0), (col0 + width, row0), (col0 + width, row0 + height), (col0, row0 + height)]
    return Region(name=name, polygon=Polygon.from_points(corners))


def true_mtf(frequency: Plane, *, blur: str, blur_px: float) -> Plane:
    """Return the transfer function of a blur: exp(-2 (pi s f)^2) of a Gaussian, abs(sinc(w f)) of a box."""
    if blur == "box":
        return np.asarray(np.abs(np.sinc(blur_px * frequency)), np.float64)
    return np.asarray(np.exp(-2.0 * (np.pi * blur_px * frequency) ** 2), np.float64)


@dataclass(frozen=True)
class Chart:
    """Edges and stars in their boxes, half bright beside them.

    ``magnified`` : scale of a colour about the middle of the frame, where it is not 1; of edges alone
    """

    parts: Sequence[Edge | Star]
    magnified: Mapping[str, float] = field(default_factory=dict)

    def draw(self, camera: Camera, window: Window) -> Plane:
        """Return the shares of the window's pixels."""
        if self.magnified:
            scales = [self.magnified.get(colour, 1.0) for colour in "RGB"]
            return np.stack([self._draw(camera, window, scale) for scale in scales], axis=-1)
        return self._draw(camera, window, 1.0)

    def _draw(self, camera: Camera, window: Window, scale: float) -> Plane:
        size = np.array([camera.sensor.height_px, camera.sensor.width_px])
        share = np.full(size, 0.5)
        for each in self.parts:
            if isinstance(each, Edge) and scale != 1.0:
                middle = np.array([each.row0 + each.height / 2.0, each.col0 + each.width / 2.0])
                box = each.fill(moved_px=(scale - 1.0) * float(each.normal @ (middle - size / 2.0)))
            else:
                box = each.fill()
            share[each.row0 : each.row0 + box.shape[0], each.col0 : each.col0 + box.shape[1]] = box
        return Picture(share).draw(camera, window)


@dataclass(frozen=True, kw_only=True)
class Studio:
    """A camera in front of a target of two tones.

    Attributes
    ----------
    dark_dn, bright_dn : float
        Signals of the strongest colour on the axis where the target's share is 0 and 1 [DN].

    """

    camera: Camera
    dark_dn: float
    bright_dn: float
    settings: Settings = _SETTINGS

    def light_up(self, target: Target) -> Picture:
        """Return the target with its tones as shares of the bright one."""
        dark = self.dark_dn / self.bright_dn
        return Picture(dark + (1.0 - dark) * target.draw(self.camera, self.camera.window))

    def plan(self, target: Target, *, name: str = "chart") -> Shot:
        """Plan a photograph of the target."""
        lamp = Lamp(luminance_cd_m2=self.camera.find_luminance(self.bright_dn, self.settings))
        lit = self.light_up(target)
        return Shot(frame=name, role="chart", settings=self.settings, lamp=lamp, target=lit)

    def photograph(self, target: Target, random: np.random.Generator) -> Frame:
        """Photograph the target."""
        return take(self.camera, self.plan(target), random).frame


CHART_STUDIO = Studio(
    camera=change(
        Camera(),
        height_px=240,
        width_px=320,
        cfa="grey",
        gain_dn_per_e=1.0,
        photon_noise=False,
        white_level_dn=16383.0,
    ),
    dark_dn=1000.0,
    bright_dn=9000.0,
)
