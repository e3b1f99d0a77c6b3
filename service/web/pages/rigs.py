"""Rigs: cameras that are mounted together, and how they are oriented against each other."""

from urllib.parse import urlencode

from fastapi import APIRouter, Response

from service.context import UsesContext
from service.lookup import Id, owned
from service.routes.rigs import Versions
from service.web.rendering import SignedInPage
from store.queries.fleet import METHOD, SPEC, list_cameras
from store.tables import Rig

router = APIRouter(include_in_schema=False)


@router.get("/rigs")
def show_rigs(page: SignedInPage) -> Response:
    return page.render("rigs.html", title="Rigs", method=METHOD)


@router.get("/rigs/{rig_id}")
def show_rig(rig_id: Id, page: SignedInPage, context: UsesContext, chosen: Versions) -> Response:
    with context.database.reading() as session:
        rig = owned(session, Rig, rig_id, page.caller)
        cameras = list_cameras(session, rig)
    given = urlencode([("calibration_id", each) for each in chosen.calibration_id or ()])
    return page.render(
        "rig.html", title=rig.name, rig=rig, cameras=cameras, exports=SPEC.exports, given=given
    )
