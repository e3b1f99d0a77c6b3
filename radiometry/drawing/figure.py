"""Figures as data: what a method plots, before print or a page draws it."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

MOST: Final = 100
"""Figures of a plot that is printed whole."""


@dataclass(frozen=True, kw_only=True)
class Axis:
    """An axis of a figure.

    Attributes
    ----------
    label : str
        Quantity with its unit.
    logarithmic : bool
        True for a logarithmic scale; what is not positive is not drawn.
    include : tuple of float
        Values within the limits beside those of the series.
    ticks : tuple of (float, str) or None
        Where ticks stand, with their texts; None for round numbers.
    is_time : bool
        True for seconds since 1970, in UTC.
    is_downward : bool
        True if values are negated, as rows of a frame count downwards; ticks have no sign.
    """

    label: str
    logarithmic: bool = False
    include: tuple[float, ...] = ()
    ticks: tuple[tuple[float, str], ...] | None = None
    is_time: bool = False
    is_downward: bool = False


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A point with what is told of it.

    Attributes
    ----------
    x, y : float
        Position.
    name : str
        Name of the frame, or what the point stands for.
    told : tuple of str
        Further lines of its card.
    low, high : float or None
        Ends of its error bar: in x if y is a list of names, else in y.
    frame_id : str
        Id of the frame, "" if it is of none.
    left_out : str
        Reason why it is not used; it is drawn hollow then.
    """

    x: float
    y: float
    name: str
    told: tuple[str, ...] = ()
    low: float | None = None
    high: float | None = None
    frame_id: str = ""
    left_out: str = ""


@dataclass(frozen=True, kw_only=True)
class Series:
    """Points, lines and bands of one colour.

    Attributes
    ----------
    name : str
        Name in the legend.
    marks : tuple of Mark
        Points.
    line : tuple of (float, float)
        Line whose points count for the limits of the axes.
    model : tuple of (float, float)
        Line that is cut at the limits.
    swath : tuple of (float, float, float)
        x with the lower and upper y of a band; cut at the limits.
    place : int or None
        Number of its colour; None for its place in the figure.
    """

    name: str = ""
    marks: tuple[Mark, ...] = ()
    line: tuple[tuple[float, float], ...] = ()
    model: tuple[tuple[float, float], ...] = ()
    swath: tuple[tuple[float, float, float], ...] = ()
    place: int | None = None


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A rectangle of a map.

    Attributes
    ----------
    x, y : (float, float)
        Its sides.
    share : float or None
        Share of the full shade, negative in the other colour; None for an unknown value.
    told : str
        What its card says.
    text : str
        What is printed in it.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    share: float | None
    told: str
    text: str = ""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A plot with two axes.

    Attributes
    ----------
    part : str
        Label among the figures of one plot; "" for the only one.
    note : str
        Sentence below it.
    series : tuple of Series
        What is drawn, in the order of the legend.
    levels, uprights : tuple of float
        Dashed lines at a y and at an x.
    band : (float, float) or None
        Shaded range of y.
    cells : tuple of Cell
        Map behind the series.
    moments : tuple of float
        Short strokes at the foot of the axes, at an x.
    moments_are : str
        What the moments are of.
    cuts_left_out : bool
        True if points that are left out may lie beyond the axes in print, too.
    is_to_scale : bool
        True if a unit is as long in x as in y.
    """

    x: Axis
    y: Axis
    part: str = ""
    note: str = ""
    series: tuple[Series, ...] = ()
    levels: tuple[float, ...] = ()
    uprights: tuple[float, ...] = ()
    band: tuple[float, float] | None = None
    cells: tuple[Cell, ...] = ()
    moments: tuple[float, ...] = ()
    moments_are: str = ""
    cuts_left_out: bool = False
    is_to_scale: bool = False

    def find_limits(self, *, in_print: bool) -> tuple[list[float], list[float]]:
        """Return the values that lie within the limits of the axes: those of x and of y, all finite.

        On a page, points that are left out may lie anywhere; they count only where all are left out.

        Parameters
        ----------
        in_print : bool
            True: points that are left out count, too, unless the figure cuts them.
        """
        marks = [mark for each in self.series for mark in each.marks]
        if self.cuts_left_out or not in_print:
            marks = [mark for mark in marks if not mark.left_out] or marks
        ends = [end for mark in marks for end in (mark.low, mark.high) if end is not None]
        lines = [point for each in self.series for point in each.line]
        xs = [*self._along(marks, lines, 0), *(end for cell in self.cells for end in cell.x)]
        ys = [*self._along(marks, lines, 1), *(end for cell in self.cells for end in cell.y)]
        (xs if self.y.ticks else ys).extend(ends)
        both = ([*xs, *self.x.include], [*ys, *self.y.include])
        xs, ys = ([value for value in values if math.isfinite(value)] for values in both)
        return xs, ys

    @staticmethod
    def _along(marks: list[Mark], lines: list[tuple[float, float]], axis: int) -> Iterator[float]:
        yield from ((mark.x, mark.y)[axis] for mark in marks)
        yield from (point[axis] for point in lines)


@dataclass(frozen=True, kw_only=True)
class Plot:
    """A plot of a version that its method declares.

    Attributes
    ----------
    name, title, note : str
        Name in its address, heading, and a sentence beside it.
    build : callable
        ``(stored result, rows) -> figures``; ``rows()`` reads the campaign's frames in the form
        that the fit takes, for a plot that needs more than the result. Empty if there is nothing to draw.
    is_wide : bool
        True for a plot that takes the whole width of a page.
    most_printed : int
        How many of its figures a certificate prints at most.
    """

    name: str
    title: str
    build: Callable[[dict[str, Any], Callable[[], Sequence[Any]]], Iterable[Figure]]
    note: str = ""
    is_wide: bool = False
    most_printed: int = 0
