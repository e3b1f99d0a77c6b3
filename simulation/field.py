"""A night in the field: lamps, a body's own response, flicker, distance and glare that no laboratory has."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.spectral.curves import list_lamps, read_lamp, read_observer, read_response

Plane = NDArray[np.float64]
_STEP_NM = 5.0


@dataclass(frozen=True, kw_only=True)
class Field:
    """Differences between a calibration and a measurement.

    Attributes
    ----------
    response : ndarray of float64
        Response of this very body, columns R, G and B.
    lamp, light : ndarray of float64
        Spectrum of the calibration's lamp, and of the measured light.
    modulation, phase : float
        Modulation depth of the light, and the phase at which the exposure begins [rad].
    calibrated_m, measured_m : float
        Distances of calibration and measurement [m].
    focal_length_mm, pupil : float
        Focal length [mm] and magnification of the pupil.
    glare_share, local : float
        Glare that a trap shows, and glare at the measured place over that at the trap.
    """

    response: Plane
    lamp: Plane
    light: Plane
    modulation: float
    phase: float
    calibrated_m: float
    measured_m: float
    focal_length_mm: float
    pupil: float
    glare_share: float
    local: float

    def respond(self, spectrum: Plane) -> Plane:
        """Return the responses of R, G and B to 1 cd/m2 of a spectrum."""
        return np.asarray((spectrum @ self.response) / (spectrum @ read_observer()))

    @property
    def colour(self) -> tuple[float, float]:
        """R/G and B/G of the calibration's frames."""
        red, green, blue = self.respond(self.lamp)
        return float(red / green), float(blue / green)

    def show(self, luminance_cd_m2: Plane, *, exposure_time_s: float, mains_frequency_hz: float) -> Plane:
        """Return what the channels show of a scene, in luminance of the calibration's green [cd/m2].

        Returns
        -------
        ndarray of float64
            (row, col, channel R, G and B).
        """
        half_turn = 2.0 * math.pi * mains_frequency_hz * exposure_time_s
        flicker = 1.0 + self.modulation * math.sin(half_turn) / half_turn * math.cos(self.phase)
        lost = self._lose(self.calibrated_m) / self._lose(self.measured_m)
        scattered = self.glare_share * self.local * float(np.mean(luminance_cd_m2))
        shown = (luminance_cd_m2 + scattered) * flicker * lost
        return np.asarray(shown[..., None] * self.respond(self.light) / self.respond(self.lamp)[1])

    def _lose(self, distance_m: float) -> float:
        focal_m = self.focal_length_mm / 1e3
        return (1.0 + focal_m / (distance_m - focal_m) / self.pupil) ** 2


def draw_field(random: np.random.Generator, *, camera: str, lamp: str, light: str) -> Field:
    """Draw a night: a body of a published model, and lamps of tabulated kinds.

    Notes
    -----
    The wavelengths of each channel are off by 2 nm and its slope by 3 % in 100 nm, one standard deviation
    each. A lamp contains up to a fifth of another of its kind, and slopes by 3 % in 100 nm; the surface
    slopes by 5 %.
    """
    grid = np.arange(81) * _STEP_NM
    published = read_response(camera)
    body = np.column_stack(
        [
            np.interp(grid - shift, grid, channel, left=0.0, right=0.0)
            for shift, channel in zip(random.normal(0.0, 2.0, 3), published.T, strict=True)
        ]
    )
    body *= _slope(random, 0.03)[:, None]
    return Field(
        response=body,
        lamp=_draw_lamp(random, lamp),
        light=_draw_lamp(random, light) * _slope(random, 0.05),
        modulation=float(random.uniform(0.0, 1.0)),
        phase=float(random.uniform(0.0, 2.0 * math.pi)),
        calibrated_m=float(random.uniform(1.0, 3.0)),
        measured_m=float(random.uniform(1.0, 50.0)),
        focal_length_mm=15.0,
        pupil=float(random.uniform(0.7, 1.5)),
        glare_share=float(random.uniform(0.0, 0.04)),
        local=float(random.uniform(0.5, 1.5)),
    )


def _slope(random: np.random.Generator, deviation: float) -> Plane:
    return np.asarray(1.0 + random.normal(0.0, deviation) * (np.arange(81) - 36) * _STEP_NM / 100.0)


def _draw_lamp(random: np.random.Generator, name: str) -> Plane:
    kin = [each for each in list_lamps() if each[:-1] == name[:-1]]
    observer, other = read_observer(), read_lamp(str(random.choice(kin)))
    mixed, share = read_lamp(name), random.uniform(0.0, 0.2)
    mixed = (1.0 - share) * mixed / (mixed @ observer) + share * other / (other @ observer)
    return np.asarray(np.maximum(mixed * _slope(random, 0.03), 0.0))
