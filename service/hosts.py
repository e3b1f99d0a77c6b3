"""The names that this service answers under: what `Host` says is a stranger's word until it is one."""

import ipaddress
import re
import socket
from functools import lru_cache
from typing import Final
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from radiometry.findings import interface
from service.problems import Problem, answer
from store.settings import Settings

_HOST: Final = re.compile(r"([a-z0-9._-]+|\[[0-9a-f:.]+\])(:\d{1,5})?", re.ASCII | re.IGNORECASE)
_FOR_MACHINES: Final = frozenset({"/livez", "/readyz", "/metrics"})


class Hosts:
    """Names of our own: the settings', this machine's, and addresses that lead only into its network."""

    def __init__(self, settings: Settings) -> None:
        entries = [entry.strip().rstrip("/") for entry in settings.allowed_hosts.split(",")]
        parts = [urlsplit(entry if "//" in entry else f"//{entry}") for entry in entries if entry]
        self._schemes = {part.netloc.lower(): part.scheme for part in parts}
        machine = socket.gethostname().lower()
        self._own = {"localhost", machine, f"{machine}.local", settings.host.lower()} - {""}

    @property
    def are_listed(self) -> bool:
        """Return True if host names are configured; others are then refused."""
        return bool(self._schemes)

    def is_listed(self, host: str) -> bool:
        """Return whether the settings name this host, with its port or for any."""
        return bool({host.lower(), _without_port(host)} & self._schemes.keys())

    def is_own(self, host: str, reached_at: str) -> bool:
        """Return whether the host is this machine, or an address in its network, as far as we can know."""
        if _HOST.fullmatch(host) is None:
            return False
        name = _without_port(host).strip("[]")
        if name in self._own or name.endswith(".localhost"):
            return True
        is_local = _is_local(name)
        return is_local or (is_local is not None and name == reached_at)

    def scheme_of(self, host: str) -> str:
        """Return the scheme that the settings give this host; empty where they give none."""
        return self._schemes.get(host.lower()) or self._schemes.get(_without_port(host), "")


class KnownHosts:
    """Refuses names that are not listed, where any are; and never sends anybody to a host of a stranger's.

    Behind a proxy whose name nobody has listed, addresses in answers are paths: they hold under any name.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        hosts: Hosts = scope["app"].state.context.hosts
        named = Headers(scope=scope).getlist("host")
        if len(named) != 1 and scope["path"] not in _FOR_MACHINES:
            detail = f"The request has {len(named)} Host headers. Send one."
            await answer(Problem(interface.BAD_REQUEST, detail))(scope, receive, send)
            return
        host = "".join(named)
        reached_at = (scope.get("server") or ("",))[0] or ""
        listed = hosts.is_listed(host)
        known = listed or hosts.is_own(host, reached_at)
        if hosts.are_listed and not known and scope["path"] not in _FOR_MACHINES:
            await answer(_refuse())(scope, receive, send)
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


def absolute(request: Request, path_and_query: str) -> str:
    """Return an address of this service: absolute under a name of our own, else a path."""
    base: str = request.scope["state"]["base"]
    return f"{base}{path_and_query}"


@lru_cache(maxsize=1024)
def _is_local(name: str) -> bool | None:
    """Return whether an address leads only into this machine's network; None for what is no address."""
    try:
        address = ipaddress.ip_address(name)
    except ValueError:
        return None
    return address.is_loopback or address.is_private


def _without_port(host: str) -> str:
    return re.sub(r":\d*$", "", host.lower())


def _refuse() -> Problem:
    detail = (
        "This service does not answer under this host name. The operator lists its names in "
        "STILB_ALLOWED_HOSTS."
    )
    return Problem(interface.HOST_NOT_ALLOWED, detail)
