"""The map's picture: false colours on a logarithmic or an even scale, with a bar, its ticks and the unit."""

import io
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from radiometry.drawing.chart import BAR_PX, find_step

COLOURS = 256

_LIGHTNESS = (0.18, 0.95)
_HUES_DEG = (300.0, 105.0)
_CHROMA = 0.16

Table = NDArray[np.uint8]


def make_colours() -> Table:
    share = np.linspace(0.0, 1.0, COLOURS)
    lightness = _LIGHTNESS[0] + (_LIGHTNESS[1] - _LIGHTNESS[0]) * share
    # the short way round, through red
    hue = np.radians(_HUES_DEG[0] + (_HUES_DEG[1] + 360.0 - _HUES_DEG[0]) * share)
    linear = np.empty((COLOURS, 3))
    for index in range(COLOURS):
        linear[index] = _strongest(lightness[index], hue[index])
    curved = 1.055 * np.maximum(linear, 0.0) ** (1 / 2.4) - 0.055
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, curved)
    return np.round(255 * np.clip(encoded, 0.0, 1.0)).astype(np.uint8)


def _strongest(lightness: float, hue: float) -> NDArray[np.float64]:
    """The most colourful screen colour of a lightness and a hue, up to the scale's chroma: by halving."""
    low, high = 0.0, _CHROMA
    for _ in range(24):
        middle = (low + high) / 2
        linear = to_linear_rgb(lightness, middle * np.cos(hue), middle * np.sin(hue))
        inside = bool(np.all((linear >= 0.0) & (linear <= 1.0)))
        low, high = (middle, high) if inside else (low, middle)
    return to_linear_rgb(lightness, low * np.cos(hue), low * np.sin(hue))


def to_linear_rgb(lightness: float, a: float, b: float) -> NDArray[np.float64]:
    """Oklab to linear sRGB."""
    cones = np.array(
        [
            lightness + 0.3963377774 * a + 0.2158037573 * b,
            lightness - 0.1055613458 * a - 0.0638541728 * b,
            lightness - 0.0894841775 * a - 1.2914855480 * b,
        ]
    )
    matrix = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    return np.asarray(matrix @ cones**3, np.float64)


_MARGIN_PX: Final = 16
_FONT_PX: Final = 26
_LOW_PERCENTILE, _HIGH_PERCENTILE = 0.5, 99.9
_SATURATED: Final = (0, 200, 255)  # no colour of the scale
_INK: Final = (20, 20, 20)
_PAPER: Final = (255, 255, 255)
_LEAST_DECADES: Final = 0.3

Plane = NDArray[np.float32]


@dataclass(frozen=True)
class Part:
    """Sums that a band adds to the squares of the lines [first, first + len(sums)), and its odd pixels."""

    first: int
    sums: NDArray[np.float32]
    odd: NDArray[np.int64]


