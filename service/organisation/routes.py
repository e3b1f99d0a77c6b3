"""Your own organisation, and its audit trail."""

import json
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from fastapi import Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.http import answers, auth, changes, connections, operations, paging, tables
from service.http.context import Context, UsesContext
from service.http.models import Answer, ClearableLong, ClearableZone, Form, Instant, Text
from service.http.problems import Problem
from store.audit_check import check_chain
from store.queries.audit import name_entries, read_entries, select_entries
from store.queries.usage import Quotas, Used, read_usage
from store.settings import Settings
from store.tables import AuditEntry, Organisation


class OrganisationChange(Form):
    name: Text | None = Field(default=None, description="Of your laboratory, as certificates print it.")
    address: ClearableLong | None = Field(
        default=None, description="Of your laboratory, as certificates print it."
    )
    refuses_incomplete_certificates: bool | None = Field(
        default=None,
        description="Publishing answers 409 `certificate_incomplete` while a certificate has gaps.",
        strict=True,
    )
    time_zone: ClearableZone | None = Field(
        default=None,
        description="Of the clocks of your cameras, for files that state no offset and campaigns that state "
        "no other: an IANA name or an offset. Files of Parrot and MicaSense cameras are in UTC.",
    )


def require_free_name(session: Session, name: str, *, but: str = "") -> None:
    taken = select(Organisation.id).where(Organisation.name == name, Organisation.id != but)
    if session.scalar(taken) is not None:
        raise Problem(interface.CONFLICT, f"The organisation {name!r} exists already.")


class UsageAnswer(Answer):
    """Usage of an organisation; a limit that is absent is none."""

    frames: int
    frames_limit: int | None = None
    stored_bytes: int = Field(description="Of the files of its frames.")
    stored_bytes_limit: int | None = None
    jobs_waiting: int
    jobs_waiting_limit: int | None = None
    requests_in_minute: int = Field(description="As the process that answers has counted them.")
    requests_in_minute_limit: int | None = None

    @classmethod
    def of(cls, used: Used, quotas: Quotas, requests: int, settings: Settings) -> "UsageAnswer":
        return cls.restate(
            used,
            frames_limit=quotas.frames or None,
            stored_bytes_limit=quotas.stored_bytes or None,
            jobs_waiting_limit=quotas.jobs_waiting or None,
            requests_in_minute=requests,
            requests_in_minute_limit=settings.quota_requests_per_minute or None,
        )


class OwnOrganisationAnswer(
    Answer,
    restates=Organisation,
    fields="id name address refuses_incomplete_certificates time_zone created_at",
):
    usage: UsageAnswer | None = Field(default=None, description="In the answer to GET.")


router = operations.Router(prefix="/v1/organisation", tags=["keys"])


@router.get("", response_model=OwnOrganisationAnswer, responses=answers.problems())
def get_organisation(caller: auth.Reader, context: UsesContext) -> Any:  # noqa: ANN401
    """The organisation that your key belongs to, and what it uses of what it may."""
    with context.database.reading() as session:
        row = session.get_one(Organisation, caller.organisation_id)
        used = read_usage(session, row.id)
    usage = UsageAnswer.of(used, context.quotas, context.rates.used(row.id), context.settings)
    return OwnOrganisationAnswer.restate(row, usage=usage).respond()


@router.patch("", response_model=OwnOrganisationAnswer, responses=answers.problems(409))
def change_organisation(body: OrganisationChange, caller: auth.Admin, writing: changes.Writes) -> Response:
    """Set name and address of certificates, the time zone of cameras ("" for none), and what is refused."""

    def change(session: Session) -> changes.Reply:
        organisation = session.get_one(Organisation, caller.organisation_id)
        if body.name is not None:
            require_free_name(session, body.name, but=organisation.id)
        for name, value in body.model_dump(exclude_unset=True).items():
            setattr(organisation, name, None if value == "" else value)
        session.flush()
        return changes.Reply(status=200, body=OwnOrganisationAnswer.restate(organisation))

    return writing.run(caller, change)


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


