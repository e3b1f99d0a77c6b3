"""Raw values of a DJI multispectral camera as a rate that is proportional to radiance [1/s].

    camera = G(r) (p - p_BL) p_cam / (gain t)          p, p_BL as fractions of 2^bits

t is the exposure time [s], gain and p_cam are `SensorGain` and `SensorGainAdjustment`, G = 1 + k0 r + k1 r^2
+ ... + k5 r^6 with r [px] from the calibrated optical centre. DJI's reflectance is camera / `Irradiance`
times a panel's factor, which is K. The model is that of the "P4 Multispectral Image Processing Guide" 1.0,
equations 7 to 9, which divides by 65535 where the "Mavic 3M Image Processing Guide" 1.0 divides by 2^bits:
1.5e-5 apart, and K takes it up.
"""

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import GainModel
from radiometry.reflectance import codes

Plane = NDArray[np.float64]


def scale_to_rate(signal: Plane, *, model: GainModel) -> Plane:
    """Compute the camera's rate of a signal above black.

    Parameters
    ----------
    signal : Plane
        Signal as a fraction of full scale, (row, col).
    model : GainModel
        Response of the band.

    Returns
    -------
    Plane
        Rate [1/s], (row, col).

    Raises
    ------
    InputRejected
        `sensor_model_unusable` if gain, exposure or adjustment is not positive.
    """
    if not min(model.gain, model.exposure_time_s, model.adjustment) > 0.0:
        raise InputRejected(
            codes.SENSOR_MODEL_UNUSABLE,
            f"The file's SensorGain {model.gain:g}, ExposureTime {model.exposure_time_s * 1e6:g} us and "
            f"SensorGainAdjustment {model.adjustment:g} are no camera's. Use the camera's original file.",
        )
    return signal * (model.adjustment / (model.gain * model.exposure_time_s))
