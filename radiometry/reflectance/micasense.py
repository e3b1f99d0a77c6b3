"""A MicaSense camera's raw numbers as radiance at the sensor [W/m2/sr/nm].

    L = V(r) (a1/g) (p - p_BL) / (te + a2 y - a3 te y)          p, p_BL as shares of 2^bits

te the exposure time [s], g the gain (ISO/100), y the row, V = 1 / (1 + k0 r + k1 r^2 + ... + k5 r^6), r [px]
from the vignetting centre.
Source: MicaSense, "RedEdge Camera Radiometric Calibration Model"; the same model, with the same figures for
the same files, in its public image processing library.
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
    """Give p - p_BL as a share of full scale, 2^bits. Negative below black, never clipped."""
    return np.subtract(samples_dn, black_dn, dtype=np.float64) / float(1 << bits)


def scale_to_radiance(signal: Plane, *, model: RadianceModel, settings: Settings, row0: int) -> Plane:
    """Give L [W/m2/sr/nm] of a signal above black [share of full scale], window starting at ``row0``.

    Raises InputRejected(sensor_model_unusable) if the exposure of a row is not positive
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
    """Give the irradiance on a diffuse panel, E = pi L / albedo [W/m2/nm], L its mean radiance."""
    return math.pi * radiance / albedo
