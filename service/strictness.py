"""Checks that FastAPI lacks: parameters that a route does not know, loose numbers, members given twice."""

import json
import re
from collections import Counter
from dataclasses import dataclass
from typing import Any, Final

from fastapi import Request
from fastapi.openapi.utils import get_openapi
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException

from radiometry.findings import interface
from service.problems import Problem, invalid

NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
"""A number as people write it: Python also reads 1_000, and digits of any script."""
CHANGING: Final = frozenset({"POST", "PUT", "PATCH", "DELETE"})
_WHOLE: Final = re.compile(r"[+-]?\d+", re.ASCII)


@dataclass(frozen=True, kw_only=True)
class _Operation:
    """Types that the document states of a request: each parameter in the address, and the body."""

    types: dict[str, str]
    takes_json: bool


async def check_request(request: Request) -> None:
    """Refuse what is not said clearly, before the route reads it its own way."""
    route: APIRoute = request.scope["route"]
    if not request.app.state.addresses.is_of(route.path, request.scope["path"]):
        # an address with a name of its own is no id of this route
        raise HTTPException(405)
    _refuse_conditions(request)
    operation = _describe(request, route)
    wrong = [
        {"type": kind, "loc": ("query", name)}
        for name, text in request.query_params.multi_items()
        if (kind := _find_fault(operation.types.get(name), text)) is not None
    ]
    if wrong:
        raise invalid([{**each, "msg": ""} for each in wrong])
    kind = request.headers.get("content-type", "").lower()
    if operation.takes_json and not kind.startswith("text/"):
        _refuse_repeated_members(await request.body())


def _refuse_conditions(request: Request) -> None:
    """Refuse to change something on a condition: no address that takes a change has an entity tag."""
    if request.method in CHANGING:
        wanted = request.headers.getlist("if-match")
        if (wanted and "".join(wanted).strip() != "*") or "*" in request.headers.getlist("if-none-match"):
            detail = "This address has no entity tag. Send the request without If-Match and If-None-Match."
            raise Problem(interface.PRECONDITION_FAILED, detail)


def _find_fault(kind: str | None, text: str) -> str | None:
    """Compare a parameter with its type: a filter that is misspelt must not answer with everything."""
    if kind is None:
        return "extra_forbidden"
    if kind == "number" and not NUMBER.fullmatch(text):
        return "float_parsing"
    if kind == "integer" and not _WHOLE.fullmatch(text):
        return "int_parsing"
    return None


def _describe(request: Request, route: APIRoute) -> _Operation:
    """Describe one route when it is first asked: the whole document takes seconds of a busy processor."""
    known: dict[str, _Operation] = request.app.state.operations
    if route.name not in known:
        ((operation,),) = (path.values() for path in _build_paths(route).values())
        known[route.name] = _Operation(
            types={each["name"]: _find_type(each["schema"]) for each in operation.get("parameters", ())},
            takes_json="application/json" in operation.get("requestBody", {}).get("content", {}),
        )
    return known[route.name]


def _build_paths(route: APIRoute) -> dict[str, dict[str, Any]]:
    paths: dict[str, dict[str, Any]] = get_openapi(title="", version="", routes=[route])["paths"]
    return paths


def _find_type(schema: dict[str, Any]) -> str:
    """Return the type of a parameter, which may be left out, but is never null."""
    kinds = [each.get("type", "") for each in schema.get("anyOf", [schema]) if each.get("type") != "null"]
    return kinds[0] if len(kinds) == 1 else ""


class _Twice(Exception):  # noqa: N818  it is what was found
    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.name = name


def _refuse_repeated_members(body: bytes) -> None:
    """Readers differ in which of two they take, so that what one has checked another does not see."""
    try:
        json.loads(body, object_pairs_hook=_collect)
    except _Twice as twice:
        message = f"names {json.dumps(twice.name)[:200]} twice in one object; send it once"
        raise invalid([{"type": "twice", "loc": ("body",), "msg": message}]) from None
    except (ValueError, RecursionError):
        return  # whoever reads it says what is wrong


def _collect(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) < len(pairs):
        counts = Counter(name for name, _ in pairs)
        raise _Twice(next(name for name, count in counts.items() if count > 1))
    return members
