"""A simulated Sequoia whose true K and true surface are known, for tests and for the demonstration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.multispectral import (
    GainMeasurement,
    Multispectral,
    RigGeometry,
    SensorModel,
    SunshineCounts,
    SunshineRecord,
    VignettingPolynomial,
)
from radiometry.frame.roi import Window
from radiometry.reflectance.gains import SATURATED_COUNT
from radiometry.reflectance.lens import FrameSize, evaluate_polynomial

FULL_SCALE_DN = 65_472.0
# Of 3.9 um; the real one has 3.75. A power of two, so that positions survive the way over millimetres.
PIXELS_PER_MM = 256.0
_STEP_DN = 64.0
_STEP_US = 200_000
_TABLE_TIME_S = 0.6

# A real lens's polynomial, as Parrot's forum published it.
LENS = VignettingPolynomial(
    exponents=(
        *((power, 0) for power in range(5)),
        *((0, power) for power in range(1, 5)),
        *((1, 1), (1, 2), (1, 3), (2, 1), (2, 2), (3, 1)),
    ),
    coefficients=(
        *(0.7147839124238495, 1.0868966926036208, -1.9469658650960013, 1.7594973911304057),
        *(-0.8592142982034272, 0.4226179922616180, -0.5406863759565294, 0.2053832247808616),
        *(-0.1377541142380952, -0.7764416022112121, 0.8026039825428949, 0.0564412856216702),
        *(0.7468816658602367, -0.9151781384546372, 0.0716926129389081),
    ),
)


@dataclass(frozen=True, kw_only=True)
class SimulatedBand:
    """What is true of a band: its K [1/s], wavelength and sensor."""

    reflectance_k: float
    wavelength_nm: float
    model: SensorModel
    iso: float
    rig_camera_index: int
    rotation_deg: tuple[float, float, float]


def _band(k: float, nm: float, abc: tuple[float, float, float], iso: float, rig: int) -> SimulatedBand:
    model = SensorModel(a=abc[0], b=abc[1], c=abc[2])
    turned = ((0.0, 0.0, 0.0), (-0.18, -0.12, -0.02), (-0.01, -0.39, 0.05), (-0.43, -0.32, -0.03))[rig]
    return SimulatedBand(
        reflectance_k=k, wavelength_nm=nm, model=model, iso=iso, rig_camera_index=rig, rotation_deg=turned
    )


BANDS = {
    "green": _band(1300.0, 550.0, (310316.1, 4973.0, 4773.6), 200.0, 0),
    "red": _band(1800.0, 660.0, (280652.5, 4863.1, 2764.2), 320.0, 1),
    "red_edge": _band(1400.0, 735.0, (78630.0, 5078.8, 623.5), 800.0, 2),
    "nir": _band(4300.0, 790.0, (271665.8, 5008.3, 2581.1), 620.0, 3),
}


@dataclass(frozen=True, kw_only=True)
class SimulatedSequoia:
    """A camera and its sunshine sensor.

    ``gains`` : true gains by index, relative to index 1; ``table_counts`` : CH0 of the gain table's row 1
    ``read_noise_dn`` : of a pixel; ``electrons_at_full_scale`` : how many make the brightest number
    ``sunshine_noise_rel`` : of one sunshine reading
    """

    bands: Mapping[str, SimulatedBand] = field(default_factory=lambda: BANDS)
    height_px: int = 960
    width_px: int = 1280
    camera_serial: str = "PI040378AA6C000181"
    sunshine_serial: str = "PI040379AA6E000358"
    gains: tuple[float, ...] = (0.0345, 1.0, 12.1, 145.0)
    table_counts: int = 3300
    read_noise_dn: float = 60.0
    electrons_at_full_scale: float = 6000.0
    sunshine_noise_rel: float = 0.01


@dataclass(frozen=True, kw_only=True)
class SimulatedFrame:
    """One band's file: header and all of its pixels."""

    header: FrameHeader
    frame: Frame
    exposure: Exposure


def simulate_sequoia_capture(
    camera: SimulatedSequoia,
    random: np.random.Generator,
    *,
    reflectance: Mapping[str, float | NDArray[np.float64]],
    i_ss: float = 4300.0,
    gain_indices: Sequence[int] = (1,) * 10,
    exposure_time_s: float = 0.003,
    taken_at: datetime = datetime(2018, 4, 13, 8, 0, tzinfo=UTC),
    capture_id: str = "capture",
) -> dict[str, SimulatedFrame]:
    """Expose all bands of a level surface under one light.

    I_sq = R I_ss / K,  p = B + V I_sq (A eps gamma + C) / f^2 with photon and read noise, in steps of 64, cut
    off at full scale; a reading counts CH0 = g_true tau I_ss with its noise, in whole numbers up to 65535.

    Takes
      reflectance : per band one value, or (row, col) for the whole frame
      i_ss : true light [counts/s at gain index 1]; gain_indices : of the sunshine readings, 0.2 s apart
    Returns one frame per band named in ``reflectance``
    """
    f_number = 2.2
    frames = {}
    for name, surface in reflectance.items():
        band = camera.bands[name]
        exposure = Exposure(exposure_time_s=exposure_time_s, f_number=f_number, iso=band.iso)
        response = (band.model.a * exposure_time_s * band.iso + band.model.c) / f_number**2
        light_dn = np.asarray(surface) * (i_ss / band.reflectance_k) * response
        frames[name] = SimulatedFrame(
            header=_head(
                camera,
                name,
                exposure,
                taken_at=taken_at,
                capture_id=capture_id,
                counts=_count_sunshine(camera, random, i_ss=i_ss, gain_indices=gain_indices),
            ),
            frame=_expose(camera, random, light_dn=light_dn, black_dn=band.model.b),
            exposure=exposure,
        )
    return frames


