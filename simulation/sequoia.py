"""A Parrot Sequoia: four bands with a sensor each, and a sunshine sensor."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

import numpy as np

from radiometry.frame.exposure import Settings
from radiometry.frame.multispectral import Multispectral, RigGeometry, SensorModel, VignettingPolynomial
from simulation.camera import Camera, Shot, Taken, change, take
from simulation.light import Lamp
from simulation.parts import Body, Plane
from simulation.sunshine import SunshineSensor
from simulation.targets import Picture

FULL_SCALE_DN = 65_472.0
# Of 3.9 um; the real one has 3.75. A power of two, so that positions survive the way over millimetres.
PIXELS_PER_MM = 256.0
F_NUMBER = 2.2

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
class Band:
    """True values of a band: its K [1/s], wavelength, sensor model A, B, C and place in the rig."""

    reflectance_k: float
    wavelength_nm: float
    model: SensorModel
    iso: float
    rig_camera_index: int
    rotation_deg: tuple[float, float, float]


def _band(k: float, nm: float, abc: tuple[float, float, float], iso: float, rig: int) -> Band:
    model = SensorModel(a=abc[0], b=abc[1], c=abc[2])
    turned = ((0.0, 0.0, 0.0), (-0.18, -0.12, -0.02), (-0.01, -0.39, 0.05), (-0.43, -0.32, -0.03))[rig]
    return Band(
        reflectance_k=k, wavelength_nm=nm, model=model, iso=iso, rig_camera_index=rig, rotation_deg=turned
    )


BANDS = {
    "green": _band(1300.0, 550.0, (310316.1, 4973.0, 4773.6), 200.0, 0),
    "red": _band(1800.0, 660.0, (280652.5, 4863.1, 2764.2), 320.0, 1),
    "red_edge": _band(1400.0, 735.0, (78630.0, 5078.8, 623.5), 800.0, 2),
    "nir": _band(4300.0, 790.0, (271665.8, 5008.3, 2581.1), 620.0, 3),
}


@dataclass(frozen=True, kw_only=True)
class Sequoia:
    """The camera that its four bands share, the bands, and the sunshine sensor."""

    camera: Camera
    bands: Mapping[str, Band] = field(default_factory=lambda: BANDS)
    sunshine: SunshineSensor = field(default_factory=SunshineSensor)

    def open_band(self, name: str) -> Camera:
        """Return one band as a camera whose light is I_ss [counts/s] and whose target is the reflectance.

        Notes
        -----
        Parrot's sensor model [1]_ p = B + V I (A t S + C) / f^2, with I = R I_ss / K, is a camera of the
        sensitivity A S / (K gain) whose exposures last C / (A S) longer.

        References
        ----------
        .. [1] Parrot, SEQ-AN-01 (sensor calibration model)

        """
        band = self.bands[name]
        scale = band.model.a * band.iso
        return change(
            self.camera,
            sensitivity_e=scale / band.reflectance_k / self.camera.sensor.gain_dn_per_e,
            base_iso=band.iso,
            extra_s=band.model.c / scale,
            black_level_dn=band.model.b,
        )


SEQUOIA = Sequoia(
    camera=change(
        Camera(body=Body(make="Parrot", model="Sequoia", serial="PI040378AA6C000181", software="v1.4.1")),
        height_px=960,
        width_px=1280,
        cfa="grey",
        polynomial=LENS,
        gain_dn_per_e=FULL_SCALE_DN / 6000.0,
        read_noise_e=60.0 * 6000.0 / FULL_SCALE_DN,
        white_level_dn=FULL_SCALE_DN,
        step_dn=64.0,
    )
)


def capture(
    sequoia: Sequoia,
    random: np.random.Generator,
    *,
    reflectance: Mapping[str, float | Plane],
    i_ss: float = 4300.0,
    gain_indices: Sequence[int] = (1,) * 10,
    exposure_time_s: float = 0.003,
    taken_at: datetime = datetime(2018, 4, 13, 8, 0, tzinfo=UTC),
    capture_id: str = "capture",
) -> dict[str, Taken]:
    """Expose all bands of a level surface under one light.

    Parameters
    ----------
    sequoia, random : Sequoia, numpy.random.Generator
        Camera, and source of the noise of the sunshine sensor and then of the pixels, band by band.
    reflectance : Mapping
        Bands to expose; for each one value, or (row, col) for the whole frame.
    i_ss : float
        True light [counts/s at gain index 1].
    gain_indices : sequence of int
        Gain index of each sunshine reading.
    exposure_time_s, taken_at, capture_id : float, datetime, str
        Stated exposure time [s], time and identity of the capture.

    Returns
    -------
    dict
        One photograph per band named in ``reflectance``.

    """
    taken = {}
    for name, surface in reflectance.items():
        counts = sequoia.sunshine.count(i_ss, random, gain_indices=gain_indices)
        exposed_at_us = counts.records[-1].time_us + 140_000 if counts.records else 0
        camera, band = sequoia.open_band(name), sequoia.bands[name]
        shot = Shot(
            frame=name,
            role="",
            settings=Settings(exposure_time_s=exposure_time_s, f_number=F_NUMBER, iso=band.iso),
            lamp=Lamp(luminance_cd_m2=i_ss),
            target=Picture(surface),
        )
        exposed = take(camera, shot, random)
        header = replace(
            exposed.header,
            container="tiff",
            white_level_origin="camera",
            taken_at=taken_at.isoformat(),
            software=camera.body.software,
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
                sunshine_serial=sequoia.sunshine.sunshine_serial,
                counts=counts,
                exposed_at_us=exposed_at_us,
                geometry=RigGeometry(
                    model="fisheye",
                    principal_point_px=(camera.sensor.width_px / 2.0, camera.sensor.height_px / 2.0),
                    fisheye_affine=(1657.9, 0.0, 0.0, 1657.9),
                    fisheye_polynomial=(0.0, 1.0, 0.01, -0.14),
                    rotation_deg=band.rotation_deg,
                    pixels_per_mm=(PIXELS_PER_MM, PIXELS_PER_MM),
                ),
            ),
        )
        taken[name] = replace(exposed, header=header)
    return taken
