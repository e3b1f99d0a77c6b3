"""Raw values of a MicaSense camera as radiance at the sensor [W/m2/sr/nm].

    L = V(r) (a1/g) (p - p_BL) / (te + a2 y - a3 te y)          p, p_BL as fractions of 2^bits

te is the exposure time [s], g the gain (ISO/100), y the row, V = 1 / (1 + k0 r + k1
r^2 + ... + k5 r^6), r [px] from the vignetting centre. The model is that of
MicaSense, "RedEdge Camera Radiometric Calibration Model"; its public image
processing library uses the same model, with the same values for the same files.
"""

import math

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame.exposure import Settings
from radiometry.frame.multispectral import RadianceModel
from radiometry.reflectance import codes

Plane = NDArray[np.float64]

# Some firmware wrote 1/6329 s for exposures of 0.274 ms.
_MISWRITTEN_TIME_S, _MEANT_TIME_S = 1.0 / 6329.0, 0.000274
_ISO_PER_GAIN = 100.0


def subtract_black(samples_dn: NDArray[np.uint16], *, black_dn: float, bits: int) -> Plane:
    """Compute p - p_BL as a fraction of full scale.

    Parameters
    ----------
    samples_dn : ndarray of uint16
        Raw values [DN], (row, col).
    black_dn : float
        Black level [DN].
    bits : int
        Bits per sample; full scale is 2^bits.

    Returns
    -------
    Plane
        Fraction of full scale, (row, col); negative below black, never clipped.
    """
    return np.subtract(samples_dn, black_dn, dtype=np.float64) / float(1 << bits)


def scale_to_radiance(signal: Plane, *, model: RadianceModel, settings: Settings, row0: int) -> Plane:
    """Compute the radiance L of a signal above black.

    Parameters
    ----------
    signal : Plane
        Signal as a fraction of full scale, (row, col).
    model : RadianceModel
        Calibration of the band.
    settings : Settings
        Exposure settings.
    row0 : int
        First row of the window.

    Returns
    -------
    Plane
        Radiance [W/m2/sr/nm], (row, col).

    Raises
    ------
    InputRejected
        `sensor_model_unusable` if the exposure of a row is not positive.
    """
    time_s = settings.exposure_time_s
    if math.isclose(time_s, _MISWRITTEN_TIME_S, abs_tol=1e-6):
        time_s = _MEANT_TIME_S
    row = np.arange(row0, row0 + signal.shape[0])
    exposure_s = time_s + model.a2 * row - model.a3 * time_s * row
    if not exposure_s.min() > 0.0:
        raise InputRejected(
            codes.SENSOR_MODEL_UNUSABLE,
            "The file's RadiometricCalibration leaves rows of the image without exposure. "
            "Use the camera's original file.",
        )
    gain = settings.iso / _ISO_PER_GAIN
    return signal * (model.a1 / gain) / exposure_s[:, None]


def panel_irradiance(radiance: float, *, albedo: float) -> float:
    """Compute the irradiance on a diffuse panel, E = pi L / albedo.

    Parameters
    ----------
    radiance : float
        Mean radiance L of the panel [W/m2/sr/nm].
    albedo : float
        Reflectance of the panel.

    Returns
    -------
    float
        Irradiance [W/m2/nm].
    """
    return math.pi * radiance / albedo
