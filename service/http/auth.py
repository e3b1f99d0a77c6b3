"""Authentication: an API key of one organisation with its scopes, or a browser session opened with it."""

import asyncio
from contextlib import suppress
from typing import Annotated, Final, Literal

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from radiometry.findings import interface
from radiometry.records import Record
from service.http import counts, models, problems, signatures
from service.http.context import Context
from store.queries import organisations
from store.tables import ApiKey, Organisation, utc_now

Scope = Literal["read", "upload", "calibrate", "publish", "admin"]
SCOPE_WORDS: dict[Scope, str] = {
    "read": "view",
    "upload": "send",
    "calibrate": "calibrate",
    "publish": "publish",
    "admin": "manage keys",
}
"""What a key may do, as the pages name it."""
SCOPES = tuple(SCOPE_WORDS)

LATEST_S: Final = 5.0  # what strangers wait at most for their answer
_SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
_bearer = HTTPBearer(auto_error=False, scheme_name="key", description="A key of your organisation.")


class Caller(organisations.Holder):
    session_id: str | None = None  # of the browser that asks; None for who sends the key itself

    @property
    def named(self) -> str:
        return self.person.name if self.person else organisations.UNNAMED

    @property
    def who(self) -> organisations.Who:
        return organisations.Who(self.key_id, self.session_id)

    @classmethod
    def holding(cls, key: ApiKey, organisation: Organisation, session_id: str | None = None) -> "Caller":
        return cls(
            key_id=key.id,
            organisation_id=organisation.id,
            scopes=frozenset(key.scopes),
            operator=organisation.operator,
            key_name=key.name,
            person=organisations.Person.behind(key),
            organisation_name=organisation.name,
            session_id=session_id,
        )


async def get_caller(
    request: Request, _key: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]
) -> Caller:
    """Return who asks; `service/http/operations.py` has found that out before it read what is asked."""
    caller: Caller = request.state.caller
    return caller


async def identify(request: Request) -> None:
    """Find out who asks, for operation and limits; refuse strangers, after the little that they may say."""
    request.state.caller = None
    try:
        if credentials := await _bearer(request):
            request.state.caller = await _find_holder(request, credentials.credentials)
        else:
            request.state.caller = await run_in_threadpool(_find_signed_in, request)
    except problems.Problem as problem:
        late_s = _count_refusal(request) if problem.code == interface.UNAUTHENTICATED else 0.0
        try:
            async for _ in request.stream():
                pass
            await _wait(request, late_s)
        except problems.Problem:
            problem.headers["Connection"] = "close"
            await asyncio.sleep(late_s)
        except ClientDisconnect:
            pass
        raise


def _count_refusal(request: Request) -> float:
    """Return how late a stranger is answered [s]: one address that keeps asking leaves time to others."""
    context: Context = request.app.state.context
    address = counts.name_address(request.client.host if request.client else None)
    if "authorization" in request.headers:
        context.traffic.metrics.wrong_keys.inc()
    context.refused.fail(address)
    return min(context.refused.wait_s(address), LATEST_S)


async def _wait(request: Request, late_s: float) -> None:
    with suppress(TimeoutError):
        async with asyncio.timeout(late_s):
            while (await request.receive())["type"] != "http.disconnect":
                pass


async def _find_holder(request: Request, secret: str) -> Caller:
    context: Context = request.app.state.context
    found = await organisations.find_holder(context.database, secret, noted_since=utc_now() - counts.STEP)
    if found is None:
        raise _unauthenticated(describe_refusal(await run_in_threadpool(_find_ended, context, secret)))
    context.attempts.trust(secret)
    if found.unnoted:
        await run_in_threadpool(context.uses.note, ApiKey, found.key_id)
    context.rates.take(found.organisation_id)
    return Caller(**vars(found))


def _find_ended(context: Context, secret: str) -> ApiKey | None:
    with context.database.reading() as session:
        return organisations.find_ended_key(session, secret)


def _find_signed_in(request: Request) -> Caller:
    """Return who asks by the session, which must prove that its own page asks for a change."""
    context: Context = request.app.state.context
    caller = None if "authorization" in request.headers else find_session(request, context)
    if caller is None:
        raise _unauthenticated("Send a key: Authorization: Bearer <key>.")
    if request.method not in _SAFE_METHODS:
        require_csrf_token(request, context, request.headers.get(signatures.CSRF_HEADER, ""))
    context.rates.take(caller.organisation_id)
    return caller


def find_session(request: Request, context: Context) -> Caller | None:
    """Return who is signed in with this browser, if anyone. The caller checks CSRF."""
    session_id = context.sessions.session_id_of(request.cookies.get(context.sessions.cookie, ""))
    if session_id is None:
        return None
    with context.database.reading() as session:
        found = organisations.find_session_key(session, session_id)
    if found is None:
        return None
    row, key, organisation = found
    for each in (row, key):
        if counts.is_unnoted(each):
            context.uses.note(type(each), each.id)
    return Caller.holding(key, organisation, row.id)


def require_csrf_token(request: Request, context: Context, given: str) -> None:
    """Refuse a change that a browser sends along with its cookie, unless our own page had it sent."""
    if not context.sessions.is_csrf_token(request.cookies.get(context.sessions.cookie, ""), given):
        header = signatures.CSRF_HEADER
        detail = f"A change with a session's cookie needs the page's token in {header}. Reload the page."
        raise problems.Problem(interface.CSRF_TOKEN_WRONG, detail)


def require(caller: Caller, *scopes: Scope) -> None:
    if caller.scopes.isdisjoint(scopes):
        named = " or ".join(map(repr, scopes))
        detail = f"This needs a key with the scope {named}, which your key does not have."
        raise problems.Problem(interface.SCOPE_MISSING, detail)


class Needs(Record, kw_only=False):
    """The scopes of which an operation needs one: checked before the body is read (operations.py)."""

    scopes: tuple[Scope, ...]

    async def __call__(self, caller: Annotated[Caller, Depends(get_caller)]) -> Caller:
        return caller


def describe_refusal(ended: ApiKey | None) -> str:
    """Return why a key opens nothing; whoever has it may know that it was one."""
    if ended is None or ended.revoked_at is not None or ended.expires_at is None:
        return "This key is not known, or it was revoked."
    at = models.rfc3339(ended.expires_at)
    return f"This key expired at {at}. Ask an admin of your organisation for another."


def _unauthenticated(detail: str) -> problems.Problem:
    return problems.Problem(interface.UNAUTHENTICATED, detail, headers={"WWW-Authenticate": "Bearer"})


Anybody = Annotated[Caller, Depends(get_caller)]  # with any key
Reader = Annotated[Caller, Depends(Needs(("read",)))]
Uploader = Annotated[Caller, Depends(Needs(("upload",)))]
ReaderOrUploader = Annotated[Caller, Depends(Needs(("read", "upload")))]
Calibrator = Annotated[Caller, Depends(Needs(("calibrate",)))]
Publisher = Annotated[Caller, Depends(Needs(("publish",)))]
Admin = Annotated[Caller, Depends(Needs(("admin",)))]
