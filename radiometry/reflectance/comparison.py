"""What another calibration would make of a reflectance that was measured."""

import math
from collections.abc import Sequence

from radiometry.fitting.comparison import PERCENT
from radiometry.fitting.evidence import Quantity
from radiometry.frame import FrameHeader
from radiometry.reflectance.application import choose_coefficient, find_scale_of_frame
from radiometry.reflectance.imaging import require_band
from radiometry.reflectance.results import Coefficient


def change_reflectance(
    old: Sequence[Coefficient],
    new: Sequence[Coefficient],
    *,
    header: FrameHeader,
    incidence_angle_deg: float = 0.0,
    common_u_rel: float = 0.0,
) -> Quantity:
    """Give R_new / R_old - 1 [%] of a frame that was measured with ``old`` and would be with ``new``.

        R = K I_sq / (I_ss cos(theta))      R_new / R_old = factor_new / factor_old
        u(change)^2 = (R_new / R_old)^2 (u_old^2 + u_new^2 - 2 m^2), u relative to K

    The frame's signal is one and the same in both, and so is its sunshine reading's error.

    Takes
      header : of the frame; K is taken at its time, I_ss as each version chooses its readings
      common_u_rel : m, of the panel's reflectance where both versions hang on one panel
    Raises InputRejected as `find_scale_of_frame`, with either version
    Source: JCGM 100:2008, 5.2.2
    """
    factors = [
        find_scale_of_frame(header, coefficients=each, incidence_angle_deg=incidence_angle_deg).factor
        for each in (old, new)
    ]
    band = require_band(header).band
    shares = [_k_u_rel(choose_coefficient(each, band=band)) for each in (old, new)]
    ratio = factors[1] / factors[0]
    variance = shares[0] ** 2 + shares[1] ** 2 - 2.0 * common_u_rel**2
    return Quantity(
        value=100.0 * (ratio - 1.0),
        standard_uncertainty=100.0 * abs(ratio) * math.sqrt(max(0.0, variance)),
        unit=PERCENT,
    )


def _k_u_rel(coefficient: Coefficient) -> float:
    return coefficient.reflectance_k_standard_uncertainty / abs(coefficient.reflectance_k)
