"""Parts of a simulated camera, in the order in which light meets them; every effect is off by default."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from radiometry.frame.multispectral import VignettingPolynomial
from radiometry.frame.roi import Window
from radiometry.geometry.camera import CameraModel
from simulation.light import ILLUMINANT_A_K, Band, compute_mismatch

Plane = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Body:
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


@dataclass(frozen=True, kw_only=True)
class Lens:
    """Lens between the target and the sensor.

    Attributes
    ----------
    f_number_errors : Mapping
        True over nominal f-number, by nominal f-number; 1 where none is listed.
    transmission : float
        Share of the light that passes on the axis.
    falloffs, falloff : Mapping, tuple of float
        k1, k2, k3 of V(r) = 1 + k1 r^2 + k2 r^4 + k3 r^6 by f-number, and for f-numbers that are not listed;
        r is 1 half a diagonal from the centre.
    centre_px : tuple of float or None
        Row and column of the falloff's centre [px]; None: the middle of the frame.
    polynomial : VignettingPolynomial or None
        V(x, y) as Sequoia files state it, in place of V(r).
    blur_px : float
        Standard deviation of a Gaussian point spread function [px]; edges and stars have their own blur.
    stray_share : float
        Share of the light that is scattered evenly over the window (veiling glare, ISO 9358:1994).
    projection : CameraModel or None
        Focal length, principal point and distortion; only views of boards ask for it.
    projections : Mapping
        Those of red and blue, by letter, where a colour has its own (lateral chromatic aberration).

    """

    f_number_errors: Mapping[float, float] = field(default_factory=dict)
    transmission: float = 1.0
    falloffs: Mapping[float, tuple[float, float, float]] = field(default_factory=dict)
    falloff: tuple[float, float, float] = (0.0, 0.0, 0.0)
    centre_px: tuple[float, float] | None = None
    polynomial: VignettingPolynomial | None = None
    blur_px: float = 0.0
    stray_share: float = 0.0
    projection: CameraModel | None = None
    projections: Mapping[str, CameraModel] = field(default_factory=dict)

    def scatter(self, light: Plane) -> Plane:
        """Blur an image and lay stray light over it."""
        if self.blur_px > 0.0:
            light = np.asarray(cv2.GaussianBlur(light, (0, 0), self.blur_px), np.float64)
        if self.stray_share > 0.0:
            light = (1.0 - self.stray_share) * light + self.stray_share * float(np.mean(light))
        return light


@dataclass(frozen=True, kw_only=True)
class Shutter:
    """Shutter with errors of its nominal times.

    Attributes
    ----------
    time_errors : Mapping
        True over nominal exposure time, by nominal time; 1 where none is listed.
    extra_s : float
        Time that adds to every exposure [s].

    """

    time_errors: Mapping[float, float] = field(default_factory=dict)
    extra_s: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """Image sensor; patterns from pixel to pixel are fixed by ``seed`` and the same in every window.

    Attributes
    ----------
    cfa : str
        "RGGB" or another order, "grey", or "rgb" for three planes.
    colours : Mapping
        Sensitivity of each colour relative to the strongest.
    bands_nm : Mapping
        Spectral response of each colour; it counts where a lamp is not illuminant A.
    sensitivity_e : float
        Electrons of the strongest colour for 1 cd/m2, 1 s, f/1 [e m2/(cd s)].
    gain_dn_per_e, base_iso : float
        System gain at ``base_iso`` [DN/e]; it is proportional to the ISO value.
    read_noise_e, full_well_e : float
        Standard deviation of the read noise and largest number of electrons [e].
    dark_current_e_s : float
        Electrons without light [e/s]; with ``compensates_dark`` their mean is subtracted, their noise stays.
    row_noise_e : float
        Standard deviation of what the pixels of a row share in one readout [e].
    dsnu_e, prnu_rel : float
        Standard deviation of the dark offsets [e] and of the relative sensitivities of pixels.
    bend_rel : float
        Share that the signal loses at white or at the full well, in proportion below.
    photon_noise : bool
        False: every exposure collects the mean number of electrons.
    step_dn : float
        Digital numbers are multiples of this [DN].

    """

    height_px: int = 96
    width_px: int = 96
    cfa: str = "RGGB"
    colours: Mapping[str, float] = field(default_factory=lambda: {"R": 0.55, "G": 1.0, "B": 0.7})
    bands_nm: Mapping[str, Band] = field(
        default_factory=lambda: {"R": (600.0, 80.0), "G": (535.0, 90.0), "B": (465.0, 70.0)}
    )
    sensitivity_e: float = 22_000.0
    gain_dn_per_e: float = 0.5
    base_iso: float = 100.0
    read_noise_e: float = 0.0
    full_well_e: float = math.inf
    dark_current_e_s: float = 0.0
    compensates_dark: bool = False
    row_noise_e: float = 0.0
    dsnu_e: float = 0.0
    prnu_rel: float = 0.0
    bend_rel: float = 0.0
    photon_noise: bool = True
    black_level_dn: float = 256.0
    white_level_dn: float = 4095.0
    step_dn: float = 1.0
    seed: int = 0

    @property
    def sites(self) -> int:
        """Number of CFA sites or planes that have levels of their own."""
        return {"grey": 1, "rgb": 3}.get(self.cfa, 4)

    def gain(self, iso: float) -> float:
        """Return the system gain at an ISO value [DN/e]."""
        return self.gain_dn_per_e * iso / self.base_iso

    def filter_light(self, window: Window, *, temperature_k: float = ILLUMINANT_A_K) -> Plane:
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

    def pick(self, light: Plane, window: Window) -> Plane:
        """Return the light of each site's own colour, (row, col), from that of all three, (row, col, 3)."""
        rows = np.arange(window.row0, window.row0 + window.height) % 2
        cols = np.arange(window.col0, window.col0 + window.width) % 2
        wanted = np.array(["RGB".index(one) for one in self.cfa]).reshape(2, 2)[rows[:, None], cols[None, :]]
        return np.take_along_axis(light, wanted[:, :, None], axis=2)[:, :, 0]

    def pattern(self, window: Window, *, dark: bool = False) -> Plane | float:
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
        self, mean_e: Plane, random: np.random.Generator, *, window: Window, dark_e: float, iso: float
    ) -> NDArray[np.uint16]:
        """Draw the digital numbers of pixels that collect a mean number of electrons.

        Notes
        -----
        The linear camera of EMVA 1288 [1]_, with a full well Q, a bend b, fixed offsets o and rounding to
        steps::

            e = min(Poisson(mean), Q) (1 - b min(Poisson(mean), Q) / Q_white)
            y = clip(round(gain (e + o + read noise N(0, 1) + row noise N(0, 1)) + black), 0, white)

        References
        ----------
        .. [1] EMVA Standard 1288, release 4.0 (2021)

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
