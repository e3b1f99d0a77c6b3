"""One version of a calibration: what was found, from what, and what was decided of it."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response

from radiometry.findings import interface
from radiometry.methods import get_method
from service.auth import Caller, Reader
from service.context import Context, UsesContext
from service.lookup import Id, owned
from service.problems import Problem
from service.web.charts import Axes, View, draw_residuals, draw_signal, send_svg
from service.web.rendering import SignedInPage
from store.tables import Calibration, Camera, Campaign

router = APIRouter(include_in_schema=False)


@router.get("/calibrations/{calibration_id}")
def show_calibration(calibration_id: Id, page: SignedInPage, context: UsesContext) -> Response:
    with context.database.reading() as session:
        calibration = owned(session, Calibration, calibration_id, page.caller)
        camera = session.get_one(Camera, calibration.camera_id)
        campaign = session.get_one(Campaign, calibration.campaign_id)
    spec = get_method(calibration.method)
    return page.render(
        "calibration.html",
        title=f"{spec.label} version {calibration.version}",
        calibration=calibration,
        camera=camera,
        campaign=campaign,
        spec=spec,
    )


@router.get("/plots/calibrations/{calibration_id}/signal")
def plot_signal(
    calibration_id: Id,
    caller: Reader,
    context: UsesContext,
    view: Annotated[View, Depends()],
    axes: Annotated[Axes, Query()] = "linear",
) -> Response:
    return send_svg(draw_signal(_curve(context, calibration_id, caller).result, axes=axes, view=view))


@router.get("/plots/calibrations/{calibration_id}/residuals")
def plot_residuals(
    calibration_id: Id, caller: Reader, context: UsesContext, view: Annotated[View, Depends()]
) -> Response:
    return send_svg(draw_residuals(_curve(context, calibration_id, caller).result, view=view))


def _curve(context: Context, calibration_id: str, caller: Caller) -> Calibration:
    with context.database.reading() as session:
        found = owned(session, Calibration, calibration_id, caller)
    if get_method(found.method).certificate.layout != "curve":
        detail = f"This version is of {found.method}: its plot is /v1/calibrations/{found.id}/plot.svg."
        raise Problem(interface.NOT_FOUND, detail)
    return found
