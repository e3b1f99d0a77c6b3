"""Middleware: limits of bodies, compression, HEAD, overridden methods, headers, host names."""

import abc
import asyncio
import re
import time
from collections import Counter
from typing import Final
from urllib.parse import urlsplit

from fastapi import FastAPI
from fastapi.routing import APIRoute
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.gzip import DEFAULT_EXCLUDED_CONTENT_TYPES, GZipMiddleware
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from radiometry.findings import interface
from service.http import auth, connections, counts, problems

MAX_BODY_BYTES: Final = 4 << 20
STRANGER_BYTES: Final = 64_000  # what anybody may say who has no key
STRANGER_S: Final = 5.0
PAUSE_S: Final = 60.0
BYTES_PER_S: Final = 1000  # who has a key may be on a bad line, which pauses, and carries little; files too
OPEN_BYTES: Final = 64 << 20  # of all bodies under way of one organisation, or of one address without a key
_UPLOADS = re.compile(r"POST /v1/campaigns/[^/]+/frames|(POST|PATCH) /v1/uploads(/upl_[^/]+)?")


def is_upload(scope: Scope) -> bool:
    """Return True if what is sent is a file, which streams."""
    return _UPLOADS.fullmatch(f"{scope['method']} {scope['path']}") is not None


class _Layer(abc.ABC):
    """Passes on what is no request of HTTP."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await (self._serve if scope["type"] == "http" else self._app)(scope, receive, send)

    @abc.abstractmethod
    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None: ...


class BodyLimit(_Layer):
    """Refuses a body that is too large, or too slow, for who asks, as soon as that is known."""

    def __init__(self, app: ASGIApp) -> None:
        super().__init__(app)
        self._open: Counter[str] = Counter()

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope)
        if headers.get("content-length", "0") == "0" and "transfer-encoding" not in headers:
            await self._app(scope, receive, send)
            return
        body = _Body(scope, receive, self._open)
        try:
            await self._app(scope, body, send)
        finally:
            self._open[body.whose] -= body.held
            if not self._open[body.whose]:
                del self._open[body.whose]


class _Body:
    """One body, as it comes; of whom, how much of it is held and how long it was waited for, counts."""

    def __init__(self, scope: Scope, receive: Receive, held: Counter[str]) -> None:
        self._scope, self._receive, self._open = scope, receive, held
        self._is_begun = self._is_file = self._is_whole = False
        self._came, self._waited_s = 0, 0.0
        self.held, self.whose = 0, counts.name_address((scope.get("client") or [None])[0])

    async def __call__(self) -> Message:
        if self._is_whole:
            # whoever asks once more waits for the end of the connection, and for nothing else
            while (message := await self._receive())["type"] == "http.request":
                pass
            return message
        if self._scope["method"] == "GET":
            # no such address reads one
            self._is_whole = True
            return {"type": "http.request"}
        state = self._scope.get("state", {})
        caller: auth.Caller | None = state.get("caller")
        most = MAX_BODY_BYTES if caller else STRANGER_BYTES
        if not self._is_begun:
            # the address of a begun upload needs no key: it is a secret of its own
            self._is_file = is_upload(self._scope) and (caller is not None or "caller" not in state)
            self._begin(caller, most)
        message = await self._wait(is_known=caller is not None or self._is_file)
        size = len(message.get("body", b""))
        self._came += size
        self._is_whole = not message.get("more_body", False)
        if not self._is_file:
            self._hold(size, most)
        return message

    async def _wait(self, *, is_known: bool) -> Message:
        """Wait for the next piece as long as the sender may take; the service's own time is not counted."""
        most_s = PAUSE_S + self._came / BYTES_PER_S if is_known else STRANGER_S
        began = time.monotonic()
        try:
            async with asyncio.timeout(min(PAUSE_S, most_s - self._waited_s)):
                return await self._receive()
        except TimeoutError:
            detail = "The body was not there in time: it paused or came too slowly. Send it again."
            raise problems.Problem(
                interface.UPLOAD_INCOMPLETE, detail, headers={"Connection": "close"}
            ) from None
        finally:
            self._waited_s += time.monotonic() - began

    def _hold(self, size: int, most: int) -> None:
        self.held += size
        self._open[self.whose] += size
        if self.held > most:
            raise _too_large(most)
        if self._open[self.whose] > OPEN_BYTES:
            detail = f"Requests under way hold {OPEN_BYTES} bytes already. Wait until some are answered."
            headers = {"Retry-After": "1", "Connection": "close"}
            raise problems.Problem(interface.TOO_MANY_REQUESTS, detail, headers=headers)

    def _begin(self, caller: auth.Caller | None, most: int) -> None:
        self._is_begun = True
        headers = Headers(scope=self._scope)
        if caller:
            self.whose = caller.organisation_id
        announced = headers.get("content-length", "")
        if not self._is_file and announced.isdigit() and int(announced) > most:
            raise _too_large(most)


