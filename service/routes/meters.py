"""Meters and their certificates."""

from typing import Annotated

from fastapi import Query, Request, Response
from sqlalchemy.orm import Session

from service.auth import Calibrator, Reader
from service.changes import Reply, Writes
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.paging import Listing, Page, page_own
from service.routes import problems
from service.schemas.base import Text
from service.schemas.equipment import MeterAnswer, NewMeter
from store.queries.organisations import find_or_add_meter
from store.tables import Meter

router = Router(prefix="/v1/meters", tags=["meters"])


@router.post(
    "",
    status_code=201,
    response_model=MeterAnswer,
    responses={
        200: {
            "model": MeterAnswer,
            "description": "It was registered already; a certificate sent now is its newest.",
        },
        **problems(),
    },
)
def create_meter(body: NewMeter, caller: Calibrator, writing: Writes) -> Response:
    """Register a meter, with its calibration certificate where there is one."""

    def change(session: Session) -> Reply:
        meter, new = find_or_add_meter(session, caller.organisation_id, body.columns())
        return Reply(status=201 if new else 200, body=MeterAnswer.of(meter))

    return writing.run(caller, change)


class MeterListing(Listing):
    kind: Text | None = None
    serial: Text | None = None


@router.get("", response_model=Page[MeterAnswer], responses=problems())
def list_meters(
    request: Request, caller: Reader, context: UsesContext, listing: Annotated[MeterListing, Query()]
) -> Response:
    """The meters of your organisation, oldest first."""
    return page_own(request, context, caller, Meter, listing, MeterAnswer.of)


@router.get("/{meter_id}", response_model=MeterAnswer, responses=problems(404))
def get_meter(meter_id: Id, caller: Reader, context: UsesContext) -> Response:
    """One meter."""
    with context.database.reading() as session:
        return MeterAnswer.of(owned(session, Meter, meter_id, caller)).respond()
