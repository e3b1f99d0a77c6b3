"""Corners of a board in one picture."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from radiometry.fitting.evidence import Extracted, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.opencv import cv2
from radiometry.frame.roi import Window, mask
from radiometry.frame.statistics import ChannelStatistics, compute_statistics
from radiometry.geometry.colour import ColourCorners, find_colours
from radiometry.geometry.detection import FirstSquare, Found, find_corners
from radiometry.geometry.grey import make_grey
from radiometry.geometry.target import Target
from radiometry.specification.stored import LATER


@dataclass(frozen=True, kw_only=True)
class Features:
    """Corners in one picture, ready for JSON.

    Attributes
    ----------
    target : Target
        Board that was searched.
    not_found : str
        Reason why there are no corners, else "".
    height_px, width_px : int
        Size of the whole frame [px].
    indices : tuple of int, default: ()
        Indices of the corners on the board, row by row.
    fixed_px, fitted_px : tuple of tuple of float, default: ()
        (row, col) of each corner [px], from the centre of the frame's first pixel, as
        placed in OpenCV's fixed window and in one fitted to the squares.
    fitted_window_px : int, default: 0
        Half side of that window [px].
    spacing_px : float, default: 0.0
        Shortest distance between neighbours [px].
    edge_rise_px : float or None, default: None
        10 to 90 % rise of the squares' edges [px]; None where the board is not seen
        whole.
    board_share : float, default: 0.0
        Fraction of the frame that the corners span.
    first_square : {"black", "white"} or None, default: None
        Colour of the square between the first corners of the first two rows, of a board that differs from
        its mirror image; else None.
    colours : tuple of ColourCorners or None, default: None
        Displacement of red's and blue's corners from those of green; None without colours.
    """

    target: Target
    not_found: str
    height_px: int
    width_px: int
    indices: tuple[int, ...] = ()
    fixed_px: tuple[tuple[float, float], ...] = ()
    fitted_px: tuple[tuple[float, float], ...] = ()
    fitted_window_px: int = 0
    spacing_px: float = 0.0
    edge_rise_px: float | None = None
    board_share: float = 0.0
    first_square: FirstSquare | None = field(default=None, metadata=LATER)
    colours: tuple[ColourCorners, ...] | None = field(default=None, metadata=LATER)


def extract_features(
    frame: Frame, regions: Sequence[Region], *, header: FrameHeader, target: Target
) -> Extracted[Features]:
    """Find the board in a window of a frame; a board that is not there is a result and not an error.

    Parameters
    ----------
    frame : Frame
        Frame to measure.
    regions : sequence of Region
        Regions of the frame.
    header : FrameHeader
        Header of the frame.
    target : Target
        Board to find.

    Returns
    -------
    Extracted[Features]
        Statistics of the first region, which show whether the white squares are
        clipped, and the corners.
    """
    found = find_corners(make_grey(frame, bits_per_sample=header.bits_per_sample), target)
    return Extracted(statistics=_count(frame, regions[0]), features=_describe(frame, found, target))


def _count(frame: Frame, region: Region) -> tuple[ChannelStatistics, ...]:
    height, width = frame.samples_dn.shape[:2]
    inside = mask(region.polygon, Window(row0=frame.row0, col0=frame.col0, height=height, width=width))
    return compute_statistics(frame, inside)


def _describe(frame: Frame, found: Found, target: Target) -> Features:
    if found.not_found:
        return Features(
            target=target, not_found=found.not_found, height_px=frame.height_px, width_px=frame.width_px
        )
    corner = np.array([frame.row0, frame.col0])
    hull = cv2.convexHull(found.fitted.astype(np.float32))
    return Features(
        target=target,
        not_found="",
        height_px=frame.height_px,
        width_px=frame.width_px,
        indices=tuple(int(index) for index in found.indices),
        fixed_px=tuple((float(row), float(col)) for row, col in found.fixed + corner),
        fitted_px=tuple((float(row), float(col)) for row, col in found.fitted + corner),
        fitted_window_px=found.fitted_window_px,
        spacing_px=found.spacing_px,
        edge_rise_px=found.edge_rise_px,
        board_share=float(cv2.contourArea(hull)) / (frame.height_px * frame.width_px),
        first_square=found.first_square,
        colours=find_colours(frame, found),
    )
