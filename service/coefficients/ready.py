"""Ready answers: a look-up reads stored bytes, chooses from them where it must, and computes nothing."""

import hashlib
import json
import math
from collections.abc import Callable, Coroutine, Sequence
from functools import lru_cache
from typing import Any
from urllib.parse import parse_qsl

from fastapi import Request, Response
from pydantic import ValidationError
from pydantic_core import from_json, to_json

from radiometry.methods import get_method
from radiometry.specification.application import SurfaceApplication
from service.http import answers, counts, lookup, models, operations
from service.http.context import Context
from store.queries.organisations import hash_secret
from store.ready import lookups, rows
from store.tables.base import utc_now

_SAME_F_NUMBER_REL = 1e-3
_BEARER = "Bearer "


class Wanted(models.Form):
    """Which coefficients, and as of when."""

    method: models.Method
    name: models.Text | None = None
    iso: models.PositiveText | None = None
    f_number: models.PositiveText | None = None
    band: models.BandName | None = None
    at: models.Instant | None = None
    known_at: models.Instant | None = None

    @property
    def chosen(self) -> dict[str, Any]:
        """The members that choose from the coefficients of a version."""
        names = ("name", "iso", "band", "f_number")
        return {name: value for name in names if (value := getattr(self, name)) is not None}


def answer_held(request: Request, wanted: Wanted, held: Sequence[lookups.Held]) -> Response | None:
    """Answer with the coefficients that were asked for, or 304; None where no version has such a one."""
    chosen = wanted.chosen
    if not chosen and all(each.whole for each in held):
        content = b",".join(inner for each in held if (inner := each.items[1:-1]))
        body = b'{"items":[%b]}' % content if content else b""
    else:
        items = [item for each in held for item in _choose(wanted, chosen, each)]
        body = to_json({"items": items}) if items else b""
    if not body:
        return None
    tag = _hash(tuple(each.etag for each in held), tuple(chosen.items()))
    headers = answers.standing_headers(tag)
    return answers.not_modified(request, tag, headers) or Response(body, 200, headers, "application/json")


@lru_cache(maxsize=4096)
def _hash(etags: tuple[str, ...], chosen: tuple[tuple[str, Any], ...]) -> str:
    return hashlib.sha256(json.dumps([etags, dict(chosen)]).encode()).hexdigest()[:32]


def _choose(wanted: Wanted, chosen: dict[str, Any], held: lookups.Held) -> list[dict[str, Any]]:
    """Return the items with what was asked for.

    What is known both in general and at f-numbers is answered at the f-number asked for if it is known
    there, else in general.
    """
    stored: list[dict[str, Any]] = from_json(held.items)
    asked = {name: value for name, value in chosen.items() if name != "f_number"}
    items = [
        (place, item)
        for place, item in enumerate(stored)
        if all(item.get(name) == value for name, value in asked.items())
    ]
    at = wanted.f_number
    if at is None:
        general = {rows.key_of(item) for _, item in items if "f_number" not in item}
        return [item for _, item in items if "f_number" not in item or rows.key_of(item) not in general]
    there = {rows.key_of(item) for _, item in items if _is_at(item, at)}
    foreseen = json.loads(held.foreseen or "{}")
    found = []
    for place, item in items:
        if _is_at(item, at):
            found.append(item)
        elif "f_number" not in item and rows.key_of(item) not in there:
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


class AnswersReady(operations.Operation):
    """A look-up in one query, which also checks the key; what that does not answer goes the usual way.

    The usual way answers the same, and refuses what is to be refused; what the framework does for any route
    takes longer than the query.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        go_the_usual_way = super().get_route_handler()

        async def look_up(request: Request) -> Response:
            return await _answer_ready(request) or await go_the_usual_way(request)

        return look_up


async def _answer_ready(request: Request) -> Response | None:
    sent, camera_id = request.headers.get("authorization", ""), request.path_params["camera_id"]
    wanted = _read_query(request.scope["query_string"]) if sent.startswith(_BEARER) else None
    if wanted is None or not lookup.is_id(camera_id):
        return None
    context: Context = request.app.state.context
    secret, now = sent.removeprefix(_BEARER), utc_now()
    held = await lookups.find_ready(
        context.database,
        camera_id=camera_id,
        method=wanted.method,
        at=wanted.at or now,
        known_at=wanted.known_at,
        sha256=hash_secret(secret),
        now=now,
        used_after=now - counts.STEP,
    )
    answer = answer_held(request, wanted, held)
    if answer is not None:
        context.attempts.trust(secret)
        context.rates.take(held[0].organisation_id)
    return answer


@lru_cache(maxsize=4096)
def _read_query(query: bytes) -> Wanted | None:
    """Read what is asked for; None for what the usual way refuses, or may read otherwise."""
    try:
        pairs = parse_qsl(query.decode("ascii"), keep_blank_values=True, errors="strict")
        asked = dict(pairs)
        if len(asked) < len(pairs) or not all(
            operations.NUMBER.fullmatch(asked[name]) for name in ("iso", "f_number") if name in asked
        ):
            return None
        return Wanted.model_validate(asked)
    except (ValidationError, ValueError):
        return None
