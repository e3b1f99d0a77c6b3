"""Routes of the pages: each finds what its address names, and renders a template; into a session and out."""

import math
from datetime import timedelta
from typing import Annotated, Any, Final
from urllib.parse import urlencode, urlsplit

from fastapi import APIRouter, Depends, Form, Request, Response
from fastapi.responses import RedirectResponse
from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.findings import interface
from radiometry.frame.multispectral import NAMED_INDICES
from radiometry.road.drawing import draw_map
from service.equipment.routes import Versions
from service.http import auth, counts, models, operations, problems, signatures
from service.http.context import Context, UsesContext
from service.http.lookup import Own, owned
from service.pages.cameras import View, draw_figure, send_svg
from service.pages.rendering import SignedInPage, render
from service.roads import routes as roads
from service.tools.routes import describe_tools
from store import tables
from store.queries import calibrations, evidence, fleet, organisations

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
def show_campaign(campaign: Own[tables.Campaign], page: SignedInPage, session: Session) -> Response:
    camera = session.get_one(tables.Camera, campaign.camera_id)
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
def show_calibration(calibration: Own[tables.Calibration], page: SignedInPage, session: Session) -> Response:
    camera = session.get_one(tables.Camera, calibration.camera_id)
    campaign = session.get_one(tables.Campaign, calibration.campaign_id)
    spec = methods.get_method(calibration.method)
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
    calibration: Own[tables.Calibration], name: str, session: Session, view: Annotated[View, Depends()]
) -> Response:
    """Answer a figure of a plot that the method declares; 204 where this version has nothing to draw."""
    campaign = session.get_one(tables.Campaign, calibration.campaign_id)
    plot = next((each for each in methods.get_method(calibration.method).plots if each.name == name), None)
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
def show_comparison(page: SignedInPage, session: Session, old: models.Text, new: models.Text) -> Response:
    for named in (old, new):
        owned(session, tables.Measurement, named, page.caller)
    return page.render("comparison.html", title="Compare measurements", old=old, new=new)


@router.get("/measurements/{measurement_id}")
def show_measurement(measurement: Own[tables.Measurement], page: SignedInPage, session: Session) -> Response:
    frame = session.get_one(tables.FrameRow, measurement.frame_id)
    calibration = session.get_one(tables.Calibration, measurement.calibration_id)
    return page.render(
        "measurement.html", title=frame.filename, measurement=measurement, calibration=calibration
    )


@router.get("/rigs/{rig_id}")
def show_rig(rig: Own[tables.Rig], page: SignedInPage, session: Session, chosen: Versions) -> Response:
    cameras = fleet.list_cameras(session, rig)
    given = urlencode([("calibration_id", each) for each in chosen.calibration_id or ()])
    return page.render(
        "rig.html", title=rig.name, rig=rig, cameras=cameras, exports=fleet.SPEC.exports, given=given
    )


@router.get("/roads/{road_id}")
def show_road(road: Own[tables.Road], page: SignedInPage) -> Response:
    return page.render("road.html", title=road.name, road=road)


@router.get("/plots/roads/{road_id}/{number}")
def show_road_map(
    row: roads.UsesResult, context: UsesContext, layers: models.Text, *, upright: bool
) -> Response:
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


sign_in_router = APIRouter(include_in_schema=False)


@sign_in_router.get("/sign-in")
def show_sign_in(request: Request, context: UsesContext, next: str = "/", *, ended: bool = False) -> Response:  # noqa: A002  as in addresses
    if auth.find_session(request, context) is not None:
        return RedirectResponse(_local(next), 303)
    if request.headers.get("sec-fetch-site") in {"cross-site", "same-site"}:
        # a link from elsewhere comes without the cookie, which is strict: a page of ours asks again
        return render(request, "again.html", title="One moment", next=_local(next))
    # a session that has ended: its cookie is still there, or a page of ours was told so
    return _form(request, next, ended=ended or context.sessions.cookie in request.cookies)


