"""Problems for people: a browser that asks for a page gets one; the API's clients get what they always do."""

import json
from collections.abc import Awaitable, Callable
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.responses import RedirectResponse

from service.auth import find_session
from service.web.rendering import SignInNeeded, render

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
