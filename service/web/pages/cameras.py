"""Cameras: what is in force for each, how it drifts, and whether several can share it."""

from dataclasses import dataclass
from typing import Annotated, Literal

from fastapi import Depends, Query, Response
from sqlalchemy import select

from radiometry.findings import interface
from radiometry.methods import get_method
from service.auth import Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.problems import Problem
from service.schemas.base import Instant, Method, Text
from service.web.charts import View, draw_figure, send_svg
from service.web.determinations import build_drift, build_fleet
from service.web.lifetimes import build_lives, build_values
from service.web.rendering import SignedInPage
from store.queries.calibrations import list_lifetimes
from store.queries.fleet import list_determinations
from store.tables import Calibration, Camera
from store.tables.base import utc_now

router = Router(include_in_schema=False)


@router.get("/cameras")
def show_cameras(page: SignedInPage) -> Response:
    return page.render("cameras.html", title="Cameras")


@router.get("/fleet")
def show_fleet(page: SignedInPage) -> Response:
    return page.render("fleet.html", title="One set for several cameras?")


@router.get("/cameras/{camera_id}")
def show_camera(camera_id: Id, page: SignedInPage, context: UsesContext) -> Response:
    with context.database.reading() as session:
        camera = owned(session, Camera, camera_id, page.caller)
    title = f"{camera.make} {camera.model} {camera.serial}"
    return page.render("camera.html", title=title, camera=camera)


@router.get("/cameras/{camera_id}/coefficients")
def show_coefficients(camera_id: Id, page: SignedInPage, context: UsesContext) -> Response:
    with context.database.reading() as session:
        camera = owned(session, Camera, camera_id, page.caller)
    return page.render("coefficients.html", title="Coefficients in time", camera=camera)


@router.get("/plots/fleet")
def plot_fleet(
    caller: Reader,
    context: UsesContext,
    view: Annotated[View, Depends()],
    camera_id: Annotated[list[Text], Query()],
    method: Annotated[Method, Query()],
) -> Response:
    with context.database.reading() as session:
        cameras = [owned(session, Camera, each, caller) for each in camera_id]
        found = list_determinations(session, cameras, method, {})
    if not found:
        return Response(status_code=204)
    figures = build_fleet(found, get_method(method).label_coefficient)
    drawn = figures[min(view.part, len(figures) - 1)]
    return send_svg(
        draw_figure(drawn, "Coefficients of each camera", view=view, parts=[f.part for f in figures])
    )


@router.get("/plots/cameras/{camera_id}/drift")
def plot_drift(
    camera_id: Id,
    caller: Reader,
    context: UsesContext,
    view: Annotated[View, Depends()],
    method: Annotated[Method, Query()],
    name: Annotated[Text, Query()],
) -> Response:
    with context.database.reading() as session:
        camera = owned(session, Camera, camera_id, caller)
        found = list_determinations(session, [camera], method, {})
        numbers = session.execute(
            select(Calibration.id, Calibration.version).where(Calibration.camera_id == camera_id)
        )
        versions = {row[0]: row[1] for row in numbers}
    named = [row for row in found if row.key.name == name]
    if not named:
        raise Problem(interface.NOT_FOUND, f"No published version of this camera has {name}.")
    quantity = get_method(method).label_coefficient(name)
    figure = build_drift(named, versions, quantity=quantity)
    return send_svg(draw_figure(figure, quantity, view=view, is_wide=True))


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """A coefficient of a method, and the time as of which its versions are known."""

    method: Annotated[Method, Query()]
    name: Annotated[Text, Query()]
    iso: Annotated[float | None, Query()] = None
    f_number: Annotated[float | None, Query()] = None
    band: Annotated[Text | None, Query()] = None
    channel: Annotated[Text | None, Query()] = None
    model: Annotated[Text | None, Query(description="Where it is one of several.")] = None
    at: Annotated[Instant | None, Query()] = None
    known_at: Annotated[Instant | None, Query()] = None


@router.get("/plots/cameras/{camera_id}/{figure}")
def plot_lifetimes(
    camera_id: Id,
    figure: Literal["values", "lives"],
    caller: Reader,
    context: UsesContext,
    view: Annotated[View, Depends()],
    wanted: Annotated[Wanted, Depends()],
) -> Response:
    known_at = wanted.known_at or utc_now()
    with context.database.reading() as session:
        owned(session, Camera, camera_id, caller)
        found = list_lifetimes(session, camera_id, wanted.method, known_at)
    until = max(known_at, wanted.at or known_at)
    if figure == "lives":
        return send_svg(draw_figure(build_lives(found, until=until), "Life of each version", view=view))
    where = {name: getattr(wanted, name) for name in ("name", "iso", "f_number", "band", "channel")}
    where |= {"model": wanted.model} if wanted.model else {}
    label = get_method(wanted.method).label_coefficient(wanted.name)
    drawn = build_values(found, where, label=label, until=until)
    return send_svg(draw_figure(drawn, f"{label} in time", view=view))
