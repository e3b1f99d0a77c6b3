"""Raw values of a Sequoia as irradiance at the sensor, in separate stages.

    I_sq = f^2 (p - B) / ((A eps gamma + C) V(x/W, y/H))

p is the 16-bit raw value, eps the exposure time [s], gamma the ISO value, V the
relative illumination. I_sq is in a unit of its own, the same for all bands of all
captures of one camera; K carries its scale. The model is that of Parrot, SEQ-AN-01
(sensor model) and its vignetting note, and of "How to convert Sequoia images to
reflectance?" 1.1, section 4.
"""

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame.exposure import Settings
from radiometry.frame.multispectral import SensorModel
from radiometry.reflectance import codes

Plane = NDArray[np.float64]


def subtract_black(samples_dn: NDArray[np.uint16], *, black_dn: float) -> Plane:
    """Compute p - B, the part of the raw values that light causes.

    Parameters
    ----------
    samples_dn : ndarray of uint16
        Raw values [DN], (row, col).
    black_dn : float
        Black level B [DN].

    Returns
    -------
    Plane
        Signal above black [DN], (row, col); negative below black, never clipped.
    """
    return np.subtract(samples_dn, black_dn, dtype=np.float64)


def scale_to_irradiance(signal_dn: Plane, *, model: SensorModel, settings: Settings) -> Plane:
    """Compute I_sq = f^2 signal / (A eps gamma + C) of a signal above black.

    Parameters
    ----------
    signal_dn : Plane
        Signal above black [DN], (row, col).
    model : SensorModel
        Response of the band.
    settings : Settings
        Exposure settings.

    Returns
    -------
    Plane
        Irradiance in the camera's own unit, (row, col).

    Raises
    ------
    InputRejected
        `sensor_model_unusable` if the denominator is not positive.
    """
    response = model.a * settings.exposure_time_s * settings.iso + model.c
    if not response > 0.0:
        raise InputRejected(
            codes.SENSOR_MODEL_UNUSABLE,
            f"The file's SensorModel {model.a:g}, {model.b:g}, {model.c:g} has no positive response at "
            f"{settings.exposure_time_s:g} s and ISO {settings.iso:g}. Use the camera's original file.",
        )
    return signal_dn * (settings.f_number**2 / response)
