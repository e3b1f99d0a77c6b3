"""One version of a calibration: what was found, from what, and what was decided of it."""

from typing import Annotated, Any

from fastapi import Depends, Response

from radiometry.findings import interface
from radiometry.methods import get_method
from service.auth import Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.problems import Problem
from service.web.charts import View, draw_figure, send_svg
from service.web.rendering import SignedInPage
from store.queries.calibrations import list_flight
from store.queries.evidence import gather
from store.tables import Calibration, Camera, Campaign

router = Router(include_in_schema=False)


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


@router.get("/plots/calibrations/{calibration_id}/{name}")
def show_plot(
    calibration_id: Id, name: str, caller: Reader, context: UsesContext, view: Annotated[View, Depends()]
) -> Response:
    """Answer a figure of a plot that the method declares; 204 where this version has nothing to draw."""
    with context.database.reading() as session:
        calibration = owned(session, Calibration, calibration_id, caller)
        campaign = session.get_one(Campaign, calibration.campaign_id)
        plot = next((each for each in get_method(calibration.method).plots if each.name == name), None)
        if plot is None:
            raise Problem(interface.NOT_FOUND, f"{calibration.method} has no plot {name}.")
        used = {each["sha256"] for each in calibration.inputs["frames"]}

        def read_rows() -> list[Any]:
            found = gather(session, campaign)
            return [row for row in found.frames if found.hashes[row.frame] in used]

        flight = [at.isoformat() for at in list_flight(session, calibration)]
        figures = list(plot.build(calibration.result | {"flight": flight}, read_rows))
    if not figures:
        return Response(status_code=204)
    parts = [each.part for each in figures if each.part]
    drawn = figures[min(view.part, len(figures) - 1)]
    return send_svg(draw_figure(drawn, plot.title, view=view, parts=parts, is_wide=plot.is_wide))
