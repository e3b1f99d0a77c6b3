"""A Sequoia's raw numbers as irradiance at the sensor, in stages that stand alone.

    I_sq = f^2 (p - B) / ((A eps gamma + C) V(x/W, y/H))

p the 16-bit raw number, eps the exposure time [s], gamma the ISO value, V the lens's share of light. I_sq is
in a unit of its own, the same for all bands of all captures of one camera; K carries its scale.
Source: Parrot, SEQ-AN-01 (sensor model) and its vignetting note; "How to convert Sequoia images to
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
    """Give p - B [DN]: the part of the numbers that light makes. Negative below black, never clipped."""
    return np.subtract(samples_dn, black_dn, dtype=np.float64)


def scale_to_irradiance(signal_dn: Plane, *, model: SensorModel, settings: Settings) -> Plane:
    """Give I_sq = f^2 signal / (A eps gamma + C) of a signal above black [DN].

    Raises InputRejected(sensor_model_unusable) if the denominator is not positive
    """
    response = model.a * settings.exposure_time_s * settings.iso + model.c
    if not response > 0.0:
        raise InputRejected(
            codes.SENSOR_MODEL_UNUSABLE,
            f"The file's SensorModel {model.a:g}, {model.b:g}, {model.c:g} has no positive response at "
            f"{settings.exposure_time_s:g} s and ISO {settings.iso:g}. Use the camera's original file.",
        )
    return signal_dn * (settings.f_number**2 / response)
