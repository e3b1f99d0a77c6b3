"""A simulated sensor whose gain, noise and patterns are known, for tests and for the demonstration."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon
from radiometry.noise.blocks import FrameRow, extract_features

_COLOURS = {"R": 0.6, "G": 1.0, "B": 0.8}


@dataclass(frozen=True, kw_only=True)
class SimulatedSensor:
    """What is true of a sensor at one ISO value.

    ``full_well_e`` : electrons a pixel can hold; above (white - black) / gain the numbers end first
    ``dsnu_e``, ``prnu_rel`` : standard deviations from pixel to pixel, the same in every frame of a ``seed``
    ``bend_rel`` : the signal loses this share at the full well, in proportion below
    ``compensates_dark`` : the mean dark current is subtracted again, its noise stays
    """

    system_gain_dn_per_e: float = 0.5
    read_noise_e: float = 4.0
    full_well_e: float = 1e9
    dark_current_e_per_s: float = 0.0
    dsnu_e: float = 0.0
    prnu_rel: float = 0.0
    bend_rel: float = 0.0
    black_level_dn: float = 256.0
    white_level_dn: float = 16383.0
    iso: float = 100.0
    cfa: str = "grey"
    rows: int = 96
    cols: int = 96
    compensates_dark: bool = False
    seed: int = 0

    def patterns(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give every pixel's dark offset [e-] and gain, (row, col)."""
        rng = np.random.default_rng([self.seed, 7])
        shape = (self.rows, self.cols)
        return self.dsnu_e * rng.standard_normal(shape), 1.0 + self.prnu_rel * rng.standard_normal(shape)

    def colour(self) -> NDArray[np.float64]:
        """Give each site's sensitivity relative to green, (row, col)."""
        if self.cfa == "grey":
            return np.ones((self.rows, self.cols))
        cell = np.array([_COLOURS[letter] for letter in self.cfa]).reshape(2, 2)
        return np.tile(cell, (self.rows // 2, self.cols // 2))


def expose(
    sensor: SimulatedSensor, rng: np.random.Generator, *, light_e_per_s: float, exposure_time_s: float
) -> Frame:
    """Take a frame: Poisson electrons of light and dark, patterns, bend, full well, read noise, rounding.

    y = round(K (min(electrons, full well) + offset + N(0, read noise)) + black), cut at 0 and white
    """
    offset_e, gain = sensor.patterns()
    shape = (sensor.rows, sensor.cols)
    dark_e = sensor.dark_current_e_per_s * exposure_time_s
    mean_e = light_e_per_s * exposure_time_s * sensor.colour() * gain + dark_e
    electrons = np.minimum(rng.poisson(mean_e).astype(np.float64), sensor.full_well_e)
    if sensor.bend_rel:
        span_e = (sensor.white_level_dn - sensor.black_level_dn) / sensor.system_gain_dn_per_e
        electrons *= 1.0 - sensor.bend_rel * electrons / min(span_e, sensor.full_well_e)
    if sensor.compensates_dark:
        electrons -= dark_e
    electrons += offset_e + sensor.read_noise_e * rng.standard_normal(shape)
    signal = np.rint(sensor.system_gain_dn_per_e * electrons + sensor.black_level_dn)
    sites = 1 if sensor.cfa == "grey" else 4
    return Frame(
        samples_dn=np.clip(signal, 0.0, sensor.white_level_dn).astype(np.uint16),
        row0=0,
        col0=0,
        height_px=sensor.rows,
        width_px=sensor.cols,
        cfa=sensor.cfa,
        black_level_dn=(sensor.black_level_dn,) * sites,
        white_level_dn=(sensor.white_level_dn,) * sites,
    )


def describe(sensor: SimulatedSensor) -> FrameHeader:
    """Give the header that such a camera's files have."""
    sites = 1 if sensor.cfa == "grey" else 4
    return FrameHeader(
        container="dng",
        decoder="stilb",
        rendered=False,
        compression="none",
        bits_per_sample=16,
        width_px=sensor.cols,
        height_px=sensor.rows,
        cfa=sensor.cfa,
        black_level_dn=(sensor.black_level_dn,) * sites,
        black_level_origin="tag",
        white_level_dn=(sensor.white_level_dn,) * sites,
        white_level_origin="tag",
        iso=sensor.iso,
        make="stilb",
        model="simulated",
        serial="1",
    )


def make_row(
    sensor: SimulatedSensor, frame: Frame, *, name: str, role: str, exposure_time_s: float
) -> FrameRow:
    """Give a frame as the fit sees it, its whole picture the region."""
    header = describe(sensor)
    corners = [(0, 0), (sensor.cols, 0), (sensor.cols, sensor.rows), (0, sensor.rows)]
    region = Region(name="", polygon=Polygon.from_points(corners))
    extracted = extract_features(frame, [region], header=header)
    return FrameRow(
        frame=name,
        role=role,
        scene=None,
        header=replace(header, exposure_time_s=exposure_time_s, f_number=4.0),
        exposure=Exposure(exposure_time_s=exposure_time_s, f_number=4.0, iso=sensor.iso),
        statistics=extracted.statistics,
        features=extracted.features,
    )


def shoot(
    sensor: SimulatedSensor,
    rng: np.random.Generator,
    *,
    light_e_per_s: float,
    times_s: Sequence[float],
    dark_times_s: Sequence[float],
    frames: int = 2,
) -> tuple[FrameRow, ...]:
    """Take ``frames`` flat and dark frames at each time."""
    return tuple(
        make_row(
            sensor,
            expose(sensor, rng, light_e_per_s=light, exposure_time_s=time),
            name=f"{role}-{sensor.iso:g}-{time:g}-{number}",
            role=role,
            exposure_time_s=time,
        )
        for role, times, light in (("flat", times_s, light_e_per_s), ("dark", dark_times_s, 0.0))
        for time in times
        for number in range(frames)
    )
