"""A Sequoia with its sunshine sensor, the panel's card, and flights with it."""

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from datetime import UTC, datetime
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from radiometry.frame import exposure, multispectral, roi
from radiometry.records import Record
from radiometry.reflectance.sun import Tilt, level_factor, sun_angle_deg
from radiometry.reflectance.sunshine import SATURATED_COUNT
from simulation.camera import Body, Camera, Lamp, Plane, Shot, Taken, change, take
from simulation.targets import Picture

_STEP_US = 200_000
_TABLE_TIME_S = 0.6
_INTEGRATION_S = 0.1


class SunshineSensor(Record):
    """A sensor beside the camera that looks up."""

    sunshine_serial: str = "PI040379AA6E000358"
    gains: tuple[float, ...] = (0.0345, 1.0, 12.1, 145.0)  # True gains by index, relative to index 1
    table_counts: int = 3300  # CH0 of row 1 of the gain table
    sunshine_noise_rel: float = 0.01  # Relative standard deviation of one reading
    # Yaw, pitch and roll, which its records state [deg]
    attitude_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    # Sun and diffuser, for a reading that depends on the attitude; None: it does not
    tilt: Tilt | None = None

    def count(
        self, i_ss: float, random: np.random.Generator, *, gain_indices: Sequence[int]
    ) -> multispectral.SunshineCounts:
        """Draw readings 0.2 s apart of a light ``i_ss`` [counts/s at gain index 1]: whole, 65535 at most."""
        yaw, pitch, roll = self.attitude_deg
        if self.tilt is not None:
            angle = sun_angle_deg(self.tilt.sun, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
            i_ss /= level_factor(angle, self.tilt)
        records = []
        for number, index in enumerate(gain_indices):
            counts = self.gains[index] * i_ss * (1.0 + self.sunshine_noise_rel * random.standard_normal())
            records.append(
                multispectral.SunshineRecord(
                    time_us=100_000_000 + number * _STEP_US,
                    ch0=_whole(_INTEGRATION_S * counts),
                    ch1=_whole(_INTEGRATION_S * counts / 5.0),
                    gain_index=index,
                    integration_time_s=_INTEGRATION_S,
                    yaw_deg=yaw,
                    pitch_deg=pitch,
                    roll_deg=roll,
                )
            )
        table = tuple(
            multispectral.GainMeasurement(
                gain_index=index,
                integration_time_s=_TABLE_TIME_S,
                ch0=_whole(self.table_counts * gain),
                ch1=_whole(self.table_counts * gain / 4.0),
            )
            for index, gain in enumerate(self.gains)
        )
        return multispectral.SunshineCounts(
            record_bytes=28, cut_short=False, records=tuple(records), gains=table
        )


def _whole(counts: float) -> int:
    return round(min(counts, float(SATURATED_COUNT)))


_CARD_SIDES = 1.4  # white around the code
_SUBPIXEL_BITS = 4

Corners = NDArray[np.float32]


class Card(Record):
    """A MicaSense panel with its QR code on the ground."""

    text: str  # Text of the code: the panel's serial number
    # Affine map (2, 3) from sides of the code, about its centre, to pixels (x, y)
    pose: Plane = field(default_factory=lambda: np.array([[100.0, 0.0, 320.0], [0.0, 100.0, 240.0]]))
    way: tuple[int, int] = (1, 0)  # Direction from the code to the panel, in the code's own axes
    # Distance between the centres of code and panel, and side of the panel, in sides of the code
    distance: float = 1.68
    side: float = 1.30
    ground: float = 0.12  # Tones; shares of the lamp's luminance where a camera photographs the card
    ink: float = 0.10
    panel: float = 0.50
    paper: float = 0.60

    @property
    def panel_corners(self) -> Corners:
        """Corners (x, y) of the panel [px]."""
        return self._place(self.distance * np.array(self.way), self.side)

    def _place(self, centre: Plane | tuple[float, float], side: float) -> Corners:
        square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * side / 2.0 + centre
        return np.asarray(square @ self.pose[:, :2].T + self.pose[:, 2], np.float32)

    def paint(self, picture: Plane) -> None:
        """Paint card, code and panel over a picture, (row, col)."""
        fill(picture, self._place((0.0, 0.0), _CARD_SIDES), self.paper)
        modules = np.asarray(cv2.QRCodeEncoder.create().encode(self.text))
        modules = modules[2:-2, 2:-2] if modules[1].min() == 255 else modules  # without the rim
        count = modules.shape[0]
        for row, col in np.argwhere(modules < 128):
            centre = ((col + 0.5) / count - 0.5, (row + 0.5) / count - 0.5)
            fill(picture, self._place(centre, 1.0 / count), self.ink)
        fill(picture, self.panel_corners, self.panel)

    def draw(self, camera: Camera, window: roi.Window) -> Plane:
        picture = np.full((camera.sensor.height_px, camera.sensor.width_px), self.ground)
        self.paint(picture)
        return Picture(picture).draw(camera, window)


def fill(picture: Plane, corners: Corners, tone: float) -> None:
    """Fill a convex polygon to a sixteenth of a pixel; a corner (x, y) counts from the picture's own."""
    places = np.round((corners - 0.5) * (1 << _SUBPIXEL_BITS)).astype(np.int32)
    cv2.fillConvexPoly(picture, places, tone, shift=_SUBPIXEL_BITS)


FULL_SCALE_DN = 65_472.0
# Of 3.9 um; the real one has 3.75. A power of two, so that positions survive the way over millimetres.
PIXELS_PER_MM = 256.0
F_NUMBER = 2.2

# A real lens's polynomial, as Parrot's forum published it.
LENS = multispectral.VignettingPolynomial(
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


class Band(Record):
    """True values of a band: its K [1/s], wavelength, sensor model A, B, C and place in the rig."""

    reflectance_k: float
    wavelength_nm: float
    model: multispectral.SensorModel
    iso: float
    rig_camera_index: int
    rotation_deg: tuple[float, float, float]


def _band(k: float, nm: float, abc: tuple[float, float, float], iso: float, rig: int) -> Band:
    model = multispectral.SensorModel(a=abc[0], b=abc[1], c=abc[2])
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


class Sequoia(Record):
    """The camera that its four bands share, the bands, and the sunshine sensor."""

    camera: Camera
    bands: Mapping[str, Band] = field(default_factory=lambda: BANDS)
    sunshine: SunshineSensor = field(default_factory=SunshineSensor)

    def open_band(self, name: str) -> Camera:
        """Return one band as a camera whose light is I_ss [counts/s] and whose target is the reflectance.

        Parrot's sensor model [1] p = B + V I (A t S + C) / f^2, with I = R I_ss / K, is a camera of the
        sensitivity A S / (K gain) whose exposures last C / (A S) longer.

        [1] Parrot, SEQ-AN-01 (sensor calibration model)
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
    """Expose bands under one light [counts/s at gain index 1]; a reflectance is a value or (row, col)."""
    taken = {}
    for name, surface in reflectance.items():
        counts = sequoia.sunshine.count(i_ss, random, gain_indices=gain_indices)
        exposed_at_us = counts.records[-1].time_us + 140_000 if counts.records else 0
        camera, band = sequoia.open_band(name), sequoia.bands[name]
        shot = Shot(
            frame=name,
            role="",
            settings=exposure.Settings(exposure_time_s=exposure_time_s, f_number=F_NUMBER, iso=band.iso),
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
            multispectral=multispectral.Multispectral(
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
                geometry=multispectral.RigGeometry(
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


Change = Literal["none", "walk", "ramp", "step", "light"]

_HALF_HOUR_S = 1800.0
_SETTLING_S = 300.0


def draw_change(
    random: np.random.Generator, times_s: Sequence[float], *, kind: Change, size_rel: float
) -> NDArray[np.float64]:
    """Draw ln K against its mean at rising times.

    "walk": a random walk of the sensor; "ramp": a steady drift; "step": a jump at a random time; "light":
    errors of the light that are forgotten in five minutes. ``size_rel`` is the standard deviation of the
    change in half an hour (walk, ramp), of the jump, or of the light.
    """
    at = np.asarray(times_s, dtype=np.float64)
    steps_s = np.diff(at, prepend=at[0])
    noise = random.standard_normal(at.size)
    if kind == "walk":
        return np.asarray(np.cumsum(noise * size_rel * np.sqrt(steps_s / _HALF_HOUR_S)))
    if kind == "ramp":
        return np.asarray(noise[0] * size_rel * (at - at[0]) / _HALF_HOUR_S)
    if kind == "step":
        return np.asarray(noise[0] * size_rel * (at > random.uniform(at[0], at[-1])))
    if kind == "light":
        kept = np.exp(-steps_s / _SETTLING_S)
        error = noise * size_rel
        for each in range(1, at.size):
            error[each] = kept[each] * error[each - 1] + np.sqrt(1.0 - kept[each] ** 2) * error[each]
        return np.asarray(error)
    return np.zeros(at.size)
