"""A panel with two axes in SVG: enough for a calibration's plots, and nothing that runs."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Self

_STEPS = (1.0, 2.0, 5.0, 10.0)
_LEAST_TICKS, _MOST_TICKS = 3, 8
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
    """Mapping of a value to a pixel along one axis.

    Attributes
    ----------
    low, high : float
        Ends of the axis.
    start_px, end_px : float
        Their pixels.
    logarithmic : bool
        True for a logarithmic scale.
    is_downward : bool
        True if values are negated; ticks have no sign.
    named : tuple of (float, str) or None
        Where ticks stand, with their texts; None for round numbers.
    """

    low: float
    high: float
    start_px: float
    end_px: float
    logarithmic: bool = False
    is_downward: bool = False
    named: tuple[tuple[float, str], ...] | None = None

    def __call__(self, value: float) -> float:
        """Return the pixel of a value, which on a logarithmic scale is positive."""
        low, high, at = self.low, self.high, value
        if self.logarithmic:
            low, high, at = math.log(low), math.log(high), math.log(value)
        return self.start_px + (self.end_px - self.start_px) * (at - low) / (high - low)

    def part(self, low: float, high: float) -> Self:
        """Return the scale with other ends.

        Parameters
        ----------
        low, high : float
            Ends as fractions of the present ones; at least a thousandth apart.
        """
        first, last = (math.log(self.low), math.log(self.high)) if self.logarithmic else (self.low, self.high)
        ends = (first + end * (last - first) for end in (low, max(high, low + 1e-3)))
        low, high = map(math.exp, ends) if self.logarithmic else ends
        return replace(self, low=low, high=high)

    def label(self, tick: float) -> str:
        """Return the text beside a tick.

        Parameters
        ----------
        tick : float
            Value of the tick.
        """
        if self.named is not None:
            return dict(self.named)[tick]
        return f"{abs(tick) if self.is_downward else tick:g}"

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
        rough = (self.high - self.low) / 6
        power = 10.0 ** math.floor(math.log10(rough))
        step = next(s * power for s in _STEPS if s * power >= rough * 0.999)
        first = math.ceil(self.low / step - 1e-9)
        return [step * i for i in range(first, math.floor(self.high / step + 1e-9) + 1)]


def span(
    values: Iterable[float], *, logarithmic: bool = False, include: Sequence[float] = ()
) -> tuple[float, float]:
    """Return limits with a margin around the values.

    Parameters
    ----------
    values : iterable of float
        Shown values.
    logarithmic : bool, optional
        True if only positive values are shown.
    include : sequence of float, optional
        Further values within the limits.
    """
    known = [*values, *include]
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

    def line(self, points: Iterable[tuple[float, float]], css: str) -> str:
        """Return a polyline through those points that lie within the limits.

        Parameters
        ----------
        points : iterable of (float, float)
            x and y.
        css : str
            Class.
        """
        shown = [f"{self.x(x):.1f},{self.y(y):.1f}" for x, y in points if self.holds(x, y)]
        return f'<polyline class="{css}" points="{" ".join(shown)}"/>'

    def write(self, x: float, y: float, text: str, css: str = "mid note") -> str:
        """Return a text at a point.

        Parameters
        ----------
        x, y : float
            Position.
        text : str
            Text.
        css : str, optional
            Classes.
        """
        return f'<text class="{css}" x="{self.x(x):.1f}" y="{self.y(y):.1f}">{escape(text)}</text>'

    def holds(self, x: float, y: float) -> bool:
        """Return True if a point lies within the limits.

        Parameters
        ----------
        x, y : float
            Position.
        """
        return self.x.low <= x <= self.x.high and self.y.low <= y <= self.y.high
