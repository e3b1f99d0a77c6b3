"""Search for a reflectance panel in a band's image: by its QR code, or where another band shows it."""

import math
import re
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame import Frame, FrameHeader, multispectral, roi
from radiometry.frame.opencv import cv2
from radiometry.records import Record
from radiometry.reflectance.alignment import move_region
from radiometry.specification.application import FoundBy

Corners = NDArray[np.float64]
Plane = NDArray[np.float32]
Grey = NDArray[np.uint8]

DARKEST_PANEL = 0.35  # of the way from the code's black to its white. Grass, soil and asphalt lie below 0.3

MOST_UNEVEN_REL, MOST_TILTED_REL = 0.05, 0.15
"""Of the square's 8 x 8 cells over their mean above black: scatter about a plane, and the plane's range."""

SAMPLES, CELLS = 64, 8
# a plane along the rows, of unit length
_RAMP = np.repeat(np.linspace(-1.0, 1.0, CELLS)[:, None], CELLS, axis=1)
_RAMP /= np.linalg.norm(_RAMP)
SHRINK = 0.65  # side of the region over the panel's: what is left absorbs a tilted panel and another lens

CLEARLY_LESS_EVEN = 2.0
"""Scatter of the second most even side over that of the first, where both look like a panel."""

SMALLEST_PX, MOST_OBLONG = 20.0, 2.0  # shortest side of a stated panel, and its longest over its shortest

LONGEST_SIDE_PX = 2600
"""A larger picture is made smaller first, by a whole factor: a code is found at any size, in less time."""

# two pairs of a wavelength in nm and a reflectance in thousandths
_ALBEDO = re.compile(r"(\d{4})(\d{3})(\d{4})(\d{3})$", re.ASCII)
_FIRST_LATE, _CORNERS = 3, 4
WIDEST_SHIFT = 0.12
"""Searched to either side of where the lens data put the panel, as a share of the frame's width."""

LEAST_CORRELATION, MOST_ALIKE = 0.5, 0.9
"""Of the place that fits best, and of the second best, as a share of it."""

_AROUND = 0.6  # of the region's size, added on each side: the panel's edges and part of its code
_BLUR_PX = 1.5


def sample_square(plane: Plane, centre: Corners, across: Corners, down: Corners) -> Plane | None:
    """Sample a parallelogram of the image on a grid of 64 x 64; None if it leaves the image."""
    corners = np.array([centre + (a * across + d * down) / 2.0 for a in (-1, 1) for d in (-1, 1)])
    if corners.min() < 0.0 or (corners > plane.shape[::-1]).any():
        return None
    step = np.column_stack([across, down]) / SAMPLES
    # of sample (0, 0), whose number is its centre's, as a pixel's is
    first = centre - (across + down) / 2.0 + step @ (0.5, 0.5) - 0.5
    grid = np.column_stack([step, first])
    size = (SAMPLES, SAMPLES)
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpAffine(plane, grid, size, flags=how, borderMode=cv2.BORDER_REPLICATE))


def is_even(plane: Plane, square: Corners, *, black_dn: float) -> bool:
    """Return True if a quadrilateral of an image shows one surface, brighter than black."""
    across = (square[1] - square[0] + square[2] - square[3]) / 2.0
    down = (square[3] - square[0] + square[2] - square[1]) / 2.0
    inner = sample_square(plane, square.mean(axis=0), across, down)
    return inner is not None and measure_unevenness(inner, black_dn, black_dn + 1.0) is not None


def measure_unevenness(inner: Plane, black: float, white: float) -> float | None:
    """Return the relative scatter of a square that is bright and even as a panel; None of another one."""
    side = SAMPLES // CELLS
    cells = inner.reshape(CELLS, side, CELLS, side).mean(axis=(1, 3), dtype=float) - black
    mean = float(cells.mean())
    # light may fall off evenly across it; a shadow's edge or a rim is no plane
    slopes = [float((cells * _RAMP).sum()), float((cells * _RAMP.T).sum())]
    rest = cells - mean - slopes[0] * _RAMP - slopes[1] * _RAMP.T
    tilt = float(np.ptp(slopes[0] * _RAMP + slopes[1] * _RAMP.T))
    bright = mean >= DARKEST_PANEL * (white - black) > 0.0
    uneven = float(rest.std()) / mean if bright else math.inf
    return uneven if uneven <= MOST_UNEVEN_REL and tilt <= MOST_TILTED_REL * mean else None


