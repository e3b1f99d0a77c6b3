"""Reflectance panels and what they reflect."""

from typing import Annotated

from fastapi import Query, Request, Response
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.auth import Calibrator, Reader
from service.changes import Reply, Writes
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.paging import Listing, Page, page_own
from service.problems import Problem
from service.routes import problems
from service.schemas.base import Text
from service.schemas.panels import NewPanel, PanelAnswer
from store.queries.organisations import find_or_add_panel
from store.tables import Panel

router = Router(prefix="/v1/panels", tags=["panels"])


@router.post(
    "",
    status_code=201,
    response_model=PanelAnswer,
    responses={
        200: {"model": PanelAnswer, "description": "It was registered already, with the same figures."},
        **problems(409),
    },
)
def create_panel(body: NewPanel, caller: Calibrator, writing: Writes) -> Response:
    """Register a panel as it was measured on a day. Measured again, it is another entry."""

    def change(session: Session) -> Reply:
        values = body.columns()
        panel, new = find_or_add_panel(session, caller.organisation_id, values)
        if panel.bands != values["bands"]:
            raise Problem(
                interface.PANEL_DIFFERS,
                f"Panel {panel.serial} as measured on {panel.measured_on} is registered with other values: "
                "a measurement does not change. Send the day of the new measurement with the new figures.",
            )
        return Reply(status=201 if new else 200, body=PanelAnswer.restate(panel))

    return writing.run(caller, change)


class PanelListing(Listing):
    serial: Text | None = None


@router.get("", response_model=Page[PanelAnswer], responses=problems())
def list_panels(
    request: Request, caller: Reader, context: UsesContext, listing: Annotated[PanelListing, Query()]
) -> Response:
    """The panels of your organisation, oldest entry first."""
    return page_own(request, context, caller, Panel, listing, PanelAnswer.restate)


@router.get("/{panel_id}", response_model=PanelAnswer, responses=problems(404))
def get_panel(panel_id: Id, caller: Reader, context: UsesContext) -> Response:
    """One panel as it was measured on a day."""
    with context.database.reading() as session:
        return PanelAnswer.restate(owned(session, Panel, panel_id, caller)).respond()
