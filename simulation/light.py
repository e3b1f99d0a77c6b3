"""Lamps, and the meters that read them."""

import math
from dataclasses import dataclass

import numpy as np

Band = tuple[float, float]  # centre and full width at half maximum of a Gaussian response [nm]

ILLUMINANT_A_K = 2856.0
LUMINOUS_EFFICIENCY: Band = (555.0, 100.0)
_WAVELENGTHS_NM = np.arange(380.0, 781.0, 2.0)
_C2_NM_K = 1.438776877e7


def compute_mismatch(band: Band, *, temperature_k: float) -> float:
    """Compute the spectral mismatch of a detector that was calibrated under illuminant A.

    Parameters
    ----------
    band : tuple of float
        Centre and full width at half maximum of the detector's Gaussian response s [nm].
    temperature_k : float
        Temperature T of the Planckian source that is measured [K].

    Returns
    -------
    float
        Indicated over true luminance; 1 at 2856 K and for a detector with the response V.

    Notes
    -----
    With the spectrum P_T of a black body [1]_::

        m = (int P_T s / int P_T V) / (int P_A s / int P_A V)

    V is a Gaussian of 555 nm and 100 nm here: close to V(lambda), and exact for what is simulated.

    References
    ----------
    .. [1] ISO/CIE 19476:2014, Characterization of the performance of illuminance and luminance meters

    """

    def respond(kelvin: float, detector: Band) -> float:
        spectrum = _WAVELENGTHS_NM**-5 / np.expm1(_C2_NM_K / (_WAVELENGTHS_NM * kelvin))
        offset = (_WAVELENGTHS_NM - detector[0]) / detector[1]
        return float(np.sum(spectrum * np.exp(-4.0 * math.log(2.0) * offset**2)))

    return (respond(temperature_k, band) / respond(temperature_k, LUMINOUS_EFFICIENCY)) / (
        respond(ILLUMINANT_A_K, band) / respond(ILLUMINANT_A_K, LUMINOUS_EFFICIENCY)
    )


@dataclass(frozen=True, kw_only=True)
class Lamp:
    """Light on the target.

    Attributes
    ----------
    luminance_cd_m2 : float
        Luminance of the target where its share is 1 [cd/m2].
    drift_rel_per_s : float
        Relative change of the luminance [1/s].
    temperature_k : float
        Temperature of the Planckian spectrum [K]; cameras and meters are calibrated at 2856 K.

    """

    luminance_cd_m2: float
    drift_rel_per_s: float = 0.0
    temperature_k: float = ILLUMINANT_A_K

    def shine(self, after_s: float) -> float:
        """Return the luminance after a time [cd/m2]."""
        return self.luminance_cd_m2 * (1.0 + self.drift_rel_per_s * after_s)


@dataclass(frozen=True, kw_only=True)
class Meter:
    """Luminance or illuminance meter.

    Attributes
    ----------
    scale : float
        Indicated over true value: the error that all its readings share.
    repeatability : float
        Relative standard deviation of a reading.
    band : tuple of float
        Spectral response; it counts where a lamp is not illuminant A.

    """

    scale: float = 1.0
    repeatability: float = 0.0
    band: Band = LUMINOUS_EFFICIENCY

    def read(
        self, value: float, random: np.random.Generator, *, temperature_k: float = ILLUMINANT_A_K
    ) -> float:
        """Draw a reading of a true value."""
        scale = self.scale * compute_mismatch(self.band, temperature_k=temperature_k)
        return float(value * scale * random.normal(1.0, self.repeatability))
