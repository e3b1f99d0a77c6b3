"""Templates, static files and problems for people."""

import hashlib
import json
import mimetypes
import posixpath
import re
from collections.abc import Awaitable, Callable
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, FastAPI, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from radiometry.findings import interface
from radiometry.records import Record
from service.calibrations.methods import describe_methods
from service.calibrations.schemas import NewPublication, NewRevocation
from service.campaigns import routes, schemas
from service.equipment.routes import NewRig
from service.equipment.schemas import Certificate, Lens, NewCamera, NewMeter, NewPanel
from service.frames.schemas import FrameChange
from service.http import answers, middleware, models
from service.http.auth import SCOPE_WORDS, Caller, find_session
from service.http.context import UsesContext
from service.http.problems import Problem
from service.measurements.requests import MeasurementOptions, NewGrid
from service.organisation.routes import NewKey, OrganisationChange
from service.tools.routes import describe_tools

SHOWN: Final[tuple[type[models.Form], ...]] = (
    *(Certificate, FrameChange, routes.ItemChange, Lens, MeasurementOptions, NewCamera, schemas.NewCampaign),
    *(NewGrid, NewKey, NewMeter, NewPanel, NewPublication, schemas.NewReading, NewRevocation, NewRig),
    *(schemas.NewRoi, routes.NewSignature, OrganisationChange),
)
"""Forms that a page asks a person to fill in."""


def describe_fields() -> dict[str, dict[str, str]]:
    return {
        form.__name__: {name: field.description or "" for name, field in form.model_fields.items()}
        for form in SHOWN
    }


_OWN: Final = Path(__file__).parent / "static"
_PUBLIC: Final = "public, max-age=31536000, immutable"
_IMPORT: Final = re.compile(r'^(?:import|export|\}) .*?"(\..*?\.js)";$', re.MULTILINE)
_LATER: Final = re.compile(r'await import\("(\..*?\.js)"\)')
_TEXT: Final = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}

router = APIRouter(include_in_schema=False)


class Assets:
    """Our own files, each known by name; nothing else in any folder can be asked for."""

    def __init__(self) -> None:
        methods = json.dumps(describe_methods().dump()["items"])
        self._own = {
            path.relative_to(_OWN).as_posix(): path.read_bytes() for path in sorted(_OWN.rglob("*.*"))
        } | {
            "specification.js": f"export const METHODS = {methods};\n".encode(),
            "fields.js": f"export const FIELDS = {json.dumps(describe_fields())};\n".encode(),
            "calculators.js": f"export const TOOLS = {json.dumps(describe_tools())};\n".encode(),
        }
        digest = hashlib.sha256()
        for name, content in self._own.items():
            digest.update(name.encode() + b"\0" + content)
        self.release = digest.hexdigest()[:16]

    def url(self, name: str) -> str:
        if name not in self._own:
            raise KeyError(name)
        return f"/static/{self.release}/{name}"

    def imported(self, name: str) -> list[str]:
        """The addresses of all that a module imports, and that those import in turn."""
        return [self.url(each) for each in self._follow([name])[1:]]

    def later(self, name: str) -> list[str]:
        """The addresses of what a module itself asks for only when it runs: its imports may never do so."""
        first = self._follow([name])
        return [self.url(each) for each in self._follow(self._named(_LATER, name)) if each not in first]

    def _follow(self, names: list[str]) -> list[str]:
        found = list(names)
        for each in found:
            found += dict.fromkeys(other for other in self._named(_IMPORT, each) if other not in found)
        return found

    def _named(self, pattern: re.Pattern[str], module: str) -> list[str]:
        folder = posixpath.dirname(module)
        text = self._own[module].decode()
        return [posixpath.normpath(posixpath.join(folder, other)) for other in pattern.findall(text)]

    def find(self, release: str, name: str) -> bytes | None:
        """The file at an address; a page of an earlier release finds what it asks for no more."""
        return self._own.get(name) if release == self.release else None


@router.get("/static/{release}/{name:path}")
async def get_asset(request: Request, release: str, name: str) -> Response:
    assets: Assets = request.app.state.assets
    if (content := assets.find(release, name)) is None:
        raise Problem(interface.NOT_FOUND, "There is no such file here. Reload the page that asks for it.")
    headers = {"Cache-Control": _PUBLIC, "Vary": "Accept-Encoding"}
    headers = answers.unless_kept(request, f"{release}-{name}", headers)
    suffix = posixpath.splitext(name)[1]
    media_type = _TEXT.get(suffix) or mimetypes.guess_type(name)[0]
    return Response(content, headers=headers, media_type=media_type)


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
    sessions = request.app.state.context.sessions
    csrf = sessions.csrf_token(request.cookies.get(sessions.cookie, "")) if caller else ""
    html = request.app.state.templates.get_template(template).render(
        title=title, visitor=caller, csrf_token=csrf, path=request.url.path, **values
    )
    headers = {"Content-Security-Policy": middleware.CONTENT_POLICY, "Cache-Control": "no-store"}
    return HTMLResponse(html, status, headers)


class Page(Record):
    """A page for signed-in users."""

    request: Request
    caller: Caller

    def render(self, template: str, *, title: str, **values: Any) -> HTMLResponse:  # noqa: ANN401
        return render(self.request, template, title=title, caller=self.caller, **values)


def _signed_in(request: Request, context: UsesContext) -> Page:
    if (caller := find_session(request, context)) is None:
        query = f"?{request.url.query}" if request.url.query else ""
        raise SignInNeeded(f"{request.url.path}{query}" if request.method == "GET" else "/")
    context.rates.take(caller.organisation_id)
    return Page(request=request, caller=caller)


SignedInPage = Annotated[Page, Depends(_signed_in)]


Handler = Callable[[Request, Any], Awaitable[Response]]


def install(app: FastAPI) -> None:
    """Wrap the handlers that stand by now; install those of the API first."""
    handlers: dict[Any, Handler] = app.exception_handlers  # type: ignore[assignment]
    for kind, handler in list(handlers.items()):
        app.add_exception_handler(kind, _for_people(handler))

    @app.exception_handler(SignInNeeded)
    async def sign_in(_request: Request, error: SignInNeeded) -> Response:
        return RedirectResponse(error.address, 303)


def _for_people(handler: Handler) -> Handler:
    async def handle(request: Request, error: Exception) -> Response:
        answer = await handler(request, error)
        if not _wants_page(request) or answer.media_type != "application/problem+json":
            return answer
        problem = json.loads(bytes(answer.body))
        page = render(
            request,
            "problem.html",
            title=problem["title"],
            status=answer.status_code,
            problem=problem,
            caller=None if answer.status_code >= 500 else find_session(request, request.app.state.context),
        )
        for name in ("allow", "retry-after"):
            if name in answer.headers:
                page.headers[name] = answer.headers[name]
        return page

    return handle


def _wants_page(request: Request) -> bool:
    return "text/html" in request.headers.get("accept", "") and not request.url.path.startswith("/v1/")