def _expose(
    camera: SimulatedSequoia,
    random: np.random.Generator,
    *,
    light_dn: NDArray[np.float64],
    black_dn: float,
) -> Frame:
    size = FrameSize(height_px=camera.height_px, width_px=camera.width_px)
    window = Window(row0=0, col0=0, height=camera.height_px, width=camera.width_px)
    light = light_dn * evaluate_polynomial(LENS, window, size=size)
    dn_per_electron = FULL_SCALE_DN / camera.electrons_at_full_scale
    shot_dn = np.sqrt(np.maximum(light, 0.0) * dn_per_electron)
    noise_dn = np.hypot(shot_dn, camera.read_noise_dn) * random.standard_normal(light.shape)
    numbers = np.round((black_dn + light + noise_dn) / _STEP_DN) * _STEP_DN
    return Frame(
        samples_dn=np.clip(numbers, 0.0, FULL_SCALE_DN).astype(np.uint16),
        row0=0,
        col0=0,
        height_px=camera.height_px,
        width_px=camera.width_px,
        cfa="grey",
        black_level_dn=(black_dn,),
        white_level_dn=(FULL_SCALE_DN,),
    )


def _count_sunshine(
    camera: SimulatedSequoia, random: np.random.Generator, *, i_ss: float, gain_indices: Sequence[int]
) -> SunshineCounts:
    records = []
    for number, index in enumerate(gain_indices):
        noise = 1.0 + camera.sunshine_noise_rel * random.standard_normal()
        records.append(
            SunshineRecord(
                time_us=100_000_000 + number * _STEP_US,
                ch0=_whole(camera.gains[index] * 0.1 * i_ss * noise),
                ch1=_whole(camera.gains[index] * 0.02 * i_ss * noise),
                gain_index=index,
                integration_time_s=0.1,
                yaw_deg=0.0,
                pitch_deg=0.0,
                roll_deg=0.0,
            )
        )
    table = tuple(
        GainMeasurement(
            gain_index=index,
            integration_time_s=_TABLE_TIME_S,
            ch0=_whole(camera.table_counts * gain),
            ch1=_whole(camera.table_counts * gain / 4.0),
        )
        for index, gain in enumerate(camera.gains)
    )
    return SunshineCounts(record_bytes=28, cut_short=False, records=tuple(records), gains=table)


def _whole(counts: float) -> int:
    return round(min(counts, float(SATURATED_COUNT)))


def _head(
    camera: SimulatedSequoia,
    name: str,
    exposure: Exposure,
    *,
    taken_at: datetime,
    capture_id: str,
    counts: SunshineCounts,
) -> FrameHeader:
    band = camera.bands[name]
    exposed_at = (
        timedelta(microseconds=counts.records[-1].time_us + 140_000) if counts.records else timedelta()
    )
    return FrameHeader(
        container="tiff",
        decoder="stilb",
        rendered=False,
        compression="none",
        bits_per_sample=16,
        width_px=camera.width_px,
        height_px=camera.height_px,
        cfa="grey",
        black_level_dn=(band.model.b,),
        black_level_origin="tag",
        white_level_dn=(FULL_SCALE_DN,),
        white_level_origin="camera",
        exposure_time_s=exposure.exposure_time_s,
        f_number=exposure.f_number,
        iso=exposure.iso,
        make="Parrot",
        model="Sequoia",
        serial=camera.camera_serial,
        taken_at=taken_at.isoformat(),
        software="v1.4.1",
        latitude_deg=50.85,
        longitude_deg=4.35,
        multispectral=Multispectral(
            system="sequoia",
            band=name,
            band_name=name,
            wavelength_nm=band.wavelength_nm,
            rig_camera_index=band.rig_camera_index,
            capture_id=capture_id,
            full_scale_dn=FULL_SCALE_DN,
            sensor_model=band.model,
            vignetting_polynomial=LENS,
            sunshine_serial=camera.sunshine_serial,
            counts=counts,
            exposed_at_us=int(exposed_at.total_seconds() * 1e6),
            geometry=RigGeometry(
                model="fisheye",
                principal_point_px=(camera.width_px / 2.0, camera.height_px / 2.0),
                fisheye_affine=(1657.9, 0.0, 0.0, 1657.9),
                fisheye_polynomial=(0.0, 1.0, 0.01, -0.14),
                rotation_deg=band.rotation_deg,
                pixels_per_mm=(PIXELS_PER_MM, PIXELS_PER_MM),
            ),
        ),
    )
