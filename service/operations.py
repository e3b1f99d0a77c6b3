"""Operations: who asks is known before anything of what is asked is read."""

import json
from collections import Counter
from collections.abc import Callable, Coroutine
from typing import Any, Final

from fastapi import APIRouter, Request, Response
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute

from radiometry.findings import interface
from service.auth import get_caller, identify
from service.problems import UNREADABLE, Problem, RefusedBody, invalid

_MOST_NAMES: Final = 1000
"""Of one object."""
_MOST_PARTS: Final = 200_000
"""Names, objects and lists of a whole document: more are no document but a load."""


class Router(APIRouter):
    """The operations of one resource."""

    def __init__(self, *, prefix: str = "", tags: list[Any] | None = None, **options: Any) -> None:  # noqa: ANN401
        super().__init__(prefix=prefix, tags=tags, route_class=_Operation, **options)


class _Operation(APIRoute):
    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handle = super().get_route_handler()
        needs_caller = is_called(get_caller, self.dependant)

        async def operate(request: Request) -> Response:
            if needs_caller:
                await identify(request)
            if request.headers.get("content-encoding", "identity").strip().lower() != "identity":
                raise _encoded()
            return await handle(_StrictRequest(request.scope, request.receive))

        return operate


def is_called(wanted: Callable[..., Any], dependant: Dependant) -> bool:
    """Return whether one of the dependencies is the wanted one."""
    return any(each.call is wanted or is_called(wanted, each) for each in dependant.dependencies)


class _StrictRequest(Request):
    async def json(self) -> Any:  # noqa: ANN401  whatever was sent
        """Read the document, once; what readers may take differently is refused."""
        if not hasattr(self, "_json"):
            self._json = _read(await self.body())
        return self._json


def _read(body: bytes) -> Any:  # noqa: ANN401
    if body.count(b"{") + body.count(b"[") + body.count(b":") > _MOST_PARTS:
        raise _wrong(f"has more than {_MOST_PARTS} names, objects and lists; send it in parts")
    try:
        return json.loads(body, object_pairs_hook=_collect)
    except json.JSONDecodeError as error:
        detail = f"The body is not JSON: {error.msg} at character {error.pos}."
        raise RefusedBody(Problem(interface.BAD_REQUEST, detail)) from error
    except (ValueError, RecursionError) as error:
        raise RefusedBody(Problem(interface.BAD_REQUEST, UNREADABLE)) from error


def _collect(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Readers differ in which of two they take, so that what one has checked another does not see."""
    if len(pairs) > _MOST_NAMES:
        raise _wrong(f"has an object with more than {_MOST_NAMES} names")
    members = dict(pairs)
    if len(members) < len(pairs):
        counts = Counter(name for name, _ in pairs)
        twice = next(name for name, count in counts.items() if count > 1)
        raise _wrong(f"names {json.dumps(twice)[:200]} twice in one object; send it once")
    return members


def _wrong(message: str) -> RefusedBody:
    return RefusedBody(invalid([{"type": "value", "loc": ("body",), "msg": message}]))


def _encoded() -> Problem:
    detail = "The body is compressed. Send it as it is, without Content-Encoding."
    return Problem(interface.CONTENT_ENCODED, detail, headers={"Accept-Encoding": "identity"})
