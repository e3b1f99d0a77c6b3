"""The audit trail of an organisation, for reading; that it is whole the operator checks with `make audit`."""

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from sqlalchemy import select

from service.auth import Admin
from service.context import UsesContext
from service.paging import Limit, Page, Paging
from service.routes import problems
from service.schemas.audit import AuditEntryAnswer
from service.schemas.base import Text
from store.tables import AuditEntry

router = APIRouter(prefix="/v1/audit", tags=["audit"])

_LARGEST_SEQ = 2**63 - 1

After = Annotated[
    int | None,
    Query(ge=0, le=_LARGEST_SEQ, description="Taken from the `next` address of the page before."),
]


@router.get("", response_model=Page[AuditEntryAnswer], responses=problems())
def list_audit_entries(
    request: Request,
    caller: Admin,
    context: UsesContext,
    subject_id: Annotated[Text | None, Query(description="Only what was done to this.")] = None,
    limit: Limit = 100,
    cursor: After = None,
) -> Response:
    """List who did what in your organisation, from what to what, newest first."""
    rows = select(AuditEntry).where(AuditEntry.organisation_id == caller.organisation_id)
    if subject_id is not None:
        rows = rows.where(AuditEntry.subject_id == subject_id)
    with context.database.reading() as session:
        return Paging(request, limit, cursor).send(
            session, rows, lambda found: [AuditEntryAnswer.restate(row) for row in found], newest_first=True
        )
