"""The falloff as DNG opcodes, one GainMap for each position of the mosaic."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from radiometry.findings import InputRejected, shared
from radiometry.frame.statistics import GREY, name_site
from radiometry.vignetting.application import evaluate
from radiometry.vignetting.dng import write_opcodes
from radiometry.vignetting.grid import Vector
from radiometry.vignetting.results import Coefficient

_GAIN_MAP = 9
_POINTS = 65
"""Along each side of the frame, from edge to edge."""


@dataclass(frozen=True, kw_only=True)
class GainMap:
    """Gains over a frame, which are interpolated linearly between their points.

    Attributes
    ----------
    largest_error_rel : float
        Largest error of gain V of any channel, anywhere in the frame.
    opcode_list : bytes
        One opcode for each position of the mosaic, big endian, in the form of the tag
        OpcodeList2.
    """

    largest_error_rel: float
    opcode_list: bytes


def export_gain_map(coefficients: Sequence[Coefficient], *, cfa: str, f_number: float) -> GainMap:
    """Compute the gains 1 / V of each position of the mosaic, on a lattice over the frame.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of one version.
    cfa : str
        Pattern at the frame's corner; "grey" for one channel.
    f_number : float
        F-number.

    Returns
    -------
    GainMap
        Opcodes, and their largest error.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated`, also for a rendered image, which has no mosaic.

    Notes
    -----
    Row i of the map lies at i / 64 of the frame's height, where the centre of pixel row n lies at
    (n + 0.5) / height, and columns likewise: the outermost points lie on the frame's edges, half a pixel
    outside the outermost centres [1]_. The gains apply to the signal above black.

    References
    ----------
    .. [1] Adobe, Digital Negative Specification 1.7.1, chapter 7, GainMap
    """
    if cfa == "rgb":
        raise InputRejected(
            shared.VIGNETTING_NOT_CALIBRATED,
            "The version is of rendered images: a GainMap is for raw files. Use the correction map.",
        )
    height_px, width_px = coefficients[0].height_px, coefficients[0].width_px
    sites = [(coefficients[0].channel, 0, 0)] if cfa == GREY else _list_sites(cfa)
    steps = np.arange(0.0, _POINTS - 0.5, 0.5)
    rows, cols = (steps / (_POINTS - 1) * size - 0.5 for size in (height_px, width_px))
    errors, opcodes = [], []
    for channel, top, left in sites:
        share = evaluate(coefficients, rows[:, None], cols, channel=channel, f_number=f_number).share
        gains = (1.0 / share[::2, ::2]).astype(">f4")
        between = scipy.ndimage.map_coordinates(
            gains.astype(float), np.meshgrid(steps, steps, indexing="ij"), order=1
        )
        errors.append(float(np.abs(between * share - 1.0).max()))
        opcodes.append((_GAIN_MAP, _write(gains, (top, left, height_px, width_px), pitch=1 + (cfa != GREY))))
    return GainMap(largest_error_rel=max(errors), opcode_list=write_opcodes(opcodes))


def _list_sites(cfa: str) -> list[tuple[str, int, int]]:
    """Return channel, row and column of the positions of a mosaic."""
    return [(name_site(cfa, index), *divmod(index, 2)) for index in range(4)]


def _write(gains: Vector, area: tuple[int, int, int, int], *, pitch: int) -> bytes:
    """Write area, plane and planes, pitches, points, spacings, origins, planes of the map, and its gains."""
    spacing = 1.0 / (_POINTS - 1)
    numbers = (*area, 0, 1, pitch, pitch, *gains.shape, spacing, spacing, 0.0, 0.0, 1)
    return struct.pack(">10I4dI", *numbers) + gains.tobytes()
