"""Lamps, a camera of parts, and the chain that exposes it."""

import math
from collections.abc import Mapping
from dataclasses import asdict, field, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from radiometry.frame import Frame, FrameHeader, roi
from radiometry.frame.exposure import Exposure, Settings
from radiometry.frame.multispectral import VignettingPolynomial
from radiometry.geometry.camera import CameraModel
from radiometry.records import Record
from radiometry.reflectance.imaging import FrameSize, evaluate_polynomial
from radiometry.vignetting.blocks import Grid
from radiometry.vignetting.falloff import evaluate_curve

Band = tuple[float, float]  # centre and full width at half maximum of a Gaussian response [nm]

ILLUMINANT_A_K = 2856.0
LUMINOUS_EFFICIENCY: Band = (555.0, 100.0)
_WAVELENGTHS_NM = np.arange(380.0, 781.0, 2.0)
_C2_NM_K = 1.438776877e7


def compute_mismatch(band: Band, *, temperature_k: float) -> float:
    """Compute the spectral mismatch of a detector calibrated under illuminant A: indicated over true.

    m = (int P_T s / int P_T V) / (int P_A s / int P_A V), with P_T the spectrum of a black body and s a
    Gaussian of a centre and a full width at half maximum [nm] [1]. V is a Gaussian of 555 nm and 100 nm here:
    close to V(lambda), and exact for what is simulated.

    [1] ISO/CIE 19476:2014
    """

    def respond(kelvin: float, detector: Band) -> float:
        spectrum = _WAVELENGTHS_NM**-5 / np.expm1(_C2_NM_K / (_WAVELENGTHS_NM * kelvin))
        offset = (_WAVELENGTHS_NM - detector[0]) / detector[1]
        return float(np.sum(spectrum * np.exp(-4.0 * math.log(2.0) * offset**2)))

    return (respond(temperature_k, band) / respond(temperature_k, LUMINOUS_EFFICIENCY)) / (
        respond(ILLUMINANT_A_K, band) / respond(ILLUMINANT_A_K, LUMINOUS_EFFICIENCY)
    )


class Lamp(Record):
    """Light on the target."""

    luminance_cd_m2: float  # Luminance of the target where its share is 1 [cd/m2]
    drift_rel_per_s: float = 0.0  # Relative change of the luminance [1/s]
    # Temperature of the Planckian spectrum [K]; cameras and meters are calibrated at 2856 K
    temperature_k: float = ILLUMINANT_A_K

    def shine(self, after_s: float) -> float:
        """Return the luminance after a time [cd/m2]."""
        return self.luminance_cd_m2 * (1.0 + self.drift_rel_per_s * after_s)


class Meter(Record):
    """Luminance or illuminance meter."""

    scale: float = 1.0  # Indicated over true value: the error that all its readings share
    repeatability: float = 0.0  # Relative standard deviation of a reading
    band: Band = LUMINOUS_EFFICIENCY  # Spectral response; it counts where a lamp is not illuminant A

    def read(
        self, value: float, random: np.random.Generator, *, temperature_k: float = ILLUMINANT_A_K
    ) -> float:
        """Draw a reading of a true value."""
        scale = self.scale * compute_mismatch(self.band, temperature_k=temperature_k)
        return float(value * scale * random.normal(1.0, self.repeatability))


Plane = NDArray[np.float64]


class Body(Record):
    """Names that the files of a camera state."""

    make: str = "DJI"
    model: str = "FC6520"
    serial: str = "0K8TF1A0010042"
    software: str = "v02.00.0106"
    lens_make: str = "DJI"
    lens_model: str = "DJI MFT 15mm F1.7 ASPH"
    lens_serial: str = "L0042"
    focal_length_mm: float = 15.0
    pixel_pitch_um: float = 3.28


