"""Search for a reflectance panel with a QR code in a band's image."""

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.bands import PANEL_SERIAL, name_panel
from radiometry.frame.opencv import cv2
from radiometry.frame.roi import Polygon
from radiometry.reflectance.panel_surface import (
    CELLS,
    SAMPLES,
    Corners,
    Plane,
    is_even,
    measure_unevenness,
    sample_square,
)
from radiometry.specification.application import FoundBy

SHRINK = 0.65
"""Side of the region over the panel's: what is left absorbs a tilted panel and another lens."""

CLEARLY_LESS_EVEN = 2.0
"""Scatter of the second most even side over that of the first, where both look like a panel."""

SMALLEST_PX, MOST_OBLONG = 20.0, 2.0
"""Shortest side of a stated panel, and its longest over its shortest."""

LONGEST_SIDE_PX = 2600
"""A larger picture is made smaller first, by a whole factor: a code is found at any size, in less time."""

# two pairs of a wavelength in nm and a reflectance in thousandths
_ALBEDO = re.compile(r"(\d{4})(\d{3})(\d{4})(\d{3})$", re.ASCII)
_FIRST_LATE, _CORNERS = 3, 4

Grey = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class FoundPanel:
    """A panel that was found.

    Attributes
    ----------
    region : Polygon or None
        Square well within the panel [px]; None if its place is not certain.
    serial : str or None
        Name of the panel in the code; None if no code was read.
    by : FoundBy
        How it was found.
    text : str, default: ""
        Text of the code.
    """

    region: Polygon | None
    serial: str | None
    by: FoundBy = "code"
    text: str = ""

    def read_albedo(self, wavelength_nm: float | None) -> float | None:
        """Return the reflectance that the code states for a wavelength.

        Parameters
        ----------
        wavelength_nm : float or None
            Centre wavelength of a band [nm].

        Returns
        -------
        float or None
            On the line through the two points at the end of the code, as the
            manufacturer's library [1]_ reads it; None if there are none, or the band
            lies beside them.

        References
        ----------
        .. [1] MicaSense, reflectance_from_panel_serial in micasense/imageprocessing, panel.py
        """
        stated = _ALBEDO.search(self.text)
        if stated is None or wavelength_nm is None:
            return None
        low, r_low, high, r_high = map(float, stated.groups())
        if not low <= wavelength_nm <= high or low == high:
            return None
        albedo = float(np.interp(wavelength_nm, (low, high), (r_low, r_high))) / 1000.0
        return albedo if 0.0 < albedo <= 1.0 else None


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
        None if no code names a panel (RPnn-nnnnnnn-AA), or codes name several. No
        region if the square leaves the image, no side or several look like a panel,
        or two codes are visible.

    Notes
    -----
    The centre of the panel lies D sides of the code from the code's centre, across
    one of its four sides; a panel measures S of them::

        up to RP02   D = 1.68, S = 1.30          from RP03 on   D = 1.57, S = 0.75

    The image determines which side it is: of the four squares one must be bright
    (35 % of the way from the code's black to its white) and even (5 %, about a plane
    of at most 15 %), and each other one that is must scatter twice as much.
    Position, size and rotation follow from the code's corners; the returned square
    is 0.65 S wide, in the middle of the panel. The first layout was measured on
    RP02-1603036-SC, five bands; the manufacturer's reference points [1]_ agree
    within 0.01. The second is from the same reference points and was tested on no
    image of our own.

    A code's corners are found to a pixel or two. It is searched in a linear stretch
    of the image to 8 bits enlarged twofold, in the same as it is, in one enlarged
    threefold and sharpened, in one of local contrast, and in one of the bright half;
    it needs 2 px a module. A transposed image gives the transposed region.

    References
    ----------
    .. [1] MicaSense, reference points in micasense/imageprocessing, panel.py
    """
    plane, factor = _shrink(samples_dn)
    if plane is None:
        return None
    read = _read_codes(plane)
    names = {name_panel(text) for text, _ in read}
    if len(names) != 1:
        return None
    (name,) = names
    layout = _EARLY if int(name[2:4]) < _FIRST_LATE else _LATE
    square = _find_square(plane, read[0][1], layout) if len(read) == 1 else None
    # a tenth of a pixel is finer than the corners are known
    region = None if square is None else Polygon.from_points(np.round(square * factor, 1).tolist())
    return FoundPanel(region=region, serial=name, text=read[0][0])


def _shrink(samples_dn: NDArray[np.uint16]) -> tuple[Plane | None, int]:
    """Return the image at the size that is searched, and the factor; None for a colour or a tiny image."""
    if samples_dn.ndim != 2 or min(samples_dn.shape) < SAMPLES:
        return None, 1
    factor = math.ceil(max(samples_dn.shape) / LONGEST_SIDE_PX)
    height, width = (side // factor for side in samples_dn.shape)
    if min(height, width) < 1:
        return None, 1
    whole = np.ascontiguousarray(samples_dn[: height * factor, : width * factor])
    plane = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA) if factor > 1 else whole
    return plane.astype(np.float32), factor


def _read_codes(plane: Plane) -> list[tuple[str, Corners]]:
    """Return the text of every panel's code that is read, once, with its corners (x, y) [px]."""
    for grey, scale in _stretch(plane):
        if found := _group((text, corners / scale) for text, corners in _search(grey)):
            return found
    return []


