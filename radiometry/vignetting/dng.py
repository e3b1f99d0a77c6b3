"""The falloff as a DNG opcode, FixVignetteRadial."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radiometry.findings import InputRejected, shared
from radiometry.vignetting.application import bracket
from radiometry.vignetting.expansion import average_share, fit_even_powers, sample_frame
from radiometry.vignetting.results import Coefficient

_FIX_VIGNETTE_RADIAL = 3
_SINCE_DNG_1_3 = 0x01030000
_OPTIONAL = 1
_TERMS = 5


@dataclass(frozen=True, kw_only=True)
class DngVignette:
    """Parameters of FixVignetteRadial.

    gain = 1 + k0 r^2 + k1 r^4 + k2 r^6 + k3 r^8 + k4 r^10, r the distance from the centre over that of the
    farthest corner pixel.

    Attributes
    ----------
    k : tuple of float
        Coefficients k0 to k4.
    centre_x, centre_y : float
        Centre relative to the frame: 0 at the first pixel, 1 at the last.
    largest_error_rel : float
        Largest error of gain V, anywhere in the frame.
    opcode_list : bytes
        One opcode, big endian, in the form of the tag OpcodeList3.
    """

    k: tuple[float, float, float, float, float]
    centre_x: float
    centre_y: float
    largest_error_rel: float
    opcode_list: bytes


def export_dng(
    coefficients: Sequence[Coefficient], *, channels: Sequence[str], f_number: float
) -> DngVignette:
    """Compute the gain of FixVignetteRadial that corrects a falloff, the mean of V over channels.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of one version.
    channels : sequence of str
        Channels whose mean V is taken.
    f_number : float
        F-number.

    Returns
    -------
    DngVignette
        Parameters and opcode.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated`, also if the centre lies outside of the frame, which
        the opcode cannot express.

    Notes
    -----
    1 / V is not a polynomial of five terms: such a polynomial is fitted to it over the frame [1]_, and the
    largest error is stated. Between two f-numbers the centre is the weighted mean of theirs.

    References
    ----------
    .. [1] Adobe, Digital Negative Specification 1.7.1, chapter 7, FixVignetteRadial
    """
    wanted = 1.0 / average_share(
        coefficients, *sample_frame(coefficients[0]), channels=channels, f_number=f_number
    )
    parts = [
        pair for channel in channels for pair in bracket(coefficients, channel=channel, f_number=f_number)
    ]
    row = sum(weight * each.centre_row_px for each, weight in parts) / len(channels)
    col = sum(weight * each.centre_col_px for each, weight in parts) / len(channels)
    last_row, last_col = coefficients[0].height_px - 1.0, coefficients[0].width_px - 1.0
    centre_x, centre_y = col / last_col, row / last_row
    if not (0.0 <= centre_x <= 1.0 and 0.0 <= centre_y <= 1.0):
        raise InputRejected(
            shared.VIGNETTING_NOT_CALIBRATED,
            f"The fitted centre, row {row:.0f} and column {col:.0f}, lies outside of the frame: the opcode "
            "cannot say that. Use the correction map.",
        )
    rows, cols = sample_frame(coefficients[0])
    farthest = max(row, last_row - row) ** 2 + max(col, last_col - col) ** 2
    squared = ((rows - row) ** 2 + (cols - col) ** 2) / farthest
    found, error = fit_even_powers(np.asarray(squared), np.asarray(wanted), terms=_TERMS)
    k0, k1, k2, k3, k4 = found
    return DngVignette(
        k=(k0, k1, k2, k3, k4),
        centre_x=centre_x,
        centre_y=centre_y,
        largest_error_rel=error,
        opcode_list=write_opcodes([(_FIX_VIGNETTE_RADIAL, struct.pack(">7d", *found, centre_x, centre_y))]),
    )


def write_opcodes(opcodes: Sequence[tuple[int, bytes]]) -> bytes:
    """Write an opcode list: their count, and of each its number, version, flags, size and content.

    Parameters
    ----------
    opcodes : sequence of (int, bytes)
        Number and parameters of each.

    Returns
    -------
    bytes
        The list, big endian.
    """
    head = struct.Struct(">4I")
    written = [head.pack(number, _SINCE_DNG_1_3, _OPTIONAL, len(held)) + held for number, held in opcodes]
    return struct.pack(">I", len(opcodes)) + b"".join(written)