class Lens(Record):
    """Lens between the target and the sensor."""

    # True over nominal f-number, by nominal f-number; 1 where none is listed
    f_number_errors: Mapping[float, float] = field(default_factory=dict)
    transmission: float = 1.0  # Share of the light that passes on the axis
    # k1, k2, k3 of V(r) = 1 + k1 r^2 + k2 r^4 + k3 r^6 by f-number, and for f-numbers that are not listed;
    # r is 1 half a diagonal from the centre
    falloffs: Mapping[float, tuple[float, float, float]] = field(default_factory=dict)
    falloff: tuple[float, float, float] = (0.0, 0.0, 0.0)
    # Row and column of the falloff's centre [px]; None: the middle of the frame
    centre_px: tuple[float, float] | None = None
    polynomial: VignettingPolynomial | None = None  # V(x, y) as Sequoia files state it, in place of V(r)
    # Standard deviation of a Gaussian point spread function [px]; edges and stars have their own blur
    blur_px: float = 0.0
    # Share of the light that is scattered evenly over the window (veiling glare, ISO 9358:1994)
    stray_share: float = 0.0
    # Focal length, principal point and distortion; only views of boards ask for it
    projection: CameraModel | None = None
    # Those of red and blue, by letter, where a colour has its own (lateral chromatic aberration)
    projections: Mapping[str, CameraModel] = field(default_factory=dict)

    def scatter(self, light: Plane) -> Plane:
        """Blur an image and lay stray light over it."""
        if self.blur_px > 0.0:
            light = np.asarray(cv2.GaussianBlur(light, (0, 0), self.blur_px), np.float64)
        if self.stray_share > 0.0:
            light = (1.0 - self.stray_share) * light + self.stray_share * float(np.mean(light))
        return light


class Shutter(Record):
    """Shutter with errors of its nominal times."""

    # True over nominal exposure time, by nominal time; 1 where none is listed
    time_errors: Mapping[float, float] = field(default_factory=dict)
    extra_s: float = 0.0  # Time that adds to every exposure [s]