audit_router = operations.Router(prefix="/v1/audit", tags=["audit"])

_LARGEST_SEQ = 2**63 - 1
_MOST_CHECKED = 10_000


def _exports(media_type: str) -> dict[int | str, dict[str, Any]]:
    return {200: {"content": {media_type: {"schema": {"type": "string"}}}}, **answers.problems()}


class AuditQuery(Form):
    """Which entries."""

    actor: Text | None = Field(default=None, description="Id of a key, or worker, sweeper, service.")
    action: Text | None = Field(default=None, description="Such as `publication.create`.")
    subject_type: Text | None = Field(default=None, description="Such as `campaign`.")
    subject_id: Text | None = Field(default=None, description="Only what was done to this.")
    start: Instant | None = Field(default=None, alias="from", description="At this time or later.")
    end: Instant | None = Field(default=None, alias="to", description="Before this time.")


class AuditListing(AuditQuery):
    limit: paging.Limit = 100
    cursor: paging.Cursor = None


Chosen = Annotated[AuditQuery, Query()]


@audit_router.get("", response_model=paging.Page[AuditEntryAnswer], responses=answers.problems())
def list_audit_entries(
    request: Request, query: Annotated[AuditListing, Query()], caller: auth.Admin, context: UsesContext
) -> Response:
    """List who did what in your organisation, from what to what, newest first."""
    chosen = query.model_dump(exclude={"limit", "cursor"})
    with context.database.reading() as session:
        return paging.Paging(request, query.limit, query.cursor).send(
            session,
            select_entries(caller.organisation_id, **chosen),
            lambda found: [
                AuditEntryAnswer.restate(row, **named)
                for row, named in zip(found, name_entries(session, found), strict=True)
            ],
            newest_first=True,
        )


@audit_router.get("/entries.csv", response_class=Response, responses=_exports("text/csv"))
def get_audit_csv(query: Chosen, caller: auth.Admin, context: UsesContext) -> Response:
    """Export the entries, oldest first, as a spreadsheet; `before` and `after` are JSON."""
    return _send(_write_csv(_read(context, caller, query)), "csv", "text/csv")


@audit_router.get("/entries.jsonl", response_class=Response, responses=_exports("application/jsonl"))
def get_audit_jsonl(query: Chosen, caller: auth.Admin, context: UsesContext) -> Response:
    """Export the entries, oldest first, one JSON object a line, with all that their hashes cover."""
    lines = (json.dumps(row, ensure_ascii=False) + "\n" for row in _read(context, caller, query))
    return _send(lines, "jsonl", "application/jsonl")


@audit_router.get("/chain", response_model=AuditChainAnswer, responses=answers.problems())
def get_audit_chain(
    request: Request,
    caller: auth.Admin,
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
        next=connections.absolute(request, f"{following.path}?{following.query}") if not ended else None,
    ).respond()


def _read(context: Context, caller: auth.Caller, query: AuditQuery) -> Iterator[dict[str, Any]]:
    rows = select_entries(caller.organisation_id, **query.model_dump())
    for row, named in read_entries(context.database, rows):
        yield AuditEntryAnswer.restate(row, **named).dump()


def _write_csv(rows: Iterator[dict[str, Any]]) -> Iterator[str]:
    columns = list(AuditEntryAnswer.model_fields)
    yield tables.write_csv([], columns)
    for row in rows:
        values = {
            name: json.dumps(value) if isinstance(value, dict) else value for name, value in row.items()
        }
        yield tables.write_csv([values], columns, head=False)


def _send(parts: Iterator[str], suffix: str, media_type: str) -> Response:
    headers = {"Content-Disposition": f'attachment; filename="audit.{suffix}"'}
    return StreamingResponse(parts, headers=headers, media_type=media_type)
