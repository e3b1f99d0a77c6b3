"""Cameras: what is in force for each, how it drifts, and whether several can share it."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response
from sqlalchemy import select

from radiometry.findings import interface
from radiometry.methods import get_method
from service.auth import Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.problems import Problem
from service.schemas.base import Method, Text
from service.web.charts import View, build_drift, draw_figure, send_svg
from service.web.rendering import SignedInPage
from store.queries.fleet import list_determinations
from store.tables import Calibration, Camera

router = APIRouter(include_in_schema=False)


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
