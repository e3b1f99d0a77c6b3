"""Your own organisation: its keys and sessions, and its audit trail."""

import json
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from fastapi import Query, Request, Response
from fastapi.responses import StreamingResponse
from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.http import answers, auth, changes, connections, lookup, operations, paging, problems, tables
from service.http.auth import Admin, Anybody, Caller, Scope
from service.http.context import Context, UsesContext
from service.http.models import (
    Answer,
    Clearable,
    ClearableLong,
    ClearableZone,
    Form,
    Instant,
    Period,
    Text,
    maybe,
    told,
)
from service.http.paging import Page, UsesPaging
from store.audit_check import check_chain
from store.queries import add
from store.queries.audit import name_entries, read_entries, select_entries
from store.queries.organisations import Person, create_key, end_sessions, has_other_admin, is_open, new_secret
from store.queries.usage import MOST_JOBS_WAITING, read_usage
from store.tables import ApiKey, AuditEntry, Organisation, WebSession, utc_now


class OrganisationChange(Form):
    name: Text | None = maybe("Of your laboratory, as certificates print it.")
    address: ClearableLong | None = maybe("Of your laboratory, as certificates print it.")
    refuses_incomplete_certificates: bool | None = maybe(
        "Publishing answers 409 `certificate_incomplete` while a certificate has gaps.", strict=True
    )
    time_zone: ClearableZone | None = maybe(
        "Of the clocks of your cameras, for files that state no offset and campaigns that state "
        "no other: an IANA name or an offset. Files of Parrot and MicaSense cameras are in UTC."
    )


def require_free_name(session: Session, name: str, *, but: str = "") -> None:
    taken = select(Organisation.id).where(Organisation.name == name, Organisation.id != but)
    if session.scalar(taken) is not None:
        raise problems.Problem(interface.CONFLICT, f"The organisation {name!r} exists already.")


class UsageAnswer(Answer):
    """Usage of an organisation; a limit that is absent is none."""

    frames: int
    frames_limit: int | None = None
    stored_bytes: int = told("Of the files of its frames.")
    stored_bytes_limit: int | None = None
    jobs_waiting: int
    jobs_waiting_limit: int = MOST_JOBS_WAITING
    requests_in_minute: int = told("As the process that answers has counted them.")
    requests_in_minute_limit: int | None = None


class OwnOrganisationAnswer(
    Answer,
    restates=Organisation,
    fields="id name address refuses_incomplete_certificates time_zone created_at",
):
    usage: UsageAnswer | None = maybe("In the answer to GET.")


router = operations.Router(prefix="/v1/organisation", tags=["keys"])


@router.get("", response_model=OwnOrganisationAnswer)
def get_organisation(caller: auth.Reader, context: UsesContext, session: Session) -> Response:
    """The organisation that your key belongs to, and what it uses of what it may."""
    row, settings = session.get_one(Organisation, caller.organisation_id), context.settings
    usage = UsageAnswer.restate(
        read_usage(session, row.id),
        frames_limit=settings.quota_frames or None,
        stored_bytes_limit=settings.quota_bytes or None,
        requests_in_minute=context.rates.used(row.id),
        requests_in_minute_limit=settings.quota_requests_per_minute or None,
    )
    return OwnOrganisationAnswer.restate(row, usage=usage).respond()


@router.patch("", response_model=OwnOrganisationAnswer, responses=answers.problems(409))
def change_organisation(body: OrganisationChange, caller: Admin, session: Session) -> changes.Reply:
    """Set name and address of certificates, the time zone of cameras ("" for none), and what is refused."""
    organisation = session.get_one(Organisation, caller.organisation_id)
    if body.name is not None:
        require_free_name(session, body.name, but=organisation.id)
    for name, value in body.model_dump(exclude_unset=True).items():
        setattr(organisation, name, None if value == "" else value)
    return changes.Reply(status=200, body=OwnOrganisationAnswer.restate(organisation))


