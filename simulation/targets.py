"""Targets: what the camera sees, as shares of the lamp's luminance; and series of flats."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

from radiometry.fitting.evidence import Region
from radiometry.frame import Frame, exposure, roi
from radiometry.records import Record
from radiometry.vignetting.blocks import Grid
from simulation.camera import Camera, Lamp, Plane, Shot, Target, change, take

_SETTINGS = exposure.Settings(exposure_time_s=0.01, f_number=4.0, iso=100.0)
_FINE = 4  # samples of a star along each side of a pixel


class Surface(Record):
    """An even surface, unless told otherwise."""

    share: float = 1.0  # Share of the lamp's luminance in the middle of the frame
    gradient: tuple[float, float] = (0.0, 0.0)  # Relative change per half diagonal, down and to the right
    # (row, col, radius, depth) of discs that lack the share ``depth`` of the light [px, px, px, 1]
    spots: Sequence[tuple[float, float, float, float]] = ()

    def draw(self, camera: Camera, window: roi.Window) -> Plane:
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

    def draw(self, camera: Camera, window: roi.Window) -> Plane:  # noqa: ARG002  as every target
        shares = np.asarray(self.shares, np.float64)
        rows = slice(window.row0, window.row0 + window.height)
        return shares[rows, window.col0 : window.col0 + window.width] if shares.ndim else shares


class Edge(Record):
    """An edge through the middle of a box of the frame, whose corner is (row0, col0)."""

    name: str
    row0: int
    col0: int
    height: int = 100
    width: int = 64
    # "gaussian" with a standard deviation or "box" with a full width, normal to the edge [px]. It is the
    # whole blur: the edge is sampled at points, so it includes the pixel's own aperture
    blur: str = "gaussian"
    blur_px: float = 0.7
    angle_deg: float = 5.0  # Angle from the columns, or from the rows if ``horizontal`` [deg]
    horizontal: bool = False
    rising: bool = True  # True if it is brighter to the right, or below
    bend_px: float = 0.0  # Deviation of a parabola from the straight line at its ends [px]

    @property
    def region(self) -> Region:
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


class Star(Record):
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
    return Region(name=name, polygon=roi.Polygon.from_points(corners))


def true_mtf(frequency: Plane, *, blur: str, blur_px: float) -> Plane:
    """Return the transfer function of a blur: exp(-2 (pi s f)^2) of a Gaussian, abs(sinc(w f)) of a box."""
    if blur == "box":
        return np.asarray(np.abs(np.sinc(blur_px * frequency)), np.float64)
    return np.asarray(np.exp(-2.0 * (np.pi * blur_px * frequency) ** 2), np.float64)


class Chart(Record, kw_only=False):
    """Edges and stars in their boxes, half bright beside them.

    ``magnified`` : scale of a colour about the middle of the frame, where it is not 1; of edges alone
    """

    parts: Sequence[Edge | Star]
    magnified: Mapping[str, float] = field(default_factory=dict)

    def draw(self, camera: Camera, window: roi.Window) -> Plane:
        if self.magnified:
            scales = [self.magnified.get(colour, 1.0) for colour in "RGB"]
            return np.stack([self._draw(camera, window, scale) for scale in scales], axis=-1)
        return self._draw(camera, window, 1.0)

    def _draw(self, camera: Camera, window: roi.Window, scale: float) -> Plane:
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


class Studio(Record):
    """A camera in front of a target of two tones."""

    camera: Camera
    dark_dn: float  # Signals of the strongest colour on the axis where the target's share is 0 and 1 [DN]
    bright_dn: float
    settings: exposure.Settings = _SETTINGS

    def light_up(self, target: Target) -> Picture:
        """Return the target with its tones as shares of the bright one."""
        dark = self.dark_dn / self.bright_dn
        return Picture(dark + (1.0 - dark) * target.draw(self.camera, self.camera.window))

    def plan(self, target: Target, *, name: str = "chart") -> Shot:
        lamp = Lamp(luminance_cd_m2=self.camera.find_luminance(self.bright_dn, self.settings))
        lit = self.light_up(target)
        return Shot(frame=name, role="chart", settings=self.settings, lamp=lamp, target=lit)

    def photograph(self, target: Target, random: np.random.Generator) -> Frame:
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


# A fast wide-angle lens: half of the light is left in the corner wide open, 3 % are lost when stopped down.
FALLOFFS: dict[float, tuple[float, float, float]] = {
    1.4: (-0.62, 0.20, -0.08),
    2.0: (-0.38, 0.13, -0.06),
    2.8: (-0.20, 0.06, -0.04),
    4.0: (-0.085, 0.02, -0.015),
    5.6: (-0.045, 0.01, -0.005),
    8.0: (-0.032, 0.005, -0.003),
}
FAST_LENS = change(
    Camera(),
    height_px=480,
    width_px=720,
    falloffs=FALLOFFS,
    gain_dn_per_e=0.25,
    read_noise_e=8.0,
    colours={"R": 0.6, "G": 1.0, "B": 0.7},
)
DARK = Lamp(luminance_cd_m2=0.0)
# At f/4 the luminance is the number of electrons per second that the strongest colour collects.
COUNTING_SENSOR = change(Camera(), cfa="grey", sensitivity_e=16.0, read_noise_e=4.0, white_level_dn=16383.0)


def plan_flat(camera: Camera, *, f_number: float, surface: Surface | None = None, name: str = "flat") -> Shot:
    """Plan a flat; the surface's share is that of the span from black to white, 70 % if None."""
    settings = exposure.Settings(exposure_time_s=0.01, f_number=f_number, iso=100.0)
    span_dn = camera.sensor.white_level_dn - camera.sensor.black_level_dn
    lamp = Lamp(luminance_cd_m2=camera.find_luminance(span_dn, settings))
    return Shot(frame=name, role="flat", settings=settings, lamp=lamp, target=surface or Surface(share=0.7))


