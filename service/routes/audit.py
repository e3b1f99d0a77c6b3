"""The audit trail of an organisation: its entries, chosen and exported, and whether its chain holds.

That the rows are as the entries left them the operator checks with `make audit`.
"""

import json
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from fastapi import Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import Field

from service.auth import Admin, Caller
from service.context import Context, UsesContext
from service.hosts import absolute
from service.operations import Router
from service.paging import Cursor, Limit, Page, Paging
from service.routes import problems
from service.schemas.base import Answer, Form, Instant, Text
from service.tabular import write_csv
from store.audit_check import check_chain
from store.queries.audit import name_entries, read_entries, select_entries
from store.tables import AuditEntry


class AuditEntryAnswer(
    Answer,
    restates=AuditEntry,
    fields="seq at actor action subject_type subject_id before after previous_sha256 sha256",
):
    actor_name: str | None = Field(default=None, description="Of the key, as it is named today.")
    subject_name: str | None = Field(default=None, description="Of what was changed, as it is named today.")
    about_id: str | None = Field(default=None, description="What the subject is or belongs to.")


class AuditChainAnswer(Answer):
    """State of an organisation's chain, as far as one request checks it."""

    state: Literal["intact", "broken", "unfinished"]
    entries: int = Field(ge=0, description="How many were checked by this request and are as they were.")
    head: str | None = Field(default=None, description="`seq:sha256` of the last entry. Note it elsewhere.")
    broken_at: int | None = Field(default=None, description="The first entry that is not as it was.")
    detail: str | None = None
    next: str | None = Field(default=None, description="Address that checks the next entries.")


router = Router(prefix="/v1/audit", tags=["audit"])

_LARGEST_SEQ = 2**63 - 1
_MOST_CHECKED = 10_000


def _exports(media_type: str) -> dict[int | str, dict[str, Any]]:
    return {200: {"content": {media_type: {"schema": {"type": "string"}}}}, **problems()}


class AuditQuery(Form):
    """Which entries."""

    actor: Text | None = Field(default=None, description="Id of a key, or worker, sweeper, service.")
    action: Text | None = Field(default=None, description="Such as `publication.create`.")
    subject_type: Text | None = Field(default=None, description="Such as `campaign`.")
    subject_id: Text | None = Field(default=None, description="Only what was done to this.")
    start: Instant | None = Field(default=None, alias="from", description="At this time or later.")
    end: Instant | None = Field(default=None, alias="to", description="Before this time.")


class AuditListing(AuditQuery):
    limit: Limit = 100
    cursor: Cursor = None


Chosen = Annotated[AuditQuery, Query()]


@router.get("", response_model=Page[AuditEntryAnswer], responses=problems())
def list_audit_entries(
    request: Request, query: Annotated[AuditListing, Query()], caller: Admin, context: UsesContext
) -> Response:
    """List who did what in your organisation, from what to what, newest first."""
    chosen = query.model_dump(exclude={"limit", "cursor"})
    with context.database.reading() as session:
        return Paging(request, query.limit, query.cursor).send(
            session,
            select_entries(caller.organisation_id, **chosen),
            lambda found: [
                AuditEntryAnswer.restate(row, **named)
                for row, named in zip(found, name_entries(session, found), strict=True)
            ],
            newest_first=True,
        )


@router.get("/entries.csv", response_class=Response, responses=_exports("text/csv"))
def get_audit_csv(query: Chosen, caller: Admin, context: UsesContext) -> Response:
    """Export the entries, oldest first, as a spreadsheet; `before` and `after` are JSON."""
    return _send(_write_csv(_read(context, caller, query)), "csv", "text/csv")


@router.get("/entries.jsonl", response_class=Response, responses=_exports("application/jsonl"))
def get_audit_jsonl(query: Chosen, caller: Admin, context: UsesContext) -> Response:
    """Export the entries, oldest first, one JSON object a line, with all that their hashes cover."""
    lines = (json.dumps(row, ensure_ascii=False) + "\n" for row in _read(context, caller, query))
    return _send(lines, "jsonl", "application/jsonl")


@router.get("/chain", response_model=AuditChainAnswer, responses=problems())
def get_audit_chain(
    request: Request,
    caller: Admin,
    context: UsesContext,
    after: Annotated[int, Query(ge=0, le=_LARGEST_SEQ, description="Continue behind this entry.")] = 0,
) -> Response:
    """Recompute the hashes of your organisation's entries, at most 10,000 a request; `next` continues.

    An entry that was edited, deleted, inserted or moved breaks the chain. A recomputation of the whole chain
    shows only against a `head` that was noted elsewhere before.
    """
    with context.database.reading(snapshot=True) as session:
        head, fault, ended = check_chain(session, caller.organisation_id, after=after, most=_MOST_CHECKED)
    state: Literal["intact", "broken", "unfinished"] = (
        "broken" if fault else "intact" if ended else "unfinished"
    )
    following = request.url.include_query_params(after=head.seq)
    return AuditChainAnswer(
        state=state,
        entries=head.entries,
        head=str(head) if state == "intact" else None,
        broken_at=fault.seq if fault else None,
        detail=fault.what if fault else None,
        next=absolute(request, f"{following.path}?{following.query}") if not ended else None,
    ).respond()


def _read(context: Context, caller: Caller, query: AuditQuery) -> Iterator[dict[str, Any]]:
    rows = select_entries(caller.organisation_id, **query.model_dump())
    for row, named in read_entries(context.database, rows):
        yield AuditEntryAnswer.restate(row, **named).dump()


def _write_csv(rows: Iterator[dict[str, Any]]) -> Iterator[str]:
    columns = list(AuditEntryAnswer.model_fields)
    yield write_csv([], columns)
    for row in rows:
        values = {
            name: json.dumps(value) if isinstance(value, dict) else value for name, value in row.items()
        }
        yield write_csv([values], columns, head=False)


def _send(parts: Iterator[str], suffix: str, media_type: str) -> Response:
    headers = {"Content-Disposition": f'attachment; filename="audit.{suffix}"'}
    return StreamingResponse(parts, headers=headers, media_type=media_type)