class AuditEntryAnswer(
    Answer,
    restates=AuditEntry,
    fields="seq at actor action subject_type subject_id before after previous_sha256 sha256",
):
    actor_name: str | None = maybe("Of the key, as it is named today.")
    subject_name: str | None = maybe("Of what was changed, as it is named today.")
    about_id: str | None = maybe("What the subject is or belongs to.")


class AuditChainAnswer(Answer):
    """State of an organisation's chain, as far as one request checks it."""

    state: Literal["intact", "broken", "unfinished"]
    entries: int = told("How many were checked by this request and are as they were.", ge=0)
    head: str | None = maybe("`seq:sha256` of the last entry. Note it elsewhere.")
    broken_at: int | None = maybe("The first entry that is not as it was.")
    detail: str | None = None
    next: str | None = maybe("Address that checks the next entries.")


audit_router = operations.Router(prefix="/v1/audit", tags=["audit"])

_LARGEST_SEQ = 2**63 - 1
_MOST_CHECKED = 10_000


class AuditQuery(Period):
    """Which entries."""

    actor: Text | None = maybe("Id of a key, or worker, sweeper, service.")
    action: Text | None = maybe("Such as `publication.create`.")
    subject_type: Text | None = maybe("Such as `campaign`.")
    subject_id: Text | None = maybe("Only what was done to this.")
    start: Instant | None = maybe("At this time or later.", alias="from")
    end: Instant | None = maybe("Before this time.", alias="to")


class AuditListing(AuditQuery):
    limit: paging.Limit = 100
    cursor: paging.Cursor = None


Chosen = Annotated[AuditQuery, Query()]


@audit_router.get("", response_model=paging.Page[AuditEntryAnswer])
def list_audit_entries(
    request: Request, query: Annotated[AuditListing, Query()], caller: Admin, session: Session
) -> Response:
    """List who did what in your organisation, from what to what, newest first."""
    chosen = query.model_dump(exclude={"limit", "cursor"})
    return paging.Paging(request=request, limit=query.limit, cursor=query.cursor).send(
        session,
        select_entries(caller.organisation_id, **chosen),
        lambda found: [
            AuditEntryAnswer.restate(row, **named)
            for row, named in zip(found, name_entries(session, found), strict=True)
        ],
        newest_first=True,
    )


@audit_router.get("/entries.csv", response_class=Response, responses=answers.text())
def get_audit_csv(query: Chosen, caller: Admin, context: UsesContext) -> Response:
    """Export the entries, oldest first, as a spreadsheet; `before` and `after` are JSON."""
    return _send(_write_csv(_read(context, caller, query)), "csv", "text/csv")


@audit_router.get("/entries.jsonl", response_class=Response, responses=answers.text("application/jsonl"))
def get_audit_jsonl(query: Chosen, caller: Admin, context: UsesContext) -> Response:
    """Export the entries, oldest first, one JSON object a line, with all that their hashes cover."""
    lines = (json.dumps(row, ensure_ascii=False) + "\n" for row in _read(context, caller, query))
    return _send(lines, "jsonl", "application/jsonl")


@audit_router.get("/chain", response_model=AuditChainAnswer)
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

    return AuditChainAnswer(
        state=state,
        entries=head.entries,
        head=str(head) if state == "intact" else None,
        broken_at=fault.seq if fault else None,
        detail=fault.what if fault else None,
        next=None if ended else connections.address_with(request, after=head.seq),
    ).respond()


def _read(context: Context, caller: Caller, query: AuditQuery) -> Iterator[dict[str, Any]]:
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


class NewKey(Form):
    name: Text = told("Of the person, device or program that uses the key; the audit trail names it.")
    scopes: list[Scope] = told("What the key may do; it cannot be changed later.", min_length=1, max_length=5)
    person: Text | None = maybe("Who uses the key: certificates name who fitted and who approved.")
    role: Text | None = maybe("Of the person in the laboratory.")
    expires_at: Instant | None = maybe(
        "The key, and sessions opened with it, end then; without it, when revoked. Not in the past."
    )