def plan_dark(*, name: str = "dark", iso: float = 100.0) -> Shot:
    """Plan a frame with the lens covered."""
    settings = exposure.Settings(exposure_time_s=0.01, f_number=8.0, iso=iso)
    return Shot(frame=name, role="dark", settings=settings, lamp=DARK, target=Surface())


def plan_flats(
    camera: Camera, *, f_numbers: Sequence[float] = tuple(FALLOFFS), flats: int = 3, darks: int = 3
) -> list[Shot]:
    """Plan a number of flats at each f-number, and a number of dark frames."""
    lit = [
        plan_flat(camera, f_number=f_number, name=f"flat-f{f_number:g}-{n}")
        for f_number in f_numbers
        for n in range(1, flats + 1)
    ]
    return lit + [plan_dark(name=f"dark-{n}") for n in range(1, darks + 1)]


def plan_series(
    camera: Camera,
    *,
    light_e_per_s: float,
    times_s: Sequence[float],
    dark_times_s: Sequence[float],
    frames: int = 2,
    role: str = "flat",
) -> list[Shot]:
    """Plan ``frames`` flat and dark frames at each time, for a camera like ``COUNTING_SENSOR``."""
    iso = camera.sensor.base_iso
    return [
        Shot(
            frame=f"{role}-{iso:g}-{time:g}-{number}",
            role=role,
            settings=exposure.Settings(exposure_time_s=time, f_number=4.0, iso=iso),
            lamp=lamp,
            target=Surface(),
        )
        for role, times, lamp in (
            (role, times_s, Lamp(luminance_cd_m2=light_e_per_s)),
            ("dark", dark_times_s, DARK),
        )
        for time in times
        for number in range(frames)
    ]


def find_variance_maximum(camera: Camera, *, end_e: float | None = None, prnu_rel: float = 0.0) -> float:
    """Return the electrons at which the temporal variance is greatest: the full well of EMVA 1288.

    ``end_e`` : electrons at which a pixel ends sharply, the white level if None; ``prnu_rel`` : its spread
    """
    sensor = camera.sensor
    end_e = end_e or (sensor.white_level_dn - sensor.black_level_dn) / sensor.gain_dn_per_e
    z, spread = np.linspace(-6.0, 6.0, 601), np.linspace(-3.0, 3.0, 31)
    weights, shares = (np.exp(-(each**2) / 2.0) for each in (z, spread))
    weights /= weights.sum()
    width_e = math.hypot(math.sqrt(end_e), prnu_rel * end_e)
    means_e = end_e - np.linspace(0.0, 6.0, 241) * width_e
    variances = []
    for mean_e in means_e:
        pixels_e = mean_e * (1.0 + prnu_rel * spread)
        noise_e = np.sqrt(pixels_e + sensor.read_noise_e**2)
        drawn_e = np.minimum(pixels_e[:, None] + noise_e[:, None] * z, end_e)
        own = drawn_e**2 @ weights - (drawn_e @ weights) ** 2
        variances.append(float(own @ shares / shares.sum()))
    return float(means_e[int(np.argmax(variances))])