class Sensor(Record):
    """Image sensor; patterns from pixel to pixel are fixed by ``seed`` and the same in every window."""

    height_px: int = 96
    width_px: int = 96
    cfa: str = "RGGB"  # "RGGB" or another order, "grey", or "rgb" for three planes
    # Sensitivity of each colour relative to the strongest
    colours: Mapping[str, float] = field(default_factory=lambda: {"R": 0.55, "G": 1.0, "B": 0.7})
    # Spectral response of each colour; it counts where a lamp is not illuminant A
    bands_nm: Mapping[str, Band] = field(
        default_factory=lambda: {"R": (600.0, 80.0), "G": (535.0, 90.0), "B": (465.0, 70.0)}
    )
    sensitivity_e: float = 22_000.0  # Electrons of the strongest colour for 1 cd/m2, 1 s, f/1 [e m2/(cd s)]
    gain_dn_per_e: float = 0.5  # System gain at ``base_iso`` [DN/e]; it is proportional to the ISO value
    base_iso: float = 100.0
    read_noise_e: float = 0.0  # Standard deviation of the read noise and largest number of electrons [e]
    full_well_e: float = math.inf
    # Electrons without light [e/s]; with ``compensates_dark`` their mean is subtracted, their noise stays
    dark_current_e_s: float = 0.0
    compensates_dark: bool = False
    row_noise_e: float = 0.0  # Standard deviation of what the pixels of a row share in one readout [e]
    # Standard deviation of the dark offsets [e] and of the relative sensitivities of pixels
    dsnu_e: float = 0.0
    prnu_rel: float = 0.0
    bend_rel: float = 0.0  # Share that the signal loses at white or at the full well, in proportion below
    photon_noise: bool = True  # False: every exposure collects the mean number of electrons
    black_level_dn: float = 256.0
    white_level_dn: float = 4095.0
    step_dn: float = 1.0  # Digital numbers are multiples of this [DN]
    seed: int = 0

    @property
    def sites(self) -> int:
        """Number of CFA sites or planes that have levels of their own."""
        return {"grey": 1, "rgb": 3}.get(self.cfa, 4)

    def gain(self, iso: float) -> float:
        """Return the system gain at an ISO value [DN/e]."""
        return self.gain_dn_per_e * iso / self.base_iso

    def filter_light(self, window: roi.Window, *, temperature_k: float = ILLUMINANT_A_K) -> Plane:
        """Return the relative sensitivity of each pixel, (row, col) or (row, col, plane)."""
        if self.cfa == "grey":
            return np.ones((window.height, window.width))
        letters = "RGB" if self.cfa == "rgb" else self.cfa
        strengths = np.array([self.colours[one] for one in letters])
        if temperature_k != ILLUMINANT_A_K:
            strengths *= [
                compute_mismatch(self.bands_nm[one], temperature_k=temperature_k) for one in letters
            ]
        if self.cfa == "rgb":
            return np.broadcast_to(strengths, (window.height, window.width, 3))
        rows = np.arange(window.row0, window.row0 + window.height) % 2
        cols = np.arange(window.col0, window.col0 + window.width) % 2
        return strengths.reshape(2, 2)[rows[:, None], cols[None, :]]

    def pick(self, light: Plane, window: roi.Window) -> Plane:
        """Return the light of each site's own colour, (row, col), from that of all three, (row, col, 3)."""
        rows = np.arange(window.row0, window.row0 + window.height) % 2
        cols = np.arange(window.col0, window.col0 + window.width) % 2
        wanted = np.array(["RGB".index(one) for one in self.cfa]).reshape(2, 2)[rows[:, None], cols[None, :]]
        return np.take_along_axis(light, wanted[:, :, None], axis=2)[:, :, 0]

    def pattern(self, window: roi.Window, *, dark: bool = False) -> Plane | float:
        """Return a relative sensitivity of each pixel, or its dark offset [e]; (row, col)."""
        size = self.dsnu_e if dark else self.prnu_rel
        if not size:
            return 0.0 if dark else 1.0
        rows = [
            np.random.default_rng([self.seed, row, 1] if dark else [self.seed, row])
            .standard_normal(self.width_px)[window.col0 : window.col0 + window.width]
            for row in range(window.row0, window.row0 + window.height)
        ]  # fmt: skip
        pattern = size * np.array(rows) if dark else 1.0 + size * np.array(rows)
        return pattern[:, :, None] if self.cfa == "rgb" else pattern

    def read_out(
        self, mean_e: Plane, random: np.random.Generator, *, window: roi.Window, dark_e: float, iso: float
    ) -> NDArray[np.uint16]:
        """Draw the digital numbers of pixels that collect a mean number of electrons.

        The linear camera of EMVA 1288 [1], with full well Q, bend b, fixed offsets o and rounding to steps::

            e = min(Poisson(mean), Q) (1 - b min(Poisson(mean), Q) / Q_white)
            y = clip(round(gain (e + o + read noise N(0, 1) + row noise N(0, 1)) + black), 0, white)

        [1] EMVA Standard 1288, release 4.0 (2021)
        """
        gain = self.gain(iso)
        electrons = np.minimum(random.poisson(mean_e) if self.photon_noise else mean_e, self.full_well_e)
        if self.bend_rel:
            white_e = min((self.white_level_dn - self.black_level_dn) / gain, self.full_well_e)
            electrons = electrons * (1.0 - self.bend_rel * electrons / white_e)
        offset_e = self.pattern(window, dark=True) - (dark_e if self.compensates_dark else 0.0)
        electrons = electrons + offset_e + self.read_noise_e * random.standard_normal(mean_e.shape)
        if self.row_noise_e:
            shared = random.standard_normal((mean_e.shape[0], *(1,) * (mean_e.ndim - 1)))
            electrons = electrons + self.row_noise_e * shared
        steps = np.round((self.black_level_dn + gain * electrons) / self.step_dn)
        return np.clip(steps * self.step_dn, 0.0, self.white_level_dn).astype(np.uint16)


if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Whole = TypeVar("Whole", bound="DataclassInstance")