class Reduction:
    """Means over whole squares of a map, band by band; a square with an unknown pixel is unknown."""

    def __init__(self, height_px: int, width_px: int, *, counts: bool = True) -> None:
        self.factor = find_step(width_px)
        self.shape = max(1, height_px // self.factor), max(1, width_px // self.factor)
        self._sums = np.zeros(self.shape, np.float64)
        self._counts = counts
        self.odd = np.zeros(3, np.int64)  # pixels below 0, above 1 and unknown

    def reduce(self, band: Plane, *, top: int) -> Part:
        """A band's own part; changes nothing, so that several threads may do it."""
        rows, cols = self.shape
        looked = (band < 0.0, band > 1.0, np.isnan(band)) if self._counts else (0, 0, 0)
        odd = np.array([np.count_nonzero(found) for found in looked])
        used = band[: max(0, rows * self.factor - top), : cols * self.factor]
        if not len(used):
            return Part(rows, np.empty((0, cols), np.float32), odd)
        if self.factor == 1:
            return Part(top, used, odd)
        # lines first: whole lines add up faster than the few pixels of a square
        lines = _add_lines(used, self.factor, skipped=top % self.factor)
        sums = lines[:, :: self.factor].copy()
        for offset in range(1, self.factor):
            sums += lines[:, offset :: self.factor]
        return Part(top // self.factor, sums, odd)

    def add(self, part: Part) -> None:
        self._sums[part.first : part.first + len(part.sums)] += part.sums
        self.odd += part.odd

    def means(self) -> NDArray[np.float64]:
        """(row, col), in the map's unit, NaN where unknown."""
        return self._sums / self.factor**2


def _add_lines(band: Plane, factor: int, *, skipped: int) -> Plane:
    """Add up the lines of each row of squares; the first row has lost so many, and the last may be cut."""
    count = -(-(skipped + len(band)) // factor)
    lines = np.zeros((count, band.shape[1]), np.float32)
    for offset in range(factor):
        first = (offset - skipped) % factor
        found = band[first::factor]
        start = int(offset < skipped)
        lines[start : start + len(found)] += found
    return lines


@dataclass(frozen=True, kw_only=True)
class Style:
    """Appearance of a map. ``ends`` : of an even scale; None: logarithmic, its ends chosen from the map."""

    unit: str
    unknown: str = "saturated"
    ends: tuple[float, float] | None = None


LUMINANCE: Final = Style(unit="cd/m2")  # the font that Pillow brings along has no ²
REFLECTANCE: Final = Style(unit="R", ends=(0.0, 1.0))


@dataclass(frozen=True)
class Scale:
    """The numbers at the two ends of the colours; both > 0 where it is logarithmic."""

    low: float
    high: float
    logarithmic: bool = True

    def share(self, values: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """How far along the colours each number lies: 0 at the low end, 1 at the high."""
        if not self.logarithmic:
            return np.asarray((np.asarray(values) - self.low) / (self.high - self.low))
        decades = math.log10(self.high / self.low)
        return np.asarray(np.log10(np.maximum(values, self.low) / self.low) / decades)

    def place(self, values: NDArray[np.float64]) -> NDArray[np.intp]:
        """The index of each number's colour; beyond the ends that of the end."""
        return np.clip((self.share(values) * COLOURS).astype(np.intp), 0, COLOURS - 1)

    def ticks(self) -> list[float]:
        """Round numbers within: 1, 2, 5, 10, ..., or decades only where those are many; or even fifths."""
        if not self.logarithmic:
            return [round(self.low + n * (self.high - self.low) / 5.0, 6) for n in range(6)]
        decades = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        steps = (1, 2, 5) if self.high / self.low < 1e4 else (1,)
        numbers = [step * 10.0**decade for decade in decades for step in steps]
        return [number for number in numbers if self.low * 0.999 <= number <= self.high * 1.001]


def choose_scale(means: NDArray[np.float64], style: Style = LUMINANCE) -> Scale:
    """The style's own ends, or the 0.5th and 99.9th percentile of what is above zero: lamps are few."""
    if style.ends is not None:
        return Scale(*style.ends, logarithmic=False)
    lit = means[np.isfinite(means) & (means > 0.0)]
    if not lit.size:
        return Scale(0.1, 1.0)
    low, high = np.percentile(lit, [_LOW_PERCENTILE, _HIGH_PERCENTILE]).tolist()
    missing = _LEAST_DECADES - math.log10(high / low)
    if missing > 0.0:
        low, high = low / 10 ** (missing / 2), high * 10 ** (missing / 2)
    return Scale(low, high)


def draw_picture(means: NDArray[np.float64], caption: str, style: Style = LUMINANCE) -> bytes:
    """PNG: the map, to its right the bar from the lowest to the highest number, below the caption."""
    height, width = means.shape
    scale, table = choose_scale(means, style), make_colours()
    unknown = np.isnan(means)
    pixels = table[scale.place(np.where(unknown, scale.low, means))]
    pixels[unknown] = _SATURATED
    tall = max(height, 240)
    image = Image.new("RGB", (width + BAR_PX, tall + 3 * _FONT_PX), _PAPER)
    image.paste(Image.fromarray(pixels), (0, 0))
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(_FONT_PX)
    draw.text((width + _MARGIN_PX, _FONT_PX), style.unit, fill=_INK, font=font)
    _draw_bar(image, scale, left=width + _MARGIN_PX, height=tall, table=table)
    note = f"{caption}{'; blue: {style.unknown}' if unknown.any() else ''}"
    draw.text((_MARGIN_PX, tall + _FONT_PX), note, fill=_INK, font=font)
    out = io.BytesIO()
    image.save(out, "PNG", compress_level=1)
    return out.getvalue()


def _draw_bar(image: Image.Image, scale: Scale, *, left: int, height: int, table: Table) -> None:
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(_FONT_PX)
    top, bottom = 3 * _FONT_PX, height - _FONT_PX
    rows = np.arange(bottom - top)
    shown = table[(COLOURS - 1) - rows * COLOURS // len(rows)]
    image.paste(Image.fromarray(np.repeat(shown[:, None], 2 * _MARGIN_PX, axis=1)), (left, top))
    draw.rectangle((left, top, left + 2 * _MARGIN_PX, bottom), outline=_INK)
    lowest = math.inf
    for tick in scale.ticks():
        y = bottom - float(scale.share(tick)) * (bottom - top)
        draw.line((left + 2 * _MARGIN_PX, y, left + 2 * _MARGIN_PX + 6, y), fill=_INK)
        # a text that would lie over the one before is left out
        if lowest - y >= _FONT_PX:
            draw.text((left + 2 * _MARGIN_PX + 10, y), f"{tick:g}", fill=_INK, font=font, anchor="lm")
            lowest = y