class KeyChange(Form):
    person: Clearable | None = maybe('Who uses the key, as certificates name them; "" takes them away.')
    role: Clearable | None = maybe("Of the person in the laboratory.")


class KeyAnswer(
    Answer, restates=ApiKey, fields="id name person role scopes created_at expires_at last_used_at revoked_at"
):
    scopes: list[Scope]
    secret: str | None = maybe(
        "The key itself: shown once, kept only as a hash, not repeated to a repeated request."
    )

    def keep(self) -> dict[str, Any]:
        return self.model_copy(update={"secret": None}).dump()


class OrganisationNamed(Answer, restates=Organisation, fields="id name"):
    pass


class OwnKeyAnswer(Answer, restates=ApiKey, fields="id name person role created_at expires_at last_used_at"):
    """The key of the one who asks, and the organisation that it belongs to."""

    scopes: list[Scope]
    organisation: OrganisationNamed


class NewOrganisation(Form):
    name: Text


class OrganisationAnswer(Answer, restates=Organisation, fields="id name created_at"):
    key: KeyAnswer | None = maybe("The organisation's first key, with every scope.")

    def keep(self) -> dict[str, Any]:
        return self.dump() | ({"key": self.key.keep()} if self.key else {})


class SessionAnswer(
    Answer, restates=WebSession, fields="id key_id browser created_at expires_at last_used_at ended_at"
):
    """A browser that is signed in with a key."""

    key_name: str
    person: str | None = maybe("Of the key.")
    current: bool = told("Whether it is the one that asks.")


class EndedSessions(Answer):
    ended: int = told("How many sessions were ended.", ge=0)


keys_router = operations.Router(prefix="/v1", tags=["keys"])


@keys_router.post(
    "/organisations", status_code=201, response_model=OrganisationAnswer, responses=answers.problems(409)
)
def create_organisation(body: NewOrganisation, caller: Admin, session: Session) -> changes.Reply:
    """Found an organisation; its first key is shown once. Only the operator's admins may."""
    if not caller.operator:
        raise problems.Problem(
            interface.SCOPE_MISSING, "Only an administrator of the operator can create organisations."
        )
    require_free_name(session, body.name)
    organisation = add(session, Organisation(name=body.name))
    key = _create(session, organisation.id, NewKey(name="first", scopes=list(auth.SCOPES)))
    return changes.Reply(status=201, body=OrganisationAnswer.restate(organisation, key=key))


@keys_router.post("/keys", status_code=201, response_model=KeyAnswer)
def create_api_key(body: NewKey, caller: Admin, session: Session) -> changes.Reply:
    """Make a key of your organisation. Its secret is in this answer and nowhere else."""
    return changes.Reply(status=201, body=_create(session, caller.organisation_id, body))


@keys_router.get("/keys", response_model=Page[KeyAnswer])
def list_keys(paging: UsesPaging, caller: Admin, session: Session) -> Response:
    """The keys of your organisation, without their secrets."""
    return paging.send_own(session, caller, select(ApiKey), KeyAnswer.restate)


@keys_router.get("/keys/own", response_model=OwnKeyAnswer)
def get_own_key(caller: Anybody, session: Session) -> Response:
    """The key that you ask with: whose it is and what it may do. Any key may ask."""
    key = session.get_one(ApiKey, caller.key_id)
    organisation = session.get_one(Organisation, caller.organisation_id)
    return OwnKeyAnswer.restate(key, organisation=organisation).respond()


@keys_router.patch("/keys/{key_id}", response_model=KeyAnswer)
def change_key(key: lookup.Own[ApiKey], body: KeyChange, _caller: Admin) -> changes.Reply:
    """State the person behind a key, with name and role ("" for none). Issued certificates stay as they are.

    Whoever publishes with the key signs the certificates that are issued then.
    """
    for name, value in body.model_dump(exclude_unset=True).items():
        setattr(key, name, value or None)
    _require_both(key.person, key.role)
    return changes.Reply(status=200, body=KeyAnswer.restate(key))


