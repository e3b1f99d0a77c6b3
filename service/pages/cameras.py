"""Cameras: what is in force for each, how it drifts, and whether several can share it."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from html import escape
from typing import Annotated, Final, Literal

from fastapi import Depends, Query, Response
from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.drawing import chart
from radiometry.drawing.figure import Axis, Cell, Figure, Mark, Series
from radiometry.drawing.text import label_axis, write_quantity
from radiometry.findings import interface
from radiometry.fleet import drawing
from radiometry.methods import get_method
from service.coefficients import routes as coefficients
from service.http import auth, lookup, models, operations, problems
from service.pages.rendering import SignedInPage
from store.queries import calibrations, fleet
from store.queries.calibrations import Lifetime
from store.tables import Calibration, Camera, CoefficientRow, Publication, utc_now

_LEFT_PX, _RIGHT_PX, _TOP_PX, _NAME_PX = 66, 20, 14, 24
_NAMES_SHARE: Final = 0.4
_HEIGHT_PX: Final = {False: 188, True: 338}


@dataclass(frozen=True, kw_only=True)
class View:
    """How wide a chart's place is, and which figure is shown."""

    width: Annotated[int, Query(ge=240, le=2000)] = 900
    part: Annotated[int, Query(ge=0, le=99, description="Which figure of a plot that has several.")] = 0


def draw_figure(
    figure: Figure, label: str, *, view: View = View(), parts: Sequence[str] = (), is_wide: bool = False
) -> str:
    """Draw a figure as SVG; `label`: for screen readers, `parts`: labels of all figures of the plot."""
    names = figure.y.ticks or ()
    height = _NAME_PX * len(names) if names else _HEIGHT_PX[is_wide]
    # figures of one time above each other have one margin
    shares_margin = figure.x.is_time or not names
    # names have the room that they need, up to a share of the width
    longest = min(14 + 7 * max((len(text) for _, text in names), default=0), int(_NAMES_SHARE * view.width))
    left = max(_LEFT_PX if shares_margin else 0, longest)
    panel = chart.place_figure(figure, (left, _TOP_PX, view.width - _RIGHT_PX, _TOP_PX + height))
    drawn, bottom = chart.draw_figure(figure, panel, in_print=False)
    picture = chart.document(
        drawn, width_px=view.width, height_px=math.ceil(bottom), label=label, style=chart.STYLE
    )
    ends = f'data-low="{panel.x.low:.12g}" data-high="{panel.x.high:.12g}"'
    told = f'{ends} data-parts="{escape(json.dumps(list(parts)))}" data-note="{escape(figure.note)}"'
    return picture.replace("<svg ", f"<svg {told} ", 1)


def send_svg(drawn: str) -> Response:
    return Response(drawn, media_type="image/svg+xml", headers={"Cache-Control": "private, no-cache"})


_HOLDS, _REVOKED, _PUBLISHED, _ENDED = 0, 1, 2, 5
_HALF_ROW: Final = 0.3


def build_values(
    found: Sequence[Lifetime], where: dict[str, str | float | None], *, label: str, until: datetime
) -> Figure:
    """Return a coefficient (`where`) of each version while in force, cut at `until`; bars: twice u."""
    shown = [(each, row) for each in reversed(found) if (row := find(each, where)) is not None]
    series = [each for lifetime, row in shown for each in _draw_value(lifetime, row, until)]
    for place, name in ((_HOLDS, "in force"), (_REVOKED, "revoked")):
        if any(each.place == place for each in series):
            series.append(Series(name=name, place=place))
    y = Axis(label=label_axis(label, shown[0][1].unit if shown else "1"))
    return Figure(x=_time(found, until), y=y, series=tuple(series))


def find(lifetime: Lifetime, where: dict[str, str | float | None]) -> CoefficientRow | None:
    rows = lifetime.coefficients
    return next(
        (row for row in rows if all(getattr(row, name) == value for name, value in where.items())), None
    )


