"""Meters and their certificates."""

from fastapi import APIRouter, Request, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.auth import Calibrator, Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.paging import Cursor, Limit, Page, page
from service.routes import problems
from service.schemas.equipment import MeterAnswer, NewMeter
from service.writing import Reply, Writes
from store.queries.equipment import find_or_add_meter
from store.tables import Meter

router = APIRouter(prefix="/v1/meters", tags=["meters"])


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


@router.get("", response_model=Page[MeterAnswer], responses=problems())
def list_meters(
    request: Request, caller: Reader, context: UsesContext, limit: Limit = 100, cursor: Cursor = None
) -> Response:
    """The meters of your organisation, oldest first."""
    rows = select(Meter).where(Meter.organisation_id == caller.organisation_id)
    with context.database.reading() as session:
        return page(
            session,
            request,
            rows,
            by=Meter.id,
            limit=limit,
            cursor=cursor,
            shape=lambda found: [MeterAnswer.of(row) for row in found],
        )


@router.get("/{meter_id}", response_model=MeterAnswer, responses=problems(404))
def get_meter(meter_id: Id, caller: Reader, context: UsesContext) -> Response:
    """One meter."""
    with context.database.reading() as session:
        return MeterAnswer.of(owned(session, Meter, meter_id, caller)).respond()
