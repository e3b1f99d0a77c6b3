"""Search for a reflectance panel with a QR code in a band's image."""

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from radiometry.frame.roi import Polygon

SHRINK = 0.65
"""Side of the region over the panel's: what is left absorbs a tilted panel and another lens."""

DARKEST_PANEL = 0.5
"""Of the way from the code's black to its white. Grass, soil and asphalt lie below 0.3."""

MOST_UNEVEN_REL = 0.05
"""Scatter of the square's 8 x 8 cells over their mean above the code's black."""

LONGEST_SIDE_PX = 2600
"""A larger picture is made smaller first, by a whole factor: a code is found at any size, in less time."""

_SERIAL = re.compile(r"RP(\d{2})-\d{7}-[A-Z]{2}", re.ASCII)
_SAMPLES, _CELLS = 64, 8
_COVER = 127  # a grey that is no part of a code

Corners = NDArray[np.float64]
Plane = NDArray[np.float32]
Grey = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class FoundPanel:
    """A panel that was found.

    Attributes
    ----------
    region : Polygon
        Square well within the panel [px].
    serial : str
        Name of the panel in the code.
    """

    region: Polygon
    serial: str


@dataclass(frozen=True, kw_only=True)
class _Layout:
    """Position of the panel beside its code, in sides of the code."""

    distance: float
    side: float


# of panels up to RP02, and from RP03 on
_EARLY, _LATE = _Layout(distance=1.68, side=1.30), _Layout(distance=1.57, side=0.75)


def find_panel(samples_dn: NDArray[np.uint16]) -> FoundPanel | None:
    """Find the one panel that an image shows, by the QR code beside it.

    Parameters
    ----------
    samples_dn : ndarray of uint16
        Raw values [DN], (row, col), black not subtracted.

    Returns
    -------
    FoundPanel or None
        None if there is no code, none names a panel (RPnn-nnnnnnn-AA), the square
        leaves the image, no side or several look like a panel, or two panels are
        visible.

    Notes
    -----
    The centre of the panel lies D sides of the code from the code's centre, across
    one of its four sides; a panel measures S of them::

        up to RP02   D = 1.68, S = 1.30          from RP03 on   D = 1.57, S = 0.75

    The image determines which side it is: of the four squares exactly one must be
    bright (half of the way from the code's black to its white) and even (5 %).
    Position, size and rotation follow from the code's corners; the returned square
    is 0.65 S wide, in the middle of the panel. The first layout was measured on
    RP02-1603036-SC, five bands; the manufacturer's reference points [1]_ agree
    within 0.01. The second is from the same reference points and was tested on no
    image of our own.

    A code's corners are found to a few pixels, a fiftieth of its side. It needs 4
    px a module, some 80 px in all. A transposed image gives the transposed region.

    References
    ----------
    .. [1] MicaSense, reference points in micasense/imageprocessing, panel.py
    """
    plane, factor = _shrink(samples_dn)
    if plane is None:
        return None
    found: list[tuple[Corners, str]] = []
    for text, corners in _read_codes(plane):
        serial = _SERIAL.match(text)
        if serial:
            square = _find_square(plane, corners, _EARLY if int(serial[1]) < 3 else _LATE)
            found += [(square, serial[0])] if square is not None else []
    if len(found) != 1:
        return None
    square, name = found[0]
    # a tenth of a pixel is finer than the corners are known
    return FoundPanel(region=Polygon.from_points(np.round(square * factor, 1).tolist()), serial=name)


def _shrink(samples_dn: NDArray[np.uint16]) -> tuple[Plane | None, int]:
    """Return the image at the size that is searched, and the factor; None for a colour or a tiny image."""
    if samples_dn.ndim != 2 or min(samples_dn.shape) < _SAMPLES:
        return None, 1
    factor = math.ceil(max(samples_dn.shape) / LONGEST_SIDE_PX)
    height, width = (side // factor for side in samples_dn.shape)
    if min(height, width) < 1:
        return None, 1
    whole = np.ascontiguousarray(samples_dn[: height * factor, : width * factor])
    plane = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA) if factor > 1 else whole
    return plane.astype(np.float32), factor


