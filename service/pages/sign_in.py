"""Into a session with a key, and out of it."""

import math
from datetime import timedelta
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import APIRouter, Form, Request, Response
from fastapi.responses import RedirectResponse

from radiometry.findings import interface
from service.http import auth, counts, problems, signatures
from service.http.context import Context, UsesContext
from service.pages.rendering import render
from store.queries.organisations import find_ended_key, find_key
from store.tables import ApiKey, WebSession, utc_now

router = APIRouter(include_in_schema=False)


@router.get("/sign-in")
def show_sign_in(request: Request, context: UsesContext, next: str = "/", *, ended: bool = False) -> Response:  # noqa: A002  as in addresses
    if auth.find_session(request, context) is not None:
        return RedirectResponse(_local(next), 303)
    if request.headers.get("sec-fetch-site") in {"cross-site", "same-site"}:
        # a link from elsewhere comes without the cookie, which is strict: a page of ours asks again
        return render(request, "again.html", title="One moment", next=_local(next))
    # a session that has ended: its cookie is still there, or a page of ours was told so
    return _form(request, next, ended=ended or context.sessions.cookie in request.cookies)


@router.post("/sign-in")
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
        found = find_key(session, key)
        ended = None if found else find_ended_key(session, key)
    unfit = ended or (found[0] if found and "read" not in found[0].scopes else None)
    if found is None or unfit is not None:
        return _refuse(request, context, next, address, unfit)
    context.attempts.trust(key)
    opened, organisation = found
    browser = "".join(c for c in request.headers.get("user-agent", "") if c.isprintable())
    expires_at = utc_now() + timedelta(seconds=signatures.SESSION_S)
    with context.database.writing(opened.id, organisation.id) as session:
        row = WebSession(
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


@router.post("/sign-out")
def sign_out(request: Request, context: UsesContext, csrf_token: Annotated[str, Form()] = "") -> Response:
    if (caller := auth.find_session(request, context)) is not None:
        auth.require_csrf_token(request, context, csrf_token)
        with context.database.writing(caller.key_id, caller.organisation_id) as session:
            session.get_one(WebSession, caller.session_id).ended_at = utc_now()
    answer = RedirectResponse("/sign-in", 303)
    answer.delete_cookie(context.sessions.cookie, httponly=True, samesite="strict")
    return answer


def _refuse(
    request: Request, context: Context, next_address: str, address: str, unfit: ApiKey | None
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
