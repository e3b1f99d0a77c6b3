"""Plots of a coefficient in time, and of a fleet: its values by camera."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

from radiometry.drawing.figure import Axis, Figure, Mark, Series
from radiometry.drawing.text import label_axis, sort_naturally, write_quantity
from radiometry.fleet.determinations import Determination, Key
from radiometry.frame.multispectral import label_band

_DAY_S: Final = 86_400.0
_ROOM: Final = 1.15


def build_drift(found: Sequence[Determination], versions: Mapping[str, int], *, quantity: str) -> Figure:
    """Draw a coefficient in time: a series for each ISO value, f-number, band and channel; bars: one u.

    Where it holds at all f-numbers, its values at a single one are left out.

    Parameters
    ----------
    found : sequence of Determination
        Of one camera, at least one.
    versions : mapping of str to int
        Numbers of the versions.
    quantity : str
        Label of the coefficient.
    """
    found = [row for row in found if row.key.f_number is None] or found
    keys = [row.key for row in found]
    # nothing is left out of the name of a single one
    single = len(set(keys)) == 1
    shared = frozenset() if single else frozenset.intersection(*(frozenset(_parts(key)) for key in keys))
    rows: dict[str, list[Determination]] = {}
    for row in found:
        rows.setdefault(_where(row.key, without=shared).replace("channel ", ""), []).append(row)
    times = [row.source.at.timestamp() for row in found]
    # at least months, as nothing drifts in hours
    middle, half = (
        (max(times) + min(times)) / 2.0,
        _ROOM * max((max(times) - min(times)) / 2.0, 45.0 * _DAY_S),
    )
    # error bars of one day would hide one another: together a small share of what is shown
    step = min(0.012, 0.15 / len(rows)) * 2.0 * half
    series = []
    for place, (name, mine) in enumerate(rows.items()):
        shift = (place - (len(rows) - 1) / 2) * step
        marks = tuple(
            _mark(
                row,
                1.0,
                ", ".join(filter(None, [f"version {versions[row.source.version]}", _where(row.key)])),
                x=row.source.at.timestamp() + shift,
                y=row.value,
            )
            for row in mine
        )
        line = tuple((mark.x, mark.y) for mark in marks)
        series.append(Series(name=name if len(rows) > 1 else "", marks=marks, line=line))
    return Figure(
        x=Axis(label="determined, UTC", is_time=True, include=(middle - half, middle + half)),
        y=Axis(label=label_axis(quantity, found[0].key.unit)),
        series=tuple(series),
    )


def build_fleet(found: Sequence[Determination], label: Callable[[str], str]) -> list[Figure]:
    """Draw a figure per coefficient: a line of each camera; bars: twice u, dashed: the mean of all.

    Parameters
    ----------
    found : sequence of Determination
        Of all cameras.
    label : callable
        Name of a coefficient to its label.
    """
    figures = []
    for key in dict.fromkeys(row.key for row in found):
        rows = [row for row in found if row.key == key]
        cameras = sort_naturally({row.source.camera for row in rows})
        versions = {camera: [row for row in rows if row.source.camera == camera] for camera in cameras}
        marks = tuple(
            # beside each other within the line of their camera
            _mark(row, 2.0, camera, x=row.value, y=0.25 - 0.5 * (n + 0.5) / len(mine) - cameras.index(camera))
            for camera, mine in versions.items()
            for n, row in enumerate(mine)
        )
        name, where = label(key.name), _where(key)
        ticks = tuple((-float(n), camera) for n, camera in enumerate(cameras))
        figures.append(
            Figure(
                part=", ".join(part for part in (name, where) if part),
                x=Axis(label=label_axis(name, key.unit)),
                y=Axis(label="", ticks=ticks, include=(0.6, 0.4 - len(ticks))),
                series=(Series(marks=marks),),
                uprights=(sum(mark.x for mark in marks) / len(marks),),
                note="Bars: two standard uncertainties; dashed: mean of all versions",
            )
        )
    return figures


def _mark(row: Determination, bars: float, name: str, *, x: float, y: float) -> Mark:
    """Return the mark of a value with bars of so many standard uncertainties."""
    bar = bars * row.standard_uncertainty
    said = write_quantity(row.value, row.standard_uncertainty, row.key.unit)
    told = (said, row.source.at.strftime("%Y-%m-%d"))
    return Mark(x=x, y=y, low=row.value - bar, high=row.value + bar, name=name, told=told)


def _where(key: Key, *, without: frozenset[str] = frozenset()) -> str:
    """Return what a series holds for, but for what goes without saying."""
    return ", ".join(part for part in _parts(key) if part not in without)


def _parts(key: Key) -> list[str]:
    key = replace(key, band=key.band and label_band(key.band))
    said = str(key).removeprefix(key.name).removeprefix(" at ").split(", ")
    # of sharpness the model ends with the place in the frame
    return [part for part in (*said, key.model.partition(":")[2]) if part]