def _read_codes(plane: Plane) -> list[tuple[str, Corners]]:
    """Return the text of every readable code, once, with its corners (x, y) [px].

    Codes hide one another from the detector: those that it has read are covered for
    a second pass.
    """
    low, high = (float(level) for level in np.percentile(plane, (0.1, 99.9)))
    if high <= low:
        return []
    grey = np.clip((plane - low) * (255.0 / (high - low)), 0.0, 255.0).astype(np.uint8)
    first = _group(_search(grey))
    for _, corners in first:
        middle = corners.mean(axis=0)
        cv2.fillConvexPoly(grey, np.round(middle + 1.1 * (corners - middle)).astype(np.int32), _COVER)
    return first + (_group(_search(grey)) if first else [])


def _search(grey: Grey) -> Iterator[tuple[str, Corners]]:
    """Read a code in the image and in the transposed one.

    The detector finds a transposed code not quite where it found the code, and one
    of five bands of a real panel it reads in one of the two alone. The result from
    both is transposed with the image.
    """
    yield from _detect(grey)
    for text, corners in _detect(np.ascontiguousarray(grey.T)):
        yield text, corners[:, ::-1]


def _detect(grey: Grey) -> Iterator[tuple[str, Corners]]:
    try:
        text, corners, _ = cv2.QRCodeDetector().detectAndDecodeBytes(grey)
    except cv2.error:  # some pictures without a code run into the detector's own assertions
        return
    if text and corners is not None:
        # a text may hold anything; a corner's number is its pixel's centre
        yield bytes(text).decode("ascii", errors="replace"), np.asarray(corners, float).reshape(4, 2) + 0.5


def _group(readings: Iterable[tuple[str, Corners]]) -> list[tuple[str, Corners]]:
    """Return each code once, its corners the median of its readings, whichever corner each began with."""
    groups: list[tuple[str, list[Corners]]] = []
    for text, corners in readings:
        same = next((group for name, group in groups if name == text and _overlap(corners, group[0])), None)
        if same is None:
            groups.append((text, [corners]))
        else:
            apart = np.linalg.norm(same[0][:, None] - corners[None], axis=2)
            same.append(corners[apart.argmin(axis=1)])
    return [(name, np.median(group, axis=0)) for name, group in groups]


def _overlap(one: Corners, other: Corners) -> bool:
    """Return True if two squares are the same object, seen twice."""
    apart = float(np.linalg.norm(one.mean(axis=0) - other.mean(axis=0)))
    return apart < 0.5 * float(np.linalg.norm(one[1] - one[0]))


def _find_square(plane: Plane, code: Corners, layout: _Layout) -> Corners | None:
    """Return the corners of the square within the panel: the one side of the code that looks like a panel."""
    across = (code[1] - code[0] + code[2] - code[3]) / 2.0
    down = (code[3] - code[0] + code[2] - code[1]) / 2.0
    printed = _sample(plane, code.mean(axis=0), across, down)
    if printed is None:
        return None
    black, white = np.percentile(printed, (5.0, 95.0))
    half = layout.side * SHRINK / 2.0
    seen = []
    for way in (across, -across, down, -down):
        centre = code.mean(axis=0) + layout.distance * way
        inner = _sample(plane, centre, 2.0 * half * across, 2.0 * half * down)
        if inner is not None and _looks_like_panel(inner, float(black), float(white)):
            turns = ((-1, -1), (1, -1), (1, 1), (-1, 1))
            seen.append(np.array([centre + half * (right * across + low * down) for right, low in turns]))
    return seen[0] if len(seen) == 1 else None


def _sample(plane: Plane, centre: Corners, across: Corners, down: Corners) -> Plane | None:
    """Sample a parallelogram of the image on a grid of 64 x 64; None if it leaves the image."""
    corners = np.array([centre + (a * across + d * down) / 2.0 for a in (-1, 1) for d in (-1, 1)])
    if corners.min() < 0.0 or (corners > plane.shape[::-1]).any():
        return None
    step = np.column_stack([across, down]) / _SAMPLES
    # of sample (0, 0), whose number is its centre's, as a pixel's is
    first = centre - (across + down) / 2.0 + step @ (0.5, 0.5) - 0.5
    grid = np.column_stack([step, first])
    size = (_SAMPLES, _SAMPLES)
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpAffine(plane, grid, size, flags=how, borderMode=cv2.BORDER_REPLICATE))


def _looks_like_panel(inner: Plane, black: float, white: float) -> bool:
    side = _SAMPLES // _CELLS
    cells = inner.reshape(_CELLS, side, _CELLS, side).mean(axis=(1, 3), dtype=float) - black
    bright = float(cells.mean()) >= DARKEST_PANEL * (white - black) > 0.0
    return bright and float(cells.std()) <= MOST_UNEVEN_REL * float(cells.mean())
