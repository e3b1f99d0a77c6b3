"""SVG documents, panels with two axes, and the layout of a picture of a map."""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Final, Self

from radiometry.drawing.text import write_tick

__all__ = ["BAR_PX", "WIDEST_PX", "document", "find_step"]

_STEPS = (1.0, 2.0, 5.0, 10.0)
_LEAST_TICKS, _MOST_TICKS = 3, 8
_ROUNDING_PX: Final = 1e-6
_STYLE = (
    "text{font:12px system-ui,sans-serif;fill:#222}.title{font-weight:600}.mid{text-anchor:middle}"
    ".end{text-anchor:end}.box{fill:none;stroke:#555}.tick{stroke:#ddd}"
    ".limit{fill:none;stroke:#888;stroke-dasharray:4 3}"
    "svg{background:#fff}"
)


def document(parts: Iterable[str], *, width_px: int, height_px: int, label: str, style: str = "") -> str:
    """Return an SVG document.

    Parameters
    ----------
    parts : iterable of str
        Elements.
    width_px, height_px : int
        Size.
    label : str
        Text for screen readers.
    style : str, optional
        CSS of classes that only this picture has.
    """
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width_px} {height_px}" width="{width_px}" '
        f'height="{height_px}" role="img" aria-label="{escape(label)}"><style>{_STYLE}{style}</style>'
        f"{''.join(parts)}</svg>"
    )


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Mapping of a value to a pixel along one axis."""

    low: float  # Ends of the axis
    high: float
    start_px: float  # Their pixels
    end_px: float
    logarithmic: bool = False  # True for a logarithmic scale
    is_downward: bool = False  # True if values are negated; ticks have no sign
    # Where ticks stand, with their texts; None for round numbers
    named: tuple[tuple[float, str], ...] | None = None

    def __call__(self, value: float) -> float:
        """Return the pixel of a value, which on a logarithmic scale is positive."""
        low, high, at = self.low, self.high, value
        if self.logarithmic:
            low, high, at = math.log(low), math.log(high), math.log(value)
        return self.start_px + (self.end_px - self.start_px) * (at - low) / (high - low)

    def part(self, low: float, high: float) -> Self:
        """Return the scale with other ends."""
        first, last = (math.log(self.low), math.log(self.high)) if self.logarithmic else (self.low, self.high)
        ends = (first + end * (last - first) for end in (low, max(high, low + 1e-3)))
        low, high = map(math.exp, ends) if self.logarithmic else ends
        return replace(self, low=low, high=high)

    def label(self, tick: float) -> str:
        """Return the text beside a tick."""
        if self.named is not None:
            return dict(self.named)[tick]
        step = 0.0 if self.logarithmic else self._even_step()
        return write_tick(abs(tick) if self.is_downward else tick, step=step)

    def ticks(self) -> list[float]:
        """Return the named ticks, else round values: 1, 2 and 5 in a power of ten, or even steps.

        Many powers of ten have 1 alone, or some of them; a part of one power has even steps.
        """
        if self.named is not None:
            return [at for at, _ in self.named if self.low <= at <= self.high]
        if self.logarithmic:
            powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            figures: list[float] = []
            for steps in (_STEPS[:3], _STEPS[:1]):
                found = [step * 10.0**power for power in powers for step in steps]
                figures = [figure for figure in found if self.low <= figure <= self.high]
                if len(figures) <= _MOST_TICKS:
                    break
            if len(figures) >= _LEAST_TICKS:
                return figures[:: math.ceil(len(figures) / _MOST_TICKS)]
        step = self._even_step()
        first = math.ceil(self.low / step - 1e-9)
        return [step * i for i in range(first, math.floor(self.high / step + 1e-9) + 1)]

    def _even_step(self) -> float:
        rough = (self.high - self.low) / 6
        power = 10.0 ** math.floor(math.log10(rough))
        return next(s * power for s in _STEPS if s * power >= rough * 0.999)

    def shows(self, value: float) -> bool:
        """Return True if a value has a place on the axis, within the limits or beyond."""
        return math.isfinite(value) and (value > 0.0 or not self.logarithmic)


def span(
    values: Iterable[float], *, logarithmic: bool = False, include: Sequence[float] = ()
) -> tuple[float, float]:
    """Return limits with a margin around the values."""
    known = [value for value in (*values, *include) if math.isfinite(value)]
    if logarithmic:
        known = [value for value in known if value > 0] or [1.0]
        return min(known) / 1.5, max(known) * 1.5
    low, high = min(known, default=0.0), max(known, default=1.0)
    air = 0.06 * (high - low) or 0.5 * abs(high) or 1.0
    return low - air, high + air


@dataclass(frozen=True, kw_only=True)
class Panel:
    """A frame with axes; what is drawn in it is clipped to it by staying within the limits."""

    x: Scale
    y: Scale
    title: str
    x_label: str
    y_label: str

    def frame(self) -> list[str]:
        """Return box, ticks and labels."""
        left, right = self.x.start_px, self.x.end_px
        bottom, top = self.y.start_px, self.y.end_px
        middle = (left + right) / 2
        size = f'width="{right - left:.1f}" height="{bottom - top:.1f}"'
        turned = f"translate({left - 46:.1f} {(top + bottom) / 2:.1f}) rotate(-90)"
        parts = [
            f'<rect class="box" x="{left:.1f}" y="{top:.1f}" {size}/>',
            f'<text class="title" x="{left:.1f}" y="{top - 8:.1f}">{escape(self.title)}</text>',
            f'<text class="mid" x="{middle:.1f}" y="{bottom + 34:.1f}">{escape(self.x_label)}</text>',
            f'<text class="mid" transform="{turned}">{escape(self.y_label)}</text>',
        ]
        taken = -math.inf
        for tick in sorted(self.x.ticks()):
            at, text = self.x(tick), self.x.label(tick)
            parts.append(f'<path class="tick" d="M{at:.1f} {bottom:.1f}V{top:.1f}"/>')
            # a text that would lie over the one before is left out
            if at - 3.5 * len(text) > taken:
                parts.append(f'<text class="mid" x="{at:.1f}" y="{bottom + 16:.1f}">{escape(text)}</text>')
                taken = at + 3.5 * len(text)
        for tick in self.y.ticks():
            at = self.y(tick)
            parts.append(f'<path class="tick" d="M{left:.1f} {at:.1f}H{right:.1f}"/>')
            parts.append(
                f'<text class="end" x="{left - 5:.1f}" y="{at + 4:.1f}">{escape(self.y.label(tick))}</text>'
            )
        return parts

    def line(self, points: Iterable[tuple[float, float]], css: str, *, dash: str = "none") -> str:
        """Return a line through points, cut at the limits; a point without a place on the axes breaks it."""
        dashes = "" if dash == "none" else f' stroke-dasharray="{dash}"'
        return "".join(
            f'<polyline class="{css}"{dashes} points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in run)}"/>'
            for run in self._cut(points)
        )

    def _cut(self, points: Iterable[tuple[float, float]]) -> Iterator[list[tuple[float, float]]]:
        """Yield the parts of a line that lie within the limits [px]."""
        places = [(self.x(x), self.y(y)) if self.x.shows(x) and self.y.shows(y) else None for x, y in points]
        run: list[tuple[float, float]] = []
        for start, end in itertools.pairwise(places):
            part = self._cut_segment(start, end) if start and end else None
            if run and (part is None or run[-1] != part[0]):
                yield run
                run = []
            if part is not None:
                run += part[1:] if run else part
        if run:
            yield run

    def _cut_segment(
        self, start: tuple[float, float], end: tuple[float, float]
    ) -> tuple[tuple[float, float], tuple[float, float]] | None:
        """Return the part of a segment that lies within the limits (Liang and Barsky), None if none does."""
        low, high = 0.0, 1.0
        for scale, a, b in zip((self.x, self.y), start, end, strict=True):
            least, most = sorted((scale.start_px, scale.end_px))
            least, most = least - _ROUNDING_PX, most + _ROUNDING_PX
            if a == b:
                if not least <= a <= most:
                    return None
                continue
            first, last = sorted(((least - a) / (b - a), (most - a) / (b - a)))
            low, high = max(low, first), min(high, last)
        if low > high:
            return None
        (x0, y0), (x1, y1) = start, end
        return (
            start if low == 0.0 else (x0 + low * (x1 - x0), y0 + low * (y1 - y0)),
            end if high == 1.0 else (x0 + high * (x1 - x0), y0 + high * (y1 - y0)),
        )

    def write(self, x: float, y: float, text: str, css: str = "mid note") -> str:
        return f'<text class="{css}" x="{self.x(x):.1f}" y="{self.y(y):.1f}">{escape(text)}</text>'

    def holds(self, x: float, y: float) -> bool:
        """Return True if a point lies within the limits."""
        return self.x.low <= x <= self.x.high and self.y.low <= y <= self.y.high


WIDEST_PX: Final = 1600  # Of the picture

BAR_PX: Final = 200  # Of its width: the bar and its labels


def find_step(width_px: int) -> int:
    """Return how many pixels of the map, along each side, are one of its picture.

    Parameters
    ----------
    width_px : int
        Width of the map.
    """
    return max(1, math.ceil(width_px / (WIDEST_PX - BAR_PX)))
