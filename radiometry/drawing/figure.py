"""Figures as data: what a method plots, before print or a page draws it."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Final

from radiometry.records import Record

MOST: Final = 100  # Figures of a plot that is printed whole


class Axis(Record):
    """An axis of a figure."""

    label: str  #: Quantity with its unit
    logarithmic: bool = False  #: True for a logarithmic scale; what is not positive is not drawn
    include: tuple[float, ...] = ()  #: Values within the limits beside those of the series
    #: Where ticks stand, with their texts; None for round numbers
    ticks: tuple[tuple[float, str], ...] | None = None
    is_time: bool = False  #: True for seconds since 1970, in UTC
    #: True if values are negated, as rows of a frame count downwards; ticks have no sign
    is_downward: bool = False


class Mark(Record):
    """A point with what is told of it."""

    x: float  #: Position
    y: float
    name: str  #: Name of the frame, or what the point stands for
    told: tuple[str, ...] = ()  #: Further lines of its card
    low: float | None = None  #: Ends of its error bar: in x if y is a list of names, else in y
    high: float | None = None
    frame_id: str = ""  #: Id of the frame, "" if it is of none
    left_out: str = ""  #: Reason why it is not used; it is drawn hollow then


class Series(Record):
    """Points, lines and bands of one colour."""

    name: str = ""  #: Name in the legend
    marks: tuple[Mark, ...] = ()
    line: tuple[tuple[float, float], ...] = ()  #: Line whose points count for the limits of the axes
    model: tuple[tuple[float, float], ...] = ()  #: Line that is cut at the limits
    #: x with the lower and upper y of a band; cut at the limits
    swath: tuple[tuple[float, float, float], ...] = ()
    place: int | None = None  #: Number of its colour; None for its place in the figure


class Cell(Record):
    """A rectangle of a map."""

    x: tuple[float, float]  #: Its sides
    y: tuple[float, float]
    share: float | None  #: Share of the full shade, negative in the other colour; None for an unknown value
    told: str  #: What its card says
    text: str = ""  #: What is printed in it


class Figure(Record):
    """A plot with two axes."""

    x: Axis
    y: Axis
    part: str = ""  #: Label among the figures of one plot; "" for the only one
    note: str = ""  #: Sentence below it
    series: tuple[Series, ...] = ()  #: What is drawn, in the order of the legend
    levels: tuple[float, ...] = ()  #: Dashed lines at a y and at an x
    uprights: tuple[float, ...] = ()
    band: tuple[float, float] | None = None  #: Shaded range of y
    cells: tuple[Cell, ...] = ()  #: Map behind the series
    moments: tuple[float, ...] = ()  #: Short strokes at the foot of the axes, at an x
    moments_are: str = ""  #: What the moments are of
    cuts_left_out: bool = False  #: True if points that are left out may lie beyond the axes in print, too

    def find_limits(self, *, in_print: bool) -> tuple[list[float], list[float]]:
        """Return the values that lie within the limits of the axes: those of x and of y, all finite.

        On a page, points that are left out may lie anywhere; they count only where all are left out.
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


class Plot(Record):
    """A plot of a version that its method declares."""

    name: str  # Name in its address, heading, and a sentence beside it
    title: str
    # `(stored result, rows) -> figures`; `rows()` reads the campaign's frames in the form that the fit takes,
    # for a plot that needs more than the result. Empty if there is nothing to draw.
    build: Callable[[dict[str, Any], Callable[[], Sequence[Any]]], Iterable[Figure]]
    note: str = ""
    is_wide: bool = False  # True for a plot that takes the whole width of a page
    leads: bool = False  # True for a plot that a page shows at once, while it folds those that do not
    most_printed: int = 0  # How many of its figures a certificate prints at most