def _too_large(most: int) -> problems.Problem:
    detail = f"The body may have at most {most} bytes here. Send it in parts."
    return problems.Problem(interface.UPLOAD_TOO_LARGE, detail)


class Addresses:
    """The addresses of an application's routes."""

    def __init__(self, app: FastAPI) -> None:
        self._routes = [route for route in app.routes if isinstance(route, APIRoute)]
        self._rivals: dict[str, list[APIRoute]] = {}

    def methods_of(self, address: str) -> list[str]:
        """Return every method of an address; the framework names those of the first route that it finds."""
        fitting = [each for each in self._routes if self.is_of(each, address)]
        methods = {method for each in fitting for method in each.methods or ()}
        return sorted(methods | {"HEAD"} if "GET" in methods else methods)

    def is_of(self, route: APIRoute, address: str) -> bool:
        """Return whether an address is one of this route: `/keys/own` is none of `/keys/{key_id}`."""
        path, fits = route.path, route.path_regex.match
        if path not in self._rivals:
            narrower = [each for each in self._routes if fits(each.path) and not each.path_regex.match(path)]
            self._rivals[path] = narrower
        return bool(fits(address)) and not any(each.path_regex.match(address) for each in self._rivals[path])


_SMALLEST_BYTES: Final = 1 << 10
_LEVEL: Final = 4
_LEFT: Final = (*DEFAULT_EXCLUDED_CONTENT_TYPES, *("image/*", "application/pdf", "application/octet-stream"))
_REFUSED: Final = re.compile(r"\bgzip\s*;\s*q=0(\.0*)?\s*(?=,|$)")
_MARK: Final = ".gz"
_UNCHANGED: Final = 304


class Compression(_Layer):
    """Packs answers of more than a kilobyte; never pictures, PDFs, stored files or event streams.

    The entity tag of a packed answer ends in a mark, because the same tag would promise the same bytes. A
    page of a signed-in browser is left as it is: its size would tell of the token in it (BREACH).
    """

    def __init__(self, app: ASGIApp) -> None:
        super().__init__(app)
        self._packing = GZipMiddleware(app, _SMALLEST_BYTES, _LEVEL, exclude_content_types=_LEFT)
        self._signed_in = GZipMiddleware(
            app, _SMALLEST_BYTES, _LEVEL, exclude_content_types=(*_LEFT, "text/html")
        )

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = MutableHeaders(scope=scope)
        if "gzip" in (accepted := headers.get("accept-encoding", "").lower()):
            headers["accept-encoding"] = _REFUSED.sub("identity", accepted)
        named = headers.get("if-none-match", "")
        if has_mark := f'{_MARK}"' in named:
            headers["if-none-match"] = named.replace(f'{_MARK}"', '"')

        async def marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = MutableHeaders(scope=message)
                packed = own.get("content-encoding") == "gzip"
                if "etag" in own and (packed or (has_mark and message["status"] == _UNCHANGED)):
                    own["etag"] = own["etag"].removesuffix('"') + f'{_MARK}"'
                if "vary" in own:
                    # it is added to what a route says itself
                    own["vary"] = ", ".join(dict.fromkeys(own["vary"].split(", ")))
            await send(message)

        app = self._signed_in if "cookie" in Headers(scope=scope) else self._packing
        await app(scope, receive, marked)


