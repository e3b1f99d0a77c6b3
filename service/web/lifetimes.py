"""Figures of versions in time: a coefficient with its intervals, and what became of each version."""

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Final

from radiometry.drawing.figure import Axis, Cell, Figure, Mark, Series
from radiometry.drawing.text import label_axis, write_quantity
from store.queries.calibrations import Lifetime
from store.tables import CoefficientRow, Publication

_HOLDS, _REVOKED, _PUBLISHED, _ENDED = 0, 1, 2, 5
_HALF_ROW: Final = 0.3


def build_values(
    found: Sequence[Lifetime], where: dict[str, str | float | None], *, label: str, until: datetime
) -> Figure:
    """Return one coefficient of each version while it is in force; bars are twice its standard uncertainty.

    ``where`` : columns of the coefficient; ``until`` : where a time without an end is cut
    """
    shown = [(each, row) for each in reversed(found) if (row := find(each, where)) is not None]
    series = [each for lifetime, row in shown for each in _draw_value(lifetime, row, until)]
    for place, name in ((_HOLDS, "in force"), (_REVOKED, "revoked")):
        if any(each.place == place for each in series):
            series.append(Series(name=name, place=place))
    y = Axis(label=label_axis(label, shown[0][1].unit if shown else "1"))
    return Figure(x=_time(found, until), y=y, series=tuple(series))


def find(lifetime: Lifetime, where: dict[str, str | float | None]) -> CoefficientRow | None:
    """Return the coefficient of a version with these columns."""
    rows = lifetime.coefficients
    return next(
        (row for row in rows if all(getattr(row, name) == value for name, value in where.items())), None
    )


def _draw_value(lifetime: Lifetime, row: CoefficientRow, until: datetime) -> Iterator[Series]:
    low, high = (row.value + sign * 2.0 * row.standard_uncertainty for sign in (-1, 1))
    for place, rows in ((_HOLDS, lifetime.in_force), (_REVOKED, lifetime.revoked_from)):
        for n, period in enumerate(rows):
            start, end = _ends(period, until)
            told = [
                write_quantity(row.value, row.standard_uncertainty, row.unit),
                _write(period),
            ]
            if lifetime.revocation:
                told.append(
                    f"revoked {lifetime.revocation.revoked_at:%Y-%m-%d}: {lifetime.revocation.reason}"
                )
            mark = Mark(
                x=start,
                y=row.value,
                low=low,
                high=high,
                name=f"version {lifetime.calibration.version}",
                told=tuple(told),
            )
            yield Series(
                marks=(mark,) if n == 0 else (),
                line=((start, row.value), (end, row.value)),
                swath=((start, low, high), (end, low, high)),
                place=place,
            )


def build_lives(found: Sequence[Lifetime], *, until: datetime) -> Figure:
    """Return a row per version: when it holds, and when it was published and revoked."""
    cells: list[Cell] = []
    published: list[Mark] = []
    ended: list[Mark] = []
    for n, lifetime in enumerate(reversed(found)):
        y, name = -float(n), f"version {lifetime.calibration.version}"
        for share, rows in ((0.4, lifetime.in_force), (-0.4, lifetime.revoked_from)):
            cells += (
                Cell(
                    x=_ends(row, until),
                    y=(y - _HALF_ROW, y + _HALF_ROW),
                    share=share,
                    told=f"{name}: {'in force' if share > 0 else 'was in force'} {_write(row)}",
                )
                for row in rows
            )
        for act in lifetime.published:
            at, told = act.publication.known_from, (act.publication.reason,)
            published.append(Mark(x=at.timestamp(), y=y, name=f"{name} published {at:%Y-%m-%d}", told=told))
        if lifetime.revocation:
            at, told = lifetime.revocation.revoked_at, (lifetime.revocation.reason,)
            ended.append(Mark(x=at.timestamp(), y=y, name=f"{name} revoked {at:%Y-%m-%d}", told=told))
    ticks = tuple((-float(n), f"v{each.calibration.version}") for n, each in enumerate(reversed(found)))
    return Figure(
        x=_time(found, until),
        y=Axis(label="", ticks=ticks, include=(0.6, 0.4 - len(ticks))),
        cells=tuple(cells),
        series=(
            Series(name="published", marks=tuple(published), place=_PUBLISHED),
            *((Series(name="revoked", marks=tuple(ended), place=_ENDED),) if ended else ()),
        ),
    )


def _time(found: Sequence[Lifetime], until: datetime) -> Axis:
    """Return an axis that all figures of these versions share."""
    starts = [row.valid_from for each in found for row in (*each.in_force, *each.revoked_from)]
    acts = [act.publication.known_from for each in found for act in each.published]
    return Axis(label="", is_time=True, include=tuple(at.timestamp() for at in (*starts, *acts, until)))


def _ends(row: Publication, until: datetime) -> tuple[float, float]:
    return row.valid_from.timestamp(), (row.valid_to or max(until, row.valid_from)).timestamp()


def _write(row: Publication) -> str:
    return f"{row.valid_from:%Y-%m-%d} to {f'{row.valid_to:%Y-%m-%d}' if row.valid_to else 'open'}"