@keys_router.delete("/keys/{key_id}", response_model=KeyAnswer, responses=answers.problems(409))
def revoke_key(key: lookup.Own[ApiKey], _caller: Admin, session: Session) -> changes.Reply:
    """Revoke a key at once, and end the sessions opened with it. It stays in the record.

    The last key in force with the scope `admin` cannot be revoked: make another one first.
    """
    if key.revoked_at is None and not has_other_admin(session, key):
        raise problems.Problem(
            interface.CONFLICT, "This is the last key that can manage keys. Make another first."
        )
    end_sessions(session, key)
    key.revoked_at = key.revoked_at or utc_now()
    return changes.Reply(status=200, body=KeyAnswer.restate(key))


def _create(session: Session, organisation_id: str, new: NewKey) -> KeyAnswer:
    secret = new_secret()
    if new.expires_at is not None and new.expires_at <= utc_now():
        raise problems.wrong("body.expires_at", "lies in the past: such a key would open nothing")
    _require_both(new.person, new.role)
    key = create_key(
        session,
        organisation_id=organisation_id,
        name=new.name,
        person=Person(new.person, new.role) if new.person and new.role else None,
        scopes=list(new.scopes),
        secret=secret,
        expires_at=new.expires_at,
    )
    return KeyAnswer.restate(key, secret=secret)


def _require_both(person: str | None, role: str | None) -> None:
    if bool(person) != bool(role):
        lacking = "role" if person else "person"
        raise problems.wrong(f"body.{lacking}", "is missing: a certificate names a person with name and role")


sessions_router = operations.Router(prefix="/v1/sessions", tags=["keys"])

OfKey = Annotated[Text | None, Query(description="Only those opened with this key.")]


@sessions_router.get("", response_model=Page[SessionAnswer])
def list_sessions(paging: UsesPaging, caller: Anybody, session: Session, key_id: OfKey = None) -> Response:
    """The browsers that are signed in with your key; for an admin, with any key of the organisation."""
    rows = _select(caller, key_id)
    return paging.send(session, rows, lambda found: [_answer(session, row, caller) for row in found])


@sessions_router.delete("", response_model=EndedSessions)
def end_other_sessions(caller: Anybody, session: Session, key_id: OfKey = None) -> changes.Reply:
    """End every session that the list shows, except the one that asks."""
    others = [row for row in session.scalars(_select(caller, key_id)) if row.id != caller.session_id]
    for row in others:
        row.ended_at = utc_now()
    return changes.Reply(status=200, body=EndedSessions(ended=len(others)))


@sessions_router.delete("/{session_id}", response_model=SessionAnswer)
def end_session(session_id: lookup.Id, caller: Anybody, session: Session) -> changes.Reply:
    """End a session at once: its browser has to sign in again. It stays in the record."""
    row = lookup.owned(session, WebSession, session_id, caller)
    if row.key_id != caller.key_id and not _is_admin(caller):
        raise problems.not_found("session")
    row.ended_at = row.ended_at or utc_now()
    return changes.Reply(status=200, body=_answer(session, row, caller))


def _select(caller: Caller, key_id: str | None) -> Select[WebSession]:
    rows = (
        select(WebSession)
        .join(ApiKey, ApiKey.id == WebSession.key_id)
        .where(WebSession.organisation_id == caller.organisation_id, *is_open(), ApiKey.revoked_at.is_(None))
    )
    if not _is_admin(caller):
        rows = rows.where(WebSession.key_id == caller.key_id)
    return rows if key_id is None else rows.where(WebSession.key_id == key_id)


def _is_admin(caller: Caller) -> bool:
    return "admin" in caller.scopes


def _answer(session: Session, row: WebSession, caller: Caller) -> SessionAnswer:
    key = session.get_one(ApiKey, row.key_id)
    return SessionAnswer.restate(
        row, key_name=key.name, person=key.person, current=row.id == caller.session_id
    )
