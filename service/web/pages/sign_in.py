"""Into a session with a key, and out of it."""

from typing import Annotated
from urllib.parse import urlsplit

from fastapi import APIRouter, Form, Request, Response
from fastapi.responses import RedirectResponse

from service.auth import find_session, require_csrf_token
from service.context import UsesContext
from service.problems import HttpCode, Problem
from service.sessions import COOKIE, SESSION_S
from service.web.rendering import render
from store.queries.keys import find_key

router = APIRouter(include_in_schema=False)


@router.get("/sign-in")
def show_sign_in(
    request: Request,
    context: UsesContext,
    next: str = "/",  # noqa: A002  as in addresses
    *,
    ended: bool = False,
) -> Response:
    if find_session(request, context) is not None:
        return RedirectResponse(_local(next), 303)
    if request.headers.get("sec-fetch-site") in {"cross-site", "same-site"}:
        # a link from elsewhere comes without the cookie, which is strict: a page of ours asks again
        return render(request, "again.html", title="One moment", next=_local(next))
    # a session that has ended: its cookie is still there, or a page of ours was told so
    return _form(request, next, ended=ended or COOKIE in request.cookies)


@router.post("/sign-in")
def sign_in(
    request: Request,
    context: UsesContext,
    key: Annotated[str, Form()] = "",
    next: Annotated[str, Form()] = "/",  # noqa: A002
) -> Response:
    _refuse_other_sites(request)
    with context.database.reading() as session:
        found = find_key(session, key.strip())
    if found is None:
        return _form(request, next, "This key is not known, or it was revoked.")
    if "read" not in found[0].scopes:
        return _form(request, next, "This key may not read. The pages need a key with the scope read.")
    answer = RedirectResponse(_local(next), 303)
    answer.set_cookie(
        COOKIE,
        context.sessions.open(found[0].id),
        max_age=SESSION_S,
        secure=request.url.scheme == "https",
        httponly=True,
        samesite="strict",
    )
    return answer


@router.post("/sign-out")
def sign_out(request: Request, context: UsesContext, csrf_token: Annotated[str, Form()] = "") -> Response:
    if find_session(request, context) is not None:
        require_csrf_token(request, context, csrf_token)
    answer = RedirectResponse("/sign-in", 303)
    answer.delete_cookie(COOKIE, httponly=True, samesite="strict")
    return answer


def _form(request: Request, next_address: str, error: str | None = None, *, ended: bool = False) -> Response:
    return render(
        request,
        "sign-in.html",
        title="Sign in",
        status=401 if error else 200,
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
        raise Problem(403, HttpCode.CSRF_TOKEN_WRONG, "Sign in on the page of this service itself.")