class FoundPanel(Record):
    """A panel that was found."""

    region: roi.Polygon | None  # well within the panel; None if its place is not certain
    serial: str | None  # None if no code was read
    by: FoundBy = "code"
    text: str = ""  # of the code

    def read_albedo(self, wavelength_nm: float | None) -> float | None:
        """Return the reflectance that the code states for a wavelength.

        [1] MicaSense, reflectance_from_panel_serial in micasense/imageprocessing, panel.py
        """
        stated = _ALBEDO.search(self.text)
        if stated is None or wavelength_nm is None:
            return None
        low, r_low, high, r_high = map(float, stated.groups())
        if not low <= wavelength_nm <= high or low == high:
            return None
        albedo = float(np.interp(wavelength_nm, (low, high), (r_low, r_high))) / 1000.0
        return albedo if 0.0 < albedo <= 1.0 else None


class _Layout(Record):
    """Position of the panel beside its code, in sides of the code."""

    distance: float
    side: float


# of panels up to RP02, and from RP03 on
_EARLY, _LATE = _Layout(distance=1.68, side=1.30), _Layout(distance=1.57, side=0.75)


def find_panel(samples_dn: NDArray[np.uint16]) -> FoundPanel | None:
    """Find the one panel that an image shows, by the QR code beside it.

    The centre of the panel lies D sides of the code from the code's centre, across one of its four sides; a
    panel measures S of them::

        up to RP02   D = 1.68, S = 1.30          from RP03 on   D = 1.57, S = 0.75

    The image determines which side it is: of the four squares one must be bright (35 % of the way from the
    code's black to its white) and even (5 %, about a plane of at most 15 %), and each other one that is must
    scatter twice as much. Position, size and rotation follow from the code's corners; the returned square is
    0.65 S wide, in the middle of the panel. The first layout was measured on RP02-1603036-SC, five bands; the
    manufacturer's reference points [1] agree within 0.01. The second is from the same reference points and
    was tested on no image of our own.

    A code's corners are found to a pixel or two. It is searched in a linear stretch of the image to 8 bits
    enlarged twofold, in the same as it is, in one enlarged threefold and sharpened, in one of local contrast,
    and in one of the bright half; it needs 2 px a module. A transposed image gives the transposed region.

    [1] MicaSense, reference points in micasense/imageprocessing, panel.py
    """
    plane, factor = _shrink(samples_dn)
    if plane is None:
        return None
    read = _read_codes(plane)
    names = {multispectral.name_panel(text) for text, _ in read}
    if len(names) != 1:
        return None
    (name,) = names
    layout = _EARLY if int(name[2:4]) < _FIRST_LATE else _LATE
    square = _find_square(plane, read[0][1], layout) if len(read) == 1 else None
    # a tenth of a pixel is finer than the corners are known
    region = None if square is None else roi.Polygon.from_points(np.round(square * factor, 1).tolist())
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
            if serial := multispectral.PANEL_SERIAL.search(code.text):
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
    """Take the region that a camera states for the panel that it has recognised (`ReflectArea`)."""
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
        region=roi.Polygon.from_points(np.round(square, 1).tolist()), serial=None, by="reflect_area"
    )


def take_region(
    frame: Frame, *, header: FrameHeader, other: Frame, other_header: FrameHeader, region: roi.Polygon
) -> tuple[roi.Polygon, float] | None:
    """Find a panel where another band of the same capture has found it.

    `RigRelatives` give the rotation between the bands, which places the panel as if it were far away; where a
    file states none, the same pixels are the start. The lenses lie side by side, so that a panel at 1 m
    appears tens of pixels further: the edges around the region (gradients, which do not depend on the band's
    brightness) are searched for within 12 % of the frame's width. On five bands of a real panel capture the
    region lies within 4 px of the one that the code of each band gives.
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
    return roi.Polygon.from_points(np.round(moved, 1).tolist()), float(peak)


def _find_edges(samples_dn: NDArray[np.uint16]) -> Plane:
    """Return the size of the gradient of the logarithm: it is the same at any exposure."""
    plane = cv2.GaussianBlur(np.log(samples_dn.astype(np.float32) + 1.0), (0, 0), _BLUR_PX)
    return np.asarray(np.hypot(cv2.Sobel(plane, cv2.CV_32F, 1, 0), cv2.Sobel(plane, cv2.CV_32F, 0, 1)))
