"""Falloff as an entry of Lensfun's database."""

from collections.abc import Sequence

import numpy as np

from radiometry.frame.lensfun import LensfunNames, write_database
from radiometry.vignetting.expansion import average_share, fit_even_powers, sample_frame
from radiometry.vignetting.results import Coefficient

_TERMS = 3


def export_lensfun(
    coefficients: Sequence[Coefficient], *, channels: Sequence[str], names: LensfunNames
) -> str:
    """Write a Lensfun database with the camera, the lens, and one vignetting element per f-number.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of one version.
    channels : sequence of str
        Channels whose mean V is taken.
    names : LensfunNames
        Names and sizes of camera and lens.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated` if the calibration lacks a channel.

    Notes
    -----
    Model "pa" is V itself [1]_: light times 1 + k1 r^2 + k2 r^4 + k3 r^6, r = 1 at the half diagonal, from
    the middle of the frame: the database's schema has no centre for a lens [2]_. V is therefore refitted
    about the middle; a comment beside each element states the remaining error. V is the mean over channels.

    References
    ----------
    .. [1] Lensfun manual, "Lens calibration data format"
    .. [2] lensfun-database.xsd of Lensfun's database
    """
    elements = [
        _write_element(coefficients, f_number, channels, names)
        for f_number in sorted({each.f_number for each in coefficients})
    ]
    first = coefficients[0]
    return write_database(
        names,
        elements,
        width_px=first.width_px,
        height_px=first.height_px,
        widest_f_number=min(each.f_number for each in coefficients),
    )


def _write_element(
    coefficients: Sequence[Coefficient], f_number: float, channels: Sequence[str], names: LensfunNames
) -> str:
    first = coefficients[0]
    rows, cols = sample_frame(first)
    wanted = average_share(coefficients, rows, cols, channels=channels, f_number=f_number)
    middle_row, middle_col = (first.height_px - 1) / 2.0, (first.width_px - 1) / 2.0
    # Lensfun's r is 1 at the centre of the corner pixel
    squared = ((rows - middle_row) ** 2 + (cols - middle_col) ** 2) / (middle_row**2 + middle_col**2)
    # about another point V is not 1: the level there is divided out, as a correction may
    level = float(
        average_share(
            coefficients, middle_row * _ONE, middle_col * _ONE, channels=channels, f_number=f_number
        )[0]
    )
    (k1, k2, k3), error = fit_even_powers(np.asarray(squared), wanted / level, terms=_TERMS)
    return (
        f"            <!-- f/{f_number:g}: largest error of the curve about the middle {error:.2%} -->\n"
        f'            <vignetting model="pa" focal="{names.focal_length_mm:.9g}" aperture="{f_number:.9g}" '
        f'distance="{names.distance_m:.9g}" k1="{k1:.9g}" k2="{k2:.9g}" k3="{k3:.9g}"/>'
    )


_ONE = np.ones(1)