def _draw_value(lifetime: Lifetime, row: CoefficientRow, until: datetime) -> Iterator[Series]:
    low, high = (row.value + sign * 2.0 * row.standard_uncertainty for sign in (-1, 1))
    for place, rows in ((_HOLDS, lifetime.in_force), (_REVOKED, lifetime.revoked_from)):
        for n, period in enumerate(rows):
            start, end = _ends(period, until)
            told = [write_quantity(row.value, row.standard_uncertainty, row.unit), _write(period)]
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
    starts = [row.valid_from for each in found for row in (*each.in_force, *each.revoked_from)]
    acts = [act.publication.known_from for each in found for act in each.published]
    return Axis(label="", is_time=True, include=tuple(at.timestamp() for at in (*starts, *acts, until)))


def _ends(row: Publication, until: datetime) -> tuple[float, float]:
    return row.valid_from.timestamp(), (row.valid_to or max(until, row.valid_from)).timestamp()


def _write(row: Publication) -> str:
    return f"{row.valid_from:%Y-%m-%d} to {f'{row.valid_to:%Y-%m-%d}' if row.valid_to else 'open'}"


router = operations.Router(include_in_schema=False)


@router.get("/cameras/{camera_id}")
def show_camera(camera: lookup.Own[Camera], page: SignedInPage) -> Response:
    title = f"{camera.make} {camera.model} {camera.serial}"
    return page.render("camera.html", title=title, camera=camera)


@router.get("/cameras/{camera_id}/coefficients")
def show_coefficients(camera: lookup.Own[Camera], page: SignedInPage) -> Response:
    return page.render("coefficients.html", title="Coefficients in time", camera=camera)


@router.get("/plots/fleet")
def plot_fleet(
    caller: auth.Reader,
    session: Session,
    view: Annotated[View, Depends()],
    camera_id: Annotated[list[models.Text], Query()],
    method: models.Method,
) -> Response:
    cameras = [lookup.owned(session, Camera, each, caller) for each in camera_id]
    found = fleet.list_determinations(session, cameras, method, {})
    if not found:
        return Response(status_code=204)
    figures = drawing.build_fleet(found, get_method(method).label_coefficient)
    drawn, parts = figures[min(view.part, len(figures) - 1)], [each.part for each in figures]
    return send_svg(draw_figure(drawn, "Coefficients of each camera", view=view, parts=parts))


@router.get("/plots/cameras/{camera_id}/drift")
def plot_drift(
    camera: lookup.Own[Camera],
    session: Session,
    view: Annotated[View, Depends()],
    method: models.Method,
    name: models.Text,
) -> Response:
    found = fleet.list_determinations(session, [camera], method, {})
    numbers = session.execute(
        select(Calibration.id, Calibration.version).where(Calibration.camera_id == camera.id)
    )
    versions = {row[0]: row[1] for row in numbers}
    if not (named := [row for row in found if row.key.name == name]):
        raise problems.Problem(interface.NOT_FOUND, f"No published version of this camera has {name}.")
    quantity = get_method(method).label_coefficient(name)
    figure = drawing.build_drift(named, versions, quantity=quantity)
    return send_svg(draw_figure(figure, quantity, view=view, is_wide=True))


class Wanted(coefficients.Wanted):
    """A coefficient of a method, and the time as of which its versions are known."""

    name: models.Text
    channel: models.Text | None = None
    model: models.Text | None = None
    width: int = Field(900, ge=240, le=2000)
    part: int = 0


@router.get("/plots/cameras/{camera_id}/{figure}")
def plot_lifetimes(
    camera: lookup.Own[Camera],
    figure: Literal["values", "lives"],
    session: Session,
    wanted: Annotated[Wanted, Query()],
) -> Response:
    view, known_at = View(width=wanted.width), wanted.known_at or utc_now()
    found = calibrations.list_lifetimes(session, camera.id, wanted.method, known_at)
    until = max(known_at, wanted.at or known_at)
    if figure == "lives":
        return send_svg(draw_figure(build_lives(found, until=until), "Life of each version", view=view))
    where = {name: getattr(wanted, name) for name in ("name", "iso", "f_number", "band", "channel")}
    where |= {"model": wanted.model} if wanted.model else {}
    label = get_method(wanted.method).label_coefficient(wanted.name)
    drawn = build_values(found, where, label=label, until=until)
    return send_svg(draw_figure(drawn, f"{label} in time", view=view))
