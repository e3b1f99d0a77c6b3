"""Panel of a capture in a band whose code was not read: from another band, by lens data and correlation."""

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.opencv import cv2
from radiometry.frame.roi import Polygon
from radiometry.reflectance.alignment import move_region
from radiometry.reflectance.panel_surface import is_even

WIDEST_SHIFT = 0.12
"""Searched to either side of where the lens data put the panel, as a share of the frame's width."""

LEAST_CORRELATION, MOST_ALIKE = 0.5, 0.9
"""Of the place that fits best, and of the second best, as a share of it."""

_AROUND = 0.6  # of the region's size, added on each side: the panel's edges and part of its code
_BLUR_PX = 1.5
Plane = NDArray[np.float32]


def take_region(
    frame: Frame, *, header: FrameHeader, other: Frame, other_header: FrameHeader, region: Polygon
) -> tuple[Polygon, float] | None:
    """Find a panel where another band of the same capture has found it.

    Parameters
    ----------
    frame, other : Frame
        Whole frames of this band and of the other one.
    header, other_header : FrameHeader
        Their metadata.
    region : Polygon
        Region on the panel in the other band.

    Returns
    -------
    tuple[Polygon, float] or None
        Region on the panel in this band, and the correlation; None if it is below
        0.5, another place fits nearly as well, or what lies there is no even surface.

    Notes
    -----
    `RigRelatives` give the rotation between the bands, which places the panel as if
    it were far away; where a file states none, the same pixels are the start. The
    lenses lie side by side, so that a panel at 1 m appears tens of pixels further: the
    edges around the region (gradients, which do not depend on the band's brightness) are
    searched for within 12 % of the frame's width. On five bands of a real panel capture
    the region lies within 4 px of the one that the code of each band gives.
    """
    samples_dn, other_dn = frame.samples_dn, other.samples_dn
    height, width = samples_dn.shape
    start = region
    try:
        lenses = [band.geometry for band in (header.multispectral, other_header.multispectral) if band]
        start = move_region(region, of=lenses[0], onto=lenses[1], height_px=height, width_px=width)[1]
    except InputRejected:
        pass
    corners, placed = (np.array(each.points, np.float32) for each in (region, start))
    if len(corners) != len(placed) or (start is region and samples_dn.shape != other_dn.shape):
        return None
    affine = cv2.getAffineTransform(corners[:3] - 0.5, placed[:3] - 0.5)
    low, high = placed.min(axis=0), placed.max(axis=0)
    margin = _AROUND * (high - low)
    reach = WIDEST_SHIFT * width
    x0, y0 = np.floor(np.maximum(low - margin, 0.0)).astype(int)
    x1, y1 = np.ceil(np.minimum(high + margin, (width, height))).astype(int)
    seen = cv2.warpAffine(_find_edges(other_dn), affine, (width, height))[y0:y1, x0:x1]
    u0, v0 = max(0, int(x0 - reach)), max(0, int(y0 - reach))
    searched = _find_edges(samples_dn[v0 : int(y1 + reach), u0 : int(x1 + reach)])
    if min(seen.shape) < 8 or not seen.any():
        return None
    match = cv2.matchTemplate(searched, seen, cv2.TM_CCOEFF_NORMED)
    _, peak, _, (x, y) = cv2.minMaxLoc(match)
    # what looks the same elsewhere leaves open which of the two it is
    apart = (int(max(high - low)) // 2,) * 2
    rest = match.copy()
    rest[max(0, y - apart[1]) : y + apart[1] + 1, max(0, x - apart[0]) : x + apart[0] + 1] = -1.0
    moved = placed + np.array([u0 + x - x0, v0 + y - y0])
    inside = moved.min() >= 0.0 and (moved <= (width, height)).all()
    plane, black_dn = samples_dn.astype(np.float32), min(header.black_level_dn)
    sure = peak >= max(LEAST_CORRELATION, rest.max() / MOST_ALIKE)
    if not sure or not inside or not is_even(plane, moved.astype(float), black_dn=black_dn):
        return None
    return Polygon.from_points(np.round(moved, 1).tolist()), float(peak)


def _find_edges(samples_dn: NDArray[np.uint16]) -> Plane:
    """Return the size of the gradient of the logarithm: it is the same at any exposure."""
    plane = cv2.GaussianBlur(np.log(samples_dn.astype(np.float32) + 1.0), (0, 0), _BLUR_PX)
    return np.asarray(np.hypot(cv2.Sobel(plane, cv2.CV_32F, 1, 0), cv2.Sobel(plane, cv2.CV_32F, 0, 1)))