def change(whole: Whole, **changes: Any) -> Whole:  # noqa: ANN401  of any field
    """Return a copy with fields replaced, in whichever of its parts they are."""
    mine: dict[str, Any] = {}
    for name, part in _list_fields(whole).items():
        inner = {key: changes.pop(key) for key in list(changes) if name != key and key in _list_names(part)}
        if name in changes:
            mine[name] = changes.pop(name)
        elif inner:
            mine[name] = change(part, **inner)
    if changes:
        raise TypeError(f"no part of {type(whole).__name__} has {', '.join(changes)}")
    return replace(whole, **mine)


def _list_fields(part: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return the fields of a part of the simulation; those of foreign dataclasses are values."""
    ours = type(part).__module__.startswith("simulation.") and is_dataclass(part)
    return {each.name: getattr(part, each.name) for each in fields(part)} if ours else {}


def _list_names(part: Any) -> set[str]:  # noqa: ANN401
    own = _list_fields(part)
    return own.keys() | {name for inner in own.values() for name in _list_names(inner)}


class Camera(Record):
    """A camera of parts."""

    body: Body = field(default_factory=Body)
    lens: Lens = field(default_factory=Lens)
    shutter: Shutter = field(default_factory=Shutter)
    sensor: Sensor = field(default_factory=Sensor)

    @property
    def window(self) -> roi.Window:
        return roi.Window(row0=0, col0=0, height=self.sensor.height_px, width=self.sensor.width_px)

    @property
    def centre_px(self) -> tuple[float, float]:
        """Row and column of the falloff's centre [px]."""
        return self.lens.centre_px or Grid.over(self.sensor.height_px, self.sensor.width_px).middle_px

    def share(self, f_number: float, window: roi.Window | None = None) -> Plane:
        """Return the share V of the light that the lens passes to each pixel, (row, col)."""
        window, sensor, lens = window or self.window, self.sensor, self.lens
        if lens.polynomial is not None:
            size = FrameSize(height_px=sensor.height_px, width_px=sensor.width_px)
            return evaluate_polynomial(lens.polynomial, window, size=size)
        rows = np.arange(window.row0, window.row0 + window.height) - self.centre_px[0]
        cols = np.arange(window.col0, window.col0 + window.width) - self.centre_px[1]
        radius = Grid.over(sensor.height_px, sensor.width_px).half_diagonal_px
        squared = (rows[:, None] ** 2 + cols[None, :] ** 2) / radius**2
        return evaluate_curve(squared, lens.falloffs.get(f_number, lens.falloff))

    def set_truly(self, nominal: Settings) -> Settings:
        """Return the true settings behind nominal ones."""
        time_s, f_number = nominal.exposure_time_s, nominal.f_number
        return Settings(
            exposure_time_s=time_s * self.shutter.time_errors.get(time_s, 1.0) + self.shutter.extra_s,
            f_number=f_number * self.lens.f_number_errors.get(f_number, 1.0),
            iso=nominal.iso,
        )

    def collect(self, settings: Settings, *, luminance_cd_m2: float = 1.0) -> float:
        """Return the mean electrons of the strongest colour on the axis, E = T q t L / f^2 [e]."""
        true = self.set_truly(settings)
        rate_e_s = self.lens.transmission * self.sensor.sensitivity_e * luminance_cd_m2 / true.f_number**2
        return rate_e_s * true.exposure_time_s

    def find_luminance(self, signal_dn: float, settings: Settings) -> float:
        """Return the luminance [cd/m2] that gives a signal above black on the axis [DN]."""
        return signal_dn / self.sensor.gain(settings.iso) / self.collect(settings)

    def describe(self, settings: Settings | None = None) -> FrameHeader:
        """Return the header that a decoder reads from this camera's files."""
        sensor = self.sensor
        return FrameHeader(
            container="dng",
            decoder="stilb",
            rendered=sensor.cfa == "rgb",
            compression="none",
            bits_per_sample=16,
            width_px=sensor.width_px,
            height_px=sensor.height_px,
            cfa=sensor.cfa,
            black_level_dn=(sensor.black_level_dn,) * sensor.sites,
            black_level_origin="tag",
            white_level_dn=(sensor.white_level_dn,) * sensor.sites,
            white_level_origin="tag",
            exposure_time_s=settings.exposure_time_s if settings else None,
            f_number=settings.f_number if settings else None,
            iso=settings.iso if settings else None,
            make=self.body.make,
            model=self.body.model,
            serial=self.body.serial,
        )


class Target(Protocol):
    """Anything that can be photographed."""

    def draw(self, camera: Camera, window: roi.Window) -> Plane:
        """Return the share of the lamp's luminance: (row, col), (row, col, colour), or one for all."""


def expose(
    camera: Camera,
    target: Target,
    lamp: Lamp,
    settings: Settings,
    random: np.random.Generator,
    *,
    window: roi.Window | None = None,
    after_s: float = 0.0,
) -> Frame:
    """Photograph a target at nominal settings, ``after_s`` after the lamp had its luminance [s].

    The mean number of electrons of a pixel, with the true settings t and f, is::

        e = T q t L / f^2 * scatter(share) * V * colour * (1 + PRNU) + dark current * t

    ``Sensor.read_out`` makes digital numbers of it, black not subtracted, of the window or the whole frame.
    """
    sensor, window = camera.sensor, window or camera.window
    centre_e = camera.collect(settings, luminance_cd_m2=lamp.shine(after_s))
    light = np.asarray(target.draw(camera, window))
    light = np.broadcast_to(light, (window.height, window.width, *light.shape[2:]))
    share = camera.share(settings.f_number, window)
    light = centre_e * camera.lens.scatter(light) * (share[:, :, None] if light.ndim == 3 else share)
    if light.ndim == 3 and sensor.cfa != "rgb":
        light = sensor.pick(light, window)
    colour = sensor.filter_light(window, temperature_k=lamp.temperature_k)
    mean_e = (
        (light[:, :, None] if sensor.cfa == "rgb" and light.ndim == 2 else light)
        * colour
        * sensor.pattern(window)
    )
    dark_e = sensor.dark_current_e_s * camera.set_truly(settings).exposure_time_s
    samples = sensor.read_out(mean_e + dark_e, random, window=window, dark_e=dark_e, iso=settings.iso)
    return Frame(
        samples_dn=samples,
        row0=window.row0,
        col0=window.col0,
        height_px=sensor.height_px,
        width_px=sensor.width_px,
        cfa=sensor.cfa,
        black_level_dn=(sensor.black_level_dn,) * sensor.sites,
        white_level_dn=(sensor.white_level_dn,) * sensor.sites,
    )


class Shot(Record):
    """One photograph to take."""

    frame: str  # Its name, its role in a campaign, and the light level that it shows
    role: str
    settings: Settings
    lamp: Lamp
    target: Target
    scene: str | None = None
    window: roi.Window | None = None  # Part of the frame to read out; the whole frame if None
    # Rows that are exposed together, for even surfaces of many megapixels; all if None
    rows_at_once: int | None = None
    after_s: float = 0.0  # Time since the lamp had its luminance [s]


class Taken(Record):
    """A photograph: name, role, header, settings and all of its pixels."""

    name: str
    role: str
    header: FrameHeader
    exposure: Exposure
    frame: Frame


def take(camera: Camera, shot: Shot, random: np.random.Generator) -> Taken:
    """Expose one shot."""
    window = shot.window or camera.window
    step = shot.rows_at_once or window.height
    strips = [
        expose(
            camera,
            shot.target,
            shot.lamp,
            shot.settings,
            random,
            window=replace(window, row0=window.row0 + row, height=min(step, window.height - row)),
            after_s=shot.after_s,
        )
        for row in range(0, window.height, step)
    ]
    return Taken(
        name=shot.frame,
        role=shot.role,
        header=camera.describe(shot.settings),
        exposure=Exposure(**asdict(shot.settings)),
        frame=replace(strips[0], samples_dn=np.concatenate([strip.samples_dn for strip in strips])),
    )