class Heads(_Layer):
    """Serve a HEAD as the GET of its address, if it has one."""

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        addresses: Addresses = scope["app"].state.addresses
        if scope["method"] != "HEAD" or "GET" not in addresses.methods_of(scope["path"]):
            await self._app(scope, receive, send)
            return
        scope["method"] = "GET"

        async def send_head(message: Message) -> None:
            if message["type"] == "http.response.start":
                # as it came, for the server, which then expects no body, and for the log
                scope["method"] = "HEAD"
                await send(message)
                # the server takes it for the end, and tells what would stream that nobody listens
                await send({"type": "http.response.body", "body": b""})

        await self._app(scope, receive, send_head)


_UPLOAD: Final = "/v1/uploads/"
_METHODS: Final = frozenset({"HEAD", "PATCH", "DELETE"})


class OverriddenMethods(_Layer):
    """Serve a POST to an upload as the method that its header names."""

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["method"] == "POST" and scope["path"].startswith(_UPLOAD):
            method = Headers(scope=scope).get("x-http-method-override", "").upper()
            if method in _METHODS:
                scope["method"] = method
        await self._app(scope, receive, send)


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


class SecurityHeaders(_Layer):
    """Adds what an answer does not say for itself."""

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = message["headers"]
                named = dict(own)
                wanted = _ALWAYS
                if named.get(b"content-type", b"").startswith(b"text/html"):
                    wanted = _ALWAYS | {b"content-security-policy": CONTENT_POLICY.encode()}
                message["headers"] = [*own, *(each for each in wanted.items() if each[0] not in named)]
            await send(message)

        await self._app(scope, receive, guarded)


_FOR_MACHINES: Final = frozenset({"/livez", "/readyz", "/metrics"})


class KnownHosts(_Layer):
    """Refuses names that are not listed, where any are; under others addresses in answers are paths."""

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        hosts: connections.Hosts = scope["app"].state.context.hosts
        named = Headers(scope=scope).getlist("host")
        if len(named) != 1 and scope["path"] not in _FOR_MACHINES:
            detail = f"The request has {len(named)} Host headers. Send one."
            await problems.answer(problems.Problem(interface.BAD_REQUEST, detail))(scope, receive, send)
            return
        host = "".join(named)
        reached_at = (scope.get("server") or ("",))[0] or ""
        listed = hosts.is_listed(host)
        known = listed or hosts.is_own(host, reached_at)
        if hosts.are_listed and not known and scope["path"] not in _FOR_MACHINES:
            detail = "This service does not answer under this host name. The operator lists its names in "
            refusal = problems.Problem(interface.HOST_NOT_ALLOWED, f"{detail}STILB_ALLOWED_HOSTS.")
            await problems.answer(refusal)(scope, receive, send)
            return
        if listed:
            scope["scheme"] = hosts.scheme_of(host) or scope["scheme"]
        scope.setdefault("state", {})["base"] = f"{scope['scheme']}://{host}" if known else ""

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                target = urlsplit(dict(message["headers"]).get(b"location", b"").decode("latin-1"))
                # the framework's own, to the address without its last slash, is the only absolute one
                if target.netloc:
                    MutableHeaders(scope=message)["location"] = target._replace(scheme="", netloc="").geturl()
            await send(message)

        await self._app(scope, receive, guarded)


class CarriesTraffic(_Layer):
    """Lets every request pass through the traffic of the context."""

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        await scope["app"].state.context.traffic.carry(self._app, scope, receive, send)
