"""Change of a measured reflectance with another calibration."""

import math
from collections.abc import Sequence

from radiometry.fitting.comparison import PERCENT
from radiometry.fitting.evidence import Quantity
from radiometry.frame import FrameHeader
from radiometry.reflectance.imaging import require_band
from radiometry.reflectance.results import Coefficient
from radiometry.reflectance.scale import choose_coefficient, find_scale_of_frame


def change_reflectance(
    old: Sequence[Coefficient],
    new: Sequence[Coefficient],
    *,
    header: FrameHeader,
    incidence_angle_deg: float | None = None,
    common_u_rel: float = 0.0,
) -> Quantity:
    """Compute R_new / R_old - 1 of a frame measured with `old` and with `new`.

    Parameters
    ----------
    old, new : sequence of Coefficient
        Coefficients of both versions, one per band.
    header : FrameHeader
        Metadata of the frame; K is taken at its time, I_ss as each version chooses
        its readings.
    incidence_angle_deg : float or None, default: None
        Angle between the light and the surface's normal [deg]; None for that of the
        fit.
    common_u_rel : float, default: 0.0
        Relative standard uncertainty m of the panel's reflectance if both versions
        depend on the same panel.

    Returns
    -------
    Quantity
        Change in %, with its standard uncertainty.

    Raises
    ------
    InputRejected
        As `find_scale_of_frame`, with either version.

    Notes
    -----
    With the uncertainties relative to K [1]_::

        R = K I_sq / (I_ss cos(theta))      R_new / R_old = factor_new / factor_old
        u(change)^2 = (R_new / R_old)^2 (u_old^2 + u_new^2 - 2 m^2)

    The frame's signal is the same in both, and so is the error of its sunshine
    reading.

    References
    ----------
    .. [1] JCGM 100:2008, 5.2.2, doi:10.59161/JCGM100-2008E
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
