"""Ready answers: a look-up reads stored bytes, chooses from them where it must, and computes nothing."""

import hashlib
import json
import math
from collections.abc import Sequence
from functools import lru_cache, partial
from typing import Any
from urllib.parse import parse_qsl

from fastapi import Request, Response
from fastapi.routing import APIRoute
from pydantic import ValidationError
from pydantic_core import from_json, to_json
from starlette.routing import BaseRoute, Match
from starlette.types import ASGIApp, Receive, Scope, Send

from radiometry.methods import get_method
from radiometry.specification.application import SurfaceApplication
from service.http.answers import not_modified, standing_headers
from service.http.context import Context
from service.http.models import BandName, Form, Instant, Method, PositiveText, Text
from service.http.operations import NUMBER
from store.ready.lookups import Held
from store.ready.rows import key_of

_SAME_F_NUMBER_REL = 1e-3
_BEARER = "Bearer "


class Wanted(Form):
    """Which coefficients, and as of when."""

    method: Method
    name: Text | None = None
    iso: PositiveText | None = None
    f_number: PositiveText | None = None
    band: BandName | None = None
    at: Instant | None = None
    known_at: Instant | None = None

    @property
    def chosen(self) -> dict[str, Any]:
        """The members that choose from the coefficients of a version."""
        names = ("name", "iso", "band", "f_number")
        return {name: value for name in names if (value := getattr(self, name)) is not None}


def answer_held(request: Request, wanted: Wanted, held: Sequence[Held]) -> Response | None:
    """Answer with the coefficients that were asked for, or 304; None where no version has such a one."""
    chosen = wanted.chosen
    tag, headers = _tag(wanted, held)
    if not chosen and all(each.whole for each in held):
        content = b",".join(inner for each in held if (inner := (each.items or b"")[1:-1]))
        body = b'{"items":[%b]}' % content if content else b""
    else:
        items = [item for each in held for item in _choose(wanted, chosen, each)]
        body = to_json({"items": items}) if items else b""
    if not body:
        return None
    return not_modified(request, tag, headers) or Response(body, 200, headers, "application/json")


def _tag(wanted: Wanted, held: Sequence[Held]) -> tuple[str, dict[str, str]]:
    tag = _hash(tuple(each.etag for each in held), tuple(wanted.chosen.items()))
    return tag, standing_headers(tag)


@lru_cache(maxsize=4096)
def _hash(etags: tuple[str, ...], chosen: tuple[tuple[str, Any], ...]) -> str:
    return hashlib.sha256(json.dumps([etags, dict(chosen)]).encode()).hexdigest()[:32]


def _choose(wanted: Wanted, chosen: dict[str, Any], held: Held) -> list[dict[str, Any]]:
    """Return the items with what was asked for.

    What is known both in general and at f-numbers is answered at the f-number asked for if it is known
    there, else in general.
    """
    stored: list[dict[str, Any]] = from_json(held.items or b"[]")
    asked = {name: value for name, value in chosen.items() if name != "f_number"}
    items = [
        (place, item)
        for place, item in enumerate(stored)
        if all(item.get(name) == value for name, value in asked.items())
    ]
    at = wanted.f_number
    if at is None:
        general = {key_of(item) for _, item in items if "f_number" not in item}
        return [item for _, item in items if "f_number" not in item or key_of(item) not in general]
    there = {key_of(item) for _, item in items if _is_at(item, at)}
    foreseen = json.loads(held.foreseen or "{}")
    found = []
    for place, item in items:
        if _is_at(item, at):
            found.append(item)
        elif "f_number" not in item and key_of(item) not in there:
            u = foreseen.get(str(place))
            found.append(item if u is None else _foresee(item, wanted.method, at, u))
    return found


def _is_at(item: dict[str, Any], f_number: float) -> bool:
    """Return whether an item is of this f-number, as it is written on the lens."""
    return "f_number" in item and math.isclose(item["f_number"], f_number, rel_tol=_SAME_F_NUMBER_REL)


def _foresee(item: dict[str, Any], method: str, f_number: float, u: float) -> dict[str, Any]:
    application = get_method(method).application
    assert isinstance(application, SurfaceApplication)  # noqa: S101  of no other is u foreseen
    flag = str(application.unforeseen)
    return item | {
        "f_number": f_number,
        "standard_uncertainty": u,
        "flags": [*item["flags"], flag],
        "why": f"{item['why']}; f/{f_number:g} was not calibrated: the value is that of the ISO "
        "value, and its uncertainty contains that of a nominal f-number",
    }


class ReadyAnswers(BaseRoute):
    """Answers from the ready rows in one query, which also checks the key; all else goes the usual way.

    The usual way is a route of the framework. It answers the same, and refuses what is to be refused; what
    the framework does for any route takes longer than the query.
    """

    def __init__(self, usual: APIRoute) -> None:
        self._usual = usual

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        if scope["type"] == "http" and scope["method"] == "GET" and "route" not in scope:
            found = self._usual.path_regex.match(scope["path"])
            if found:
                return Match.FULL, {"route": self._usual, "path_params": found.groupdict()}
        return Match.NONE, {}

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        app: ASGIApp = await _answer_ready(Request(scope)) or scope["router"].app
        await app(scope, receive, send)


async def _answer_ready(request: Request) -> Response | None:
    sent, camera_id = request.headers.get("authorization", ""), request.path_params["camera_id"]
    wanted = _read_query(request.scope["query_string"]) if sent.startswith(_BEARER) else None
    if wanted is None or not (camera_id.isascii() and camera_id.isprintable()):
        return None
    context: Context = request.app.state.context
    secret = sent.removeprefix(_BEARER)
    find = partial(
        context.lookups.find,
        secret,
        camera_id=camera_id,
        method=wanted.method,
        at=wanted.at,
        known_at=wanted.known_at,
    )
    named = request.headers.get("if-none-match", "*")
    found = await find(tags_only=True) if named.strip() != "*" else None
    answer = not_modified(request, *_tag(wanted, found.held)) if found else None
    if answer is None:
        found = await find(tags_only=False)
        answer = answer_held(request, wanted, found.held) if found else None
    if found is None or answer is None:
        return None
    context.attempts.trust(secret)
    context.rates.take(found.organisation_id)
    return answer


@lru_cache(maxsize=4096)
def _read_query(query: bytes) -> Wanted | None:
    """Read what is asked for; None for what the usual way refuses, or may read otherwise."""
    try:
        pairs = parse_qsl(query.decode("ascii"), keep_blank_values=True, errors="strict")
        asked = dict(pairs)
        if len(asked) < len(pairs) or not all(
            NUMBER.fullmatch(asked[name]) for name in ("iso", "f_number") if name in asked
        ):
            return None
        return Wanted.model_validate(asked)
    except (ValidationError, ValueError):
        return None