def _stretch(plane: Plane) -> Iterator[tuple[Grey, float]]:
    """Yield 8-bit images to search, the one that most codes are found in first, each with its scale."""
    low, middle, high = (float(level) for level in np.percentile(plane, (0.1, 50.0, 99.9)))
    if high <= low:
        return
    grey = np.clip((plane - low) * (255.0 / (high - low)), 0.0, 255.0).astype(np.uint8)
    # corners are whole pixels of what is searched
    yield cv2.resize(grey, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_CUBIC).astype(np.uint8), 2.0
    yield grey, 1.0
    # a blurred edge of one pixel hides the modules of a small code
    large = cv2.resize(grey, None, fx=3.0, fy=3.0, interpolation=cv2.INTER_CUBIC)
    sharp = cv2.addWeighted(large, 3.0, cv2.GaussianBlur(large, (0, 0), 3.0), -2.0, 0.0)
    yield sharp.astype(np.uint8), 3.0
    yield cv2.createCLAHE(4.0, (CELLS, CELLS)).apply(grey).astype(np.uint8), 1.0
    if high > middle:
        yield np.clip((plane - middle) * (255.0 / (high - middle)), 0.0, 255.0).astype(np.uint8), 1.0


def _search(grey: Grey) -> Iterator[tuple[str, Corners]]:
    """Read the codes of panels in the image and in the transposed one, so that either gives the same."""
    import zxingcpp

    codes = zxingcpp.BarcodeFormats(zxingcpp.BarcodeFormat.QRCode)
    for image, way in ((grey, 1), (np.ascontiguousarray(grey.T), -1)):
        for code in zxingcpp.read_barcodes(image, formats=codes):
            if serial := PANEL_SERIAL.search(code.text):
                at = code.position
                corners = [(c.x, c.y) for c in (at.top_left, at.top_right, at.bottom_right, at.bottom_left)]
                yield code.text[serial.start() :].strip(), np.array(corners, float)[:, ::way]


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
    printed = sample_square(plane, code.mean(axis=0), across, down)
    if printed is None:
        return None
    black, white = np.percentile(printed, (5.0, 95.0))
    half = layout.side * SHRINK / 2.0
    seen = []
    for way in (across, -across, down, -down):
        centre = code.mean(axis=0) + layout.distance * way
        inner = sample_square(plane, centre, 2.0 * half * across, 2.0 * half * down)
        uneven = measure_unevenness(inner, float(black), float(white)) if inner is not None else None
        if uneven is not None:
            turns = ((-1, -1), (1, -1), (1, 1), (-1, 1))
            square = [centre + half * (right * across + low * down) for right, low in turns]
            seen.append((uneven, np.array(square)))
    seen.sort(key=lambda each: each[0])
    sure = len(seen) == 1 or (len(seen) > 1 and seen[1][0] > CLEARLY_LESS_EVEN * seen[0][0])
    return seen[0][1] if sure else None


def find_stated_panel(
    samples_dn: NDArray[np.uint16], corners: tuple[tuple[float, float], ...], *, black_dn: float
) -> FoundPanel | None:
    """Take the region that a camera states for the panel that it has recognised (`ReflectArea`).

    Parameters
    ----------
    samples_dn : ndarray of uint16
        Raw values [DN], (row, col).
    corners : tuple of tuple[float, float]
        Corners (x, y) of the panel in the frame [px], in any order.
    black_dn : float
        Black level [DN].

    Returns
    -------
    FoundPanel or None
        Square of 0.65 of its side in the middle; None unless they are a convex
        quadrilateral within the frame, of 20 px to half the frame's side and sides
        alike within a factor of 2, and what it shows is even.
    """
    height, width = samples_dn.shape[:2]
    panel = cv2.convexHull(np.array(corners, np.float32)).reshape(-1, 2).astype(float)
    if len(panel) != _CORNERS or panel.min() < 0.0 or (panel > (width, height)).any():
        return None
    sides = np.linalg.norm(panel - np.roll(panel, 1, axis=0), axis=1)
    largest = min(height, width) / 2.0
    if not SMALLEST_PX <= sides.min() <= sides.max() <= min(largest, MOST_OBLONG * sides.min()):
        return None
    middle = panel.mean(axis=0)
    square = middle + SHRINK * (panel - middle)
    if not is_even(samples_dn.astype(np.float32), square, black_dn=black_dn):
        return None
    return FoundPanel(
        region=Polygon.from_points(np.round(square, 1).tolist()), serial=None, by="reflect_area"
    )
