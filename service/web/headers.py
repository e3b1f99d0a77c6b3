"""Security headers of every answer."""

from typing import Final

from starlette.types import ASGIApp, Message, Receive, Scope, Send

_ALWAYS: Final = {
    b"x-content-type-options": b"nosniff",
    b"x-frame-options": b"DENY",
    # a form that is sent without its origin could not be told from a stranger's
    b"referrer-policy": b"same-origin",
    b"cross-origin-opener-policy": b"same-origin",
    b"permissions-policy": b"camera=(), microphone=(), geolocation=(), payment=(), usb=()",
}


# our own files only, and nothing inline; blob: the preview of a file that is not sent yet
CONTENT_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; "
    "worker-src 'self'; form-action 'self'; frame-ancestors 'none'; base-uri 'none'"
)


class SecurityHeaders:
    """Adds what an answer does not say for itself."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = message["headers"]
                named = dict(own)
                wanted = _ALWAYS
                if named.get(b"content-type", b"").startswith(b"text/html"):
                    wanted = _ALWAYS | {b"content-security-policy": CONTENT_POLICY.encode()}
                message["headers"] = [*own, *(each for each in wanted.items() if each[0] not in named)]
            await send(message)

        await self._app(scope, receive, guarded if scope["type"] == "http" else send)
