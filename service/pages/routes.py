"""Routes of the pages: each finds what its address names, and renders a template."""

from typing import Annotated, Any, Final
from urllib.parse import urlencode

from fastapi import Depends, Response
from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.findings import interface
from radiometry.frame.multispectral import NAMED_INDICES
from radiometry.methods import get_method
from service.equipment.routes import Versions
from service.http import auth, operations, problems
from service.http.context import UsesContext
from service.http.lookup import Id, owned
from service.http.models import Text
from service.pages.cameras import View, draw_figure, send_svg
from service.pages.rendering import SignedInPage
from service.roads import routes as roads
from service.roads.drawing import draw_map
from service.tools.routes import describe_tools
from store.queries import calibrations, evidence, fleet
from store.tables import Calibration, Camera, Campaign, FrameRow, Measurement, Rig, Road

_PLAIN: Final[dict[str, tuple[str, str, dict[str, Any]]]] = {
    "/": ("home", "Start", {}),
    "/cameras": ("cameras", "Cameras", {}),
    "/fleet": ("fleet", "One set for several cameras?", {}),
    "/campaigns": ("campaigns", "Campaigns", {}),
    "/campaigns/new": ("campaign-new", "New campaign", {}),
    "/measurements": ("measurements", "Measurements", {}),
    "/measurements/new": ("measurement-new", "Measure a frame", {"indices": " ".join(NAMED_INDICES)}),
    "/roads": ("roads", "Roads", {}),
    "/rigs": ("rigs", "Rigs", {"method": fleet.METHOD}),
    "/jobs": ("jobs", "Jobs", {}),
    "/organisation": ("organisation/keys", "Keys and sessions", {}),
    "/organisation/audit": ("organisation/audit", "Audit trail", {}),
    "/organisation/details": ("organisation/details", "Organisation", {}),
}
"""By address: template, title, and what else a page shows that names nothing of the organisation's."""

router = operations.Router(include_in_schema=False)


def _add_page(address: str, template: str, title: str, shown: dict[str, Any]) -> None:
    @router.get(address)
    def show_page(page: SignedInPage) -> Response:
        return page.render(f"{template}.html", title=title, **shown)


# before the page of one campaign or measurement, whose id /new would be taken for
for _address, _plain in _PLAIN.items():
    _add_page(_address, *_plain)


@router.get("/campaigns/{campaign_id}")
def show_campaign(campaign_id: Id, page: SignedInPage, session: Session) -> Response:
    campaign = owned(session, Campaign, campaign_id, page.caller)
    camera = session.get_one(Camera, campaign.camera_id)
    spec = methods.get_method(campaign.method)
    return page.render(
        "campaign.html",
        title=campaign.project_number
        or f"{'Measuring night' if campaign.measures else spec.label} of {camera.model}",
        campaign=campaign,
        camera=camera,
        spec=spec,
    )


@router.get("/calibrations/{calibration_id}")
def show_calibration(calibration_id: Id, page: SignedInPage, session: Session) -> Response:
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
    calibration_id: Id, name: str, caller: auth.Reader, session: Session, view: Annotated[View, Depends()]
) -> Response:
    """Answer a figure of a plot that the method declares; 204 where this version has nothing to draw."""
    calibration = owned(session, Calibration, calibration_id, caller)
    campaign = session.get_one(Campaign, calibration.campaign_id)
    plot = next((each for each in get_method(calibration.method).plots if each.name == name), None)
    if plot is None:
        raise problems.Problem(interface.NOT_FOUND, f"{calibration.method} has no plot {name}.")
    used = {each["sha256"] for each in calibration.inputs["frames"]}

    def read_rows() -> list[Any]:
        found = evidence.gather(session, campaign)
        return [row for row in found.frames if found.hashes[row.frame] in used]

    flight = [at.isoformat() for at in calibrations.list_flight(session, calibration)]
    figures = list(plot.build(calibration.result | {"flight": flight}, read_rows))
    if not figures:
        return Response(status_code=204)
    parts = [each.part for each in figures if each.part]
    drawn = figures[min(view.part, len(figures) - 1)]
    return send_svg(draw_figure(drawn, plot.title, view=view, parts=parts, is_wide=plot.is_wide))


@router.get("/measurements/comparison")
def show_comparison(page: SignedInPage, session: Session, old: Text, new: Text) -> Response:
    for named in (old, new):
        owned(session, Measurement, named, page.caller)
    return page.render("comparison.html", title="Compare measurements", old=old, new=new)


@router.get("/measurements/{measurement_id}")
def show_measurement(measurement_id: Id, page: SignedInPage, session: Session) -> Response:
    measurement = owned(session, Measurement, measurement_id, page.caller)
    frame = session.get_one(FrameRow, measurement.frame_id)
    calibration = session.get_one(Calibration, measurement.calibration_id)
    return page.render(
        "measurement.html", title=frame.filename, measurement=measurement, calibration=calibration
    )


@router.get("/rigs/{rig_id}")
def show_rig(rig_id: Id, page: SignedInPage, session: Session, chosen: Versions) -> Response:
    rig = owned(session, Rig, rig_id, page.caller)
    cameras = fleet.list_cameras(session, rig)
    given = urlencode([("calibration_id", each) for each in chosen.calibration_id or ()])
    return page.render(
        "rig.html", title=rig.name, rig=rig, cameras=cameras, exports=fleet.SPEC.exports, given=given
    )


@router.get("/roads/{road_id}")
def show_road(road_id: Id, page: SignedInPage, session: Session) -> Response:
    road = owned(session, Road, road_id, page.caller)
    return page.render("road.html", title=road.name, road=road)


@router.get("/plots/roads/{road_id}/{number}")
def show_road_map(row: roads.UsesResult, context: UsesContext, layers: Text, *, upright: bool) -> Response:
    """Answer the map of an evaluation with its lanes and points; upright as one walks it."""
    result = roads.answer_result(context, row).dump()
    if row.map_png_sha256 is None:
        return Response(status_code=204)
    png = b"".join(context.files.open(row.map_png_sha256)[1])
    return send_svg(draw_map(result, png, is_upright=upright, layers=layers.split(",")))


_TOOLS: Final = {name: name.capitalize() for name in describe_tools()}


@router.get("/tools/{tool}")
def show_calculator(tool: str, page: SignedInPage) -> Response:
    if tool not in _TOOLS:
        raise problems.Problem(interface.NOT_FOUND, f"There is no calculator {tool}.")
    pages = [(f"/tools/{name}", title) for name, title in _TOOLS.items()]
    return page.render("tools.html", title=_TOOLS[tool], tool=tool, pages=pages)
