"""Flat and dark frames of a lens whose true falloff is known, for tests and for the demonstration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.statistics import GREY
from radiometry.vignetting.curve import evaluate_curve
from radiometry.vignetting.grid import Grid

# A fast wide-angle lens: half of the light is left in the corner wide open, 3 % are lost when stopped down.
FALLOFFS: dict[float, tuple[float, float, float]] = {
    1.4: (-0.62, 0.20, -0.08),
    2.0: (-0.38, 0.13, -0.06),
    2.8: (-0.20, 0.06, -0.04),
    4.0: (-0.085, 0.02, -0.015),
    5.6: (-0.045, 0.01, -0.005),
    8.0: (-0.032, 0.005, -0.003),
}


@dataclass(frozen=True, kw_only=True)
class SimulatedLens:
    """A camera with its lens.

    ``falloffs`` : true k1, k2, k3 by f-number, the same in all channels; ``centre_px`` : row and column, None
    for the frame's middle; ``sensitivities`` : of R, G, B relative to the strongest
    """

    height_px: int = 480
    width_px: int = 720
    cfa: str = "RGGB"
    falloffs: Mapping[float, tuple[float, float, float]] = field(default_factory=lambda: FALLOFFS)
    centre_px: tuple[float, float] | None = None
    sensitivities: Mapping[str, float] = field(default_factory=lambda: {"R": 0.6, "G": 1.0, "B": 0.7})
    black_level_dn: float = 256.0
    white_level_dn: float = 4095.0
    dn_per_e: float = 0.25
    read_noise_dn: float = 2.0

    @property
    def true_centre_px(self) -> tuple[float, float]:
        """Row and column of the falloff's centre."""
        return self.centre_px or Grid.over(self.height_px, self.width_px).middle_px

    def share(self, f_number: float) -> NDArray[np.float64]:
        """Give the true V of every pixel, (row, col)."""
        row, col = self.true_centre_px
        rows, cols = np.arange(self.height_px)[:, None] - row, np.arange(self.width_px)[None, :] - col
        radius = Grid.over(self.height_px, self.width_px).half_diagonal_px
        return evaluate_curve((rows**2 + cols**2) / radius**2, self.falloffs[f_number])


@dataclass(frozen=True, kw_only=True)
class Target:
    """What stands before the lens.

    ``level_share`` : of the strongest channel at the centre, of the span from black to white
    ``gradient`` : of its light, relative per half diagonal, down and to the right
    ``spots`` : (row, col, radius, depth): discs that lack so much of the light [px, px, px, 1]
    """

    level_share: float = 0.7
    gradient: tuple[float, float] = (0.0, 0.0)
    spots: Sequence[tuple[float, float, float, float]] = ()


@dataclass(frozen=True, kw_only=True)
class SimulatedFrame:
    """One raw file: its name, role, header, exposure and all of its pixels."""

    name: str
    role: str
    header: FrameHeader
    exposure: Exposure
    frame: Frame


def simulate_flat(
    lens: SimulatedLens,
    random: np.random.Generator,
    *,
    f_number: float,
    target: Target | None = None,
    name: str = "flat",
    iso: float = 100.0,
) -> SimulatedFrame:
    """Expose a flat: DN = black + A s V(r) (1 + plane) (1 - spots) with photon and read noise, rounded."""
    target = target or Target()
    span = lens.white_level_dn - lens.black_level_dn
    light = target.level_share * span * lens.share(f_number) * _light_up(lens, target)
    electrons = random.poisson(light[..., None] * _sensitivities(lens) / lens.dn_per_e)
    return _develop(
        lens, random, np.asarray(electrons * lens.dn_per_e, np.float64), (name, "flat", f_number, iso)
    )


def simulate_dark(
    lens: SimulatedLens, random: np.random.Generator, *, name: str = "dark", iso: float = 100.0
) -> SimulatedFrame:
    """Expose with the lens covered."""
    nothing = np.zeros((lens.height_px, lens.width_px, 1))
    return _develop(lens, random, nothing, (name, "dark", 8.0, iso))


def simulate_campaign(
    lens: SimulatedLens,
    random: np.random.Generator,
    *,
    f_numbers: Sequence[float] = tuple(FALLOFFS),
    flats: int = 3,
    darks: int = 3,
) -> list[SimulatedFrame]:
    """Expose so many flats at each f-number, and so many dark frames."""
    frames = [
        simulate_flat(lens, random, f_number=f_number, name=f"flat-f{f_number:g}-{n}")
        for f_number in f_numbers
        for n in range(1, flats + 1)
    ]
    return frames + [simulate_dark(lens, random, name=f"dark-{n}") for n in range(1, darks + 1)]


def _light_up(lens: SimulatedLens, target: Target) -> NDArray[np.float64]:
    grid = Grid.over(lens.height_px, lens.width_px)
    middle, radius = grid.middle_px, grid.half_diagonal_px
    rows, cols = np.arange(lens.height_px)[:, None], np.arange(lens.width_px)[None, :]
    by_row, by_col = target.gradient
    light = 1.0 + by_row * (rows - middle[0]) / radius + by_col * (cols - middle[1]) / radius
    for row, col, radius_px, depth in target.spots:
        light = light * (1.0 - depth * ((rows - row) ** 2 + (cols - col) ** 2 <= radius_px**2))
    return np.asarray(light)


def _sensitivities(lens: SimulatedLens) -> NDArray[np.float64]:
    """Give the sensitivity of every pixel, (row, col, plane)."""
    shape = (lens.height_px, lens.width_px, 1)
    if lens.cfa == GREY:
        return np.ones(shape)
    if lens.cfa == "rgb":
        return np.broadcast_to([lens.sensitivities[colour] for colour in "RGB"], (*shape[:2], 3))
    pattern = np.array([lens.sensitivities[colour] for colour in lens.cfa]).reshape(2, 2)
    repeats = (lens.height_px // 2 + 1, lens.width_px // 2 + 1)
    return np.tile(pattern, repeats)[: shape[0], : shape[1], None]


def _develop(
    lens: SimulatedLens,
    random: np.random.Generator,
    light_dn: NDArray[np.float64],
    shot: tuple[str, str, float, float],
) -> SimulatedFrame:
    name, role, f_number, iso = shot
    noisy = lens.black_level_dn + light_dn + lens.read_noise_dn * random.standard_normal(light_dn.shape)
    samples = np.clip(np.round(noisy), 0.0, lens.white_level_dn).astype(np.uint16)
    exposure = Exposure(exposure_time_s=0.01, f_number=f_number, iso=iso)
    header = FrameHeader(
        container="dng",
        decoder="stilb",
        rendered=False,
        compression="none",
        bits_per_sample=16,
        width_px=lens.width_px,
        height_px=lens.height_px,
        cfa=lens.cfa,
        black_level_dn=(lens.black_level_dn,) * 4,
        black_level_origin="tag",
        white_level_dn=(lens.white_level_dn,) * 4,
        white_level_origin="tag",
        exposure_time_s=exposure.exposure_time_s,
        f_number=f_number,
        iso=iso,
    )
    frame = Frame(
        samples_dn=samples if lens.cfa == "rgb" else samples[..., 0],
        row0=0,
        col0=0,
        height_px=header.height_px,
        width_px=header.width_px,
        cfa=header.cfa,
        black_level_dn=header.black_level_dn,
        white_level_dn=header.white_level_dn,
    )
    return SimulatedFrame(name=name, role=role, header=header, exposure=exposure, frame=frame)
