"""Rendering of templates, for signed-in readers and others."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final
from urllib.parse import urlencode

from fastapi import Depends, Request
from fastapi.responses import HTMLResponse
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from service.auth import SCOPE_WORDS, Caller, find_session
from service.context import UsesContext
from service.web.assets import Assets
from service.web.headers import CONTENT_POLICY

_TEMPLATES: Final = Path(__file__).parent / "templates"


class SignInNeeded(Exception):  # noqa: N818  it is what the browser is told, not a fault
    """Nobody is signed in; ``next_address`` is where to go on afterwards."""

    def __init__(self, next_address: str) -> None:
        super().__init__(next_address)
        self.address = f"/sign-in?{urlencode({'next': next_address})}"


def build_environment(assets: Assets) -> Environment:
    """Templates that escape all they are given, and fail on what they are not."""
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["asset"] = assets.url
    environment.globals["scope_words"] = SCOPE_WORDS
    environment.globals["imported"] = cache(assets.imported)
    environment.globals["imported_later"] = cache(assets.later)
    return environment


def render(
    request: Request,
    template: str,
    *,
    title: str,
    status: int = 200,
    caller: Caller | None = None,
    **values: Any,  # noqa: ANN401
) -> HTMLResponse:
    """A page; with ``caller``, signed in as them."""
    sessions = request.app.state.context.sessions
    csrf = sessions.csrf_token(request.cookies.get(sessions.cookie, "")) if caller else ""
    html = request.app.state.templates.get_template(template).render(
        title=title, visitor=caller, csrf_token=csrf, path=request.url.path, **values
    )
    headers = {"Content-Security-Policy": CONTENT_POLICY, "Cache-Control": "no-store"}
    return HTMLResponse(html, status, headers)


@dataclass(frozen=True, kw_only=True)
class Page:
    """A page for signed-in users."""

    request: Request
    caller: Caller

    def render(self, template: str, *, title: str, **values: Any) -> HTMLResponse:  # noqa: ANN401
        return render(self.request, template, title=title, caller=self.caller, **values)


def _signed_in(request: Request, context: UsesContext) -> Page:
    caller = find_session(request, context)
    if caller is None:
        query = f"?{request.url.query}" if request.url.query else ""
        raise SignInNeeded(f"{request.url.path}{query}" if request.method == "GET" else "/")
    context.rates.take(caller.organisation_id)
    return Page(request=request, caller=caller)


SignedInPage = Annotated[Page, Depends(_signed_in)]