@sign_in_router.post("/sign-in")
def sign_in(
    request: Request,
    context: UsesContext,
    key: Annotated[str, Form()] = "",
    next: Annotated[str, Form()] = "/",  # noqa: A002
) -> Response:
    _refuse_other_sites(request)
    key = key.strip()
    address = counts.name_address(request.client.host if request.client else None)
    wait_s = 0.0 if context.attempts.is_trusted(key) else context.attempts.wait_s(address)
    if wait_s > 0:
        return _too_many(request, next, wait_s)
    with context.database.reading() as session:
        found = organisations.find_key(session, key)
        ended = None if found else organisations.find_ended_key(session, key)
    unfit = ended or (found[0] if found and "read" not in found[0].scopes else None)
    if found is None or unfit is not None:
        return _refuse(request, context, next, address, unfit)
    context.attempts.trust(key)
    opened, organisation = found
    browser = "".join(c for c in request.headers.get("user-agent", "") if c.isprintable())
    expires_at = tables.utc_now() + timedelta(seconds=signatures.SESSION_S)
    with context.database.writing(opened.id, organisation.id) as session:
        row = tables.WebSession(
            organisation_id=organisation.id,
            key_id=opened.id,
            browser=browser[:200] or None,
            expires_at=min(expires_at, opened.expires_at or expires_at),
        )
        session.add(row)
    answer = RedirectResponse(_local(next), 303)
    answer.set_cookie(
        context.sessions.cookie,
        context.sessions.open(row.id),
        max_age=signatures.SESSION_S,
        secure=request.url.scheme == "https",
        httponly=True,
        samesite="strict",
    )
    return answer


@sign_in_router.post("/sign-out")
def sign_out(request: Request, context: UsesContext, csrf_token: Annotated[str, Form()] = "") -> Response:
    if (caller := auth.find_session(request, context)) is not None:
        auth.require_csrf_token(request, context, csrf_token)
        with context.database.writing(caller.key_id, caller.organisation_id) as session:
            session.get_one(tables.WebSession, caller.session_id).ended_at = tables.utc_now()
    answer = RedirectResponse("/sign-in", 303)
    answer.delete_cookie(context.sessions.cookie, httponly=True, samesite="strict")
    return answer


def _refuse(
    request: Request, context: Context, next_address: str, address: str, unfit: tables.ApiKey | None
) -> Response:
    """Count the failure, of a key that is known but opens nothing also whatever address it comes from."""
    who = [address, unfit.id] if unfit else [address]
    wait_s = context.attempts.wait_s(unfit.id) if unfit else 0.0
    if wait_s > 0:
        return _too_many(request, next_address, wait_s)
    context.traffic.metrics.wrong_keys.inc()
    for each in who:
        context.attempts.fail(each)
    if unfit is not None and unfit.revoked_at is None and "read" not in unfit.scopes:
        return _form(
            request, next_address, "This key may not read. The pages need a key with the scope read."
        )
    return _form(request, next_address, auth.describe_refusal(unfit))


def _too_many(request: Request, next_address: str, wait_s: float) -> Response:
    seconds = math.ceil(wait_s)
    detail = f"More than {counts.FREE} attempts to sign in failed. Try again in {seconds} s."
    headers = {"Retry-After": str(seconds)}
    if "text/html" not in request.headers.get("accept", ""):
        raise problems.Problem(interface.TOO_MANY_ATTEMPTS, detail, headers=headers)
    answer = _form(request, next_address, detail, status=429)
    answer.headers.update(headers)
    return answer


def _form(
    request: Request, next_address: str, error: str | None = None, *, ended: bool = False, status: int = 401
) -> Response:
    return render(
        request,
        "sign-in.html",
        title="Sign in",
        status=status if error else 200,
        next=_local(next_address),
        error=error,
        ended=ended,
    )


def _local(address: str) -> str:
    """An address of this service, whatever was asked for: never a way to another site."""
    # a browser reads a backslash as a slash, and drops control characters
    plain = address.isascii() and address.isprintable() and "\\" not in address
    return address if plain and address.startswith("/") and not address.startswith("//") else "/"


def _refuse_other_sites(request: Request) -> None:
    """Nobody is signed in by a stranger's page with a stranger's key: browsers say where a form is from."""
    site = request.headers.get("sec-fetch-site")
    origin = request.headers.get("origin")
    own = origin is None or urlsplit(origin).netloc == request.headers.get("host")
    if site not in {"same-origin", "none"} if site else not own:
        raise problems.Problem(interface.CSRF_TOKEN_WRONG, "Sign in on the page of this service itself.")
