"""Checks that FastAPI lacks: parameters that a route does not know, and loose numbers."""

import re
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


async def check_request(request: Request) -> None:
    """Refuse what is not said clearly, before the route reads it its own way."""
    route: APIRoute = request.scope["route"]
    if not request.app.state.addresses.is_of(route.path, request.scope["path"]):
        # an address with a name of its own is no id of this route
        raise HTTPException(405)
    _refuse_conditions(request)
    types = _find_types(request, route)
    wrong = [
        {"type": kind, "loc": ("query", name)}
        for name, text in request.query_params.multi_items()
        if (kind := _find_fault(types.get(name), text)) is not None
    ]
    if wrong:
        raise invalid([{**each, "msg": ""} for each in wrong])


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


def _find_types(request: Request, route: APIRoute) -> dict[str, str]:
    """Describe one route when it is first asked: the whole document takes seconds of a busy processor."""
    known: dict[str, dict[str, str]] = request.app.state.operations
    if route.name not in known:
        ((operation,),) = (path.values() for path in _build_paths(route).values())
        known[route.name] = {
            each["name"]: _find_type(each["schema"]) for each in operation.get("parameters", ())
        }
    return known[route.name]


def _build_paths(route: APIRoute) -> dict[str, dict[str, Any]]:
    paths: dict[str, dict[str, Any]] = get_openapi(title="", version="", routes=[route])["paths"]
    return paths


def _find_type(schema: dict[str, Any]) -> str:
    """Return the type of a parameter, which may be left out, but is never null."""
    kinds = [each.get("type", "") for each in schema.get("anyOf", [schema]) if each.get("type") != "null"]
    return kinds[0] if len(kinds) == 1 else ""
