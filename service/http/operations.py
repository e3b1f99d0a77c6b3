"""Operations: who asks, what they may and whether it is said clearly is known before a body is read."""

import json
import re
from collections import Counter
from collections.abc import Callable, Coroutine, Iterator
from functools import partial
from typing import Any, Final, TypeVar

from anyio.to_thread import run_sync
from fastapi import APIRouter, Request, Response
from fastapi.dependencies.models import Dependant
from fastapi.openapi.utils import get_openapi
from fastapi.routing import APIRoute
from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.types import Receive, Scope

from radiometry.findings import interface
from service.http import answers, auth, changes, problems
from service.http.context import Context

T = TypeVar("T")

CHANGING: Final = frozenset({"POST", "PUT", "PATCH", "DELETE"})
NUMBER: Final = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
"""A number as people write it: Python also reads 1_000, and digits of any script."""
_WHOLE: Final = re.compile(r"[+-]?\d+", re.ASCII)
_MOST_NAMES: Final = 1000  # of one object
_MOST_PARTS: Final = 400_000
"""Names, values, objects and lists of a document, or cells and lines of a table: more are a load."""
_MOST_DIGITS: Final = 400  # of a whole number; the time to read one grows with their square
_AT_ONCE_BYTES: Final = 1 << 14  # a longer body is read in a thread


class Router(APIRouter):
    """The operations of one resource, each known by the name of its function."""

    def __init__(self, *, prefix: str = "", tags: list[Any] | None = None, **options: Any) -> None:  # noqa: ANN401
        usual = {"route_class": Operation, "generate_unique_id_function": lambda route: route.name}
        super().__init__(prefix=prefix, tags=tags, **{**usual, **options})


class Operation(APIRoute):
    """A route of ours, which may ask for a `session`."""

    def __init__(self, path: str, endpoint: Callable[..., Any], **options: Any) -> None:  # noqa: ANN401
        super().__init__(path, changes.with_session(endpoint), **options)
        if auth.get_caller in list_calls(self.dependant):
            self.responses = answers.with_usual_problems(self.responses, of_one="{" in self.path)

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handle = super().get_route_handler()
        called = list(list_calls(self.dependant))
        needs = [each for each in called if isinstance(each, auth.Needs)]
        form: Any = self.body_field and self.body_field.field_info.annotation

        async def operate(request: Request) -> Response:
            if auth.get_caller in called:
                await auth.identify(request)
            if self.include_in_schema:
                _check(request)
            for each in needs:
                auth.require(request.state.caller, *each.scopes)
            if request.headers.get("content-encoding", "identity").strip().lower() != "identity":
                detail = "The body is compressed. Send it as it is, without Content-Encoding."
                raise problems.Problem(
                    interface.CONTENT_ENCODED, detail, headers={"Accept-Encoding": "identity"}
                )
            return await handle(_StrictRequest(request.scope, request.receive, form))

        return operate


def list_calls(dependant: Dependant) -> Iterator[Callable[..., Any] | None]:
    for each in dependant.dependencies:
        yield each.call
        yield from list_calls(each)


class _StrictRequest(Request):
    def __init__(self, scope: Scope, receive: Receive, form: Any) -> None:  # noqa: ANN401  a model, if any
        super().__init__(scope, receive)
        self._model = form

    async def json(self) -> Any:  # noqa: ANN401  the form of the route, which the framework takes as it is
        """Read the document into its form, once, and beside the loop where it is large."""
        if not hasattr(self, "_json"):
            read = partial(read_document, validate=self._model.model_validate)
            self._json = await read_apart(self, read)
        return self._json


async def read_apart(request: Request, read: Callable[[bytes], T]) -> T:
    """Read the body; a large one in a thread, one at a time, while the loop answers others."""
    body = await request.body()
    if len(body) <= _AT_ONCE_BYTES:
        return read(body)
    context: Context = request.app.state.context
    return await run_sync(read, body, limiter=context.readers)


def read_document(body: bytes, validate: Callable[[Any], T], *, advice: str = "") -> T:
    """Read a document in JSON; what readers may take differently is refused."""
    refuse_load(body, *",:{[")
    try:
        return validate(
            json.loads(body, object_pairs_hook=_collect, parse_int=_read_whole, parse_float=_read_real)
        )
    except ValidationError as error:
        raise problems.invalid(problems.located(error, "body")) from error
    except json.JSONDecodeError as error:
        detail = f"The body is not JSON: {error.msg} at character {error.pos}.{advice}"
        raise problems.Problem(interface.BAD_REQUEST, detail) from error
    except (ValueError, RecursionError) as error:
        raise problems.Problem(interface.BAD_REQUEST, problems.UNREADABLE) from error


def refuse_load(body: bytes, *marks: str) -> None:
    """Refuse a body of more parts than a document has, by the marks between them."""
    if sum(body.count(mark.encode()) for mark in marks) > _MOST_PARTS:
        raise problems.wrong(
            "body", f"has more than {_MOST_PARTS} names, values, cells, lines and lists; send it in parts"
        )


def _collect(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Readers differ in which of two they take, so that what one has checked another does not see."""
    if len(pairs) > _MOST_NAMES:
        raise problems.wrong("body", f"has an object with more than {_MOST_NAMES} names")
    members = dict(pairs)
    if len(members) < len(pairs):
        counts = Counter(name for name, _ in pairs)
        twice = next(name for name, count in counts.items() if count > 1)
        raise problems.wrong("body", f"names {json.dumps(twice)[:200]} twice in one object; send it once")
    return members


def _read_whole(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError("too many digits")
    return int(text)


def _read_real(text: str) -> float:
    # in Python: between two of them the reader's thread gives way to the loop
    return float(text)


def _check(request: Request) -> None:
    """Refuse what is not said clearly, before the route reads it its own way."""
    route: APIRoute = request.scope["route"]
    if not request.app.state.addresses.is_of(route, request.scope["path"]):
        # an address with a name of its own is no id of this route
        raise HTTPException(405)
    _refuse_conditions(request)
    types = _find_types(request, route)
    wrong = [
        {"type": kind, "loc": ("query", name), "msg": ""}
        for name, text in request.query_params.multi_items()
        if (kind := _find_fault(types.get(name), text)) is not None
    ]
    for name, count in Counter(name for name, _ in request.query_params.multi_items()).items():
        if count > 1 and types.get(name) != "array":
            wrong.append({"type": "value", "loc": ("query", name), "msg": "is stated twice; state it once"})
    if wrong:
        raise problems.invalid(wrong)


def _refuse_conditions(request: Request) -> None:
    """Refuse to change something on a condition: no address that takes a change has an entity tag."""
    if request.method in CHANGING:
        wanted = request.headers.getlist("if-match")
        if (wanted and "".join(wanted).strip() != "*") or "*" in request.headers.getlist("if-none-match"):
            detail = "This address has no entity tag. Send the request without If-Match and If-None-Match."
            raise problems.Problem(interface.PRECONDITION_FAILED, detail)


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
        paths: dict[str, dict[str, Any]] = get_openapi(title="", version="", routes=[route])["paths"]
        ((operation,),) = (path.values() for path in paths.values())
        known[route.name] = {
            each["name"]: _find_type(each["schema"]) for each in operation.get("parameters", ())
        }
    return known[route.name]


def _find_type(schema: dict[str, Any]) -> str:
    """Return the type of a parameter, which may be left out, but is never null."""
    kinds = [each.get("type", "") for each in schema.get("anyOf", [schema]) if each.get("type") != "null"]
    return kinds[0] if len(kinds) == 1 else ""
