"""Who asks: a key of one organisation, with its scopes."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

from fastapi import Depends
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from service.context import Context, get_context
from service.problems import HttpCode, Problem
from store.queries.keys import find_key

Scope = Literal["read", "upload", "calibrate", "publish", "admin"]
SCOPES: tuple[Scope, ...] = ("read", "upload", "calibrate", "publish", "admin")

_bearer = HTTPBearer(auto_error=False, scheme_name="key", description="A key of your organisation.")


@dataclass(frozen=True, kw_only=True)
class Caller:
    key_id: str
    organisation_id: str
    scopes: frozenset[str]
    operator: bool
    """The key's organisation runs this service."""


def get_caller(
    context: Annotated[Context, Depends(get_context)],
    credentials: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)],
) -> Caller:
    if credentials is None:
        raise _unauthenticated("Send a key: Authorization: Bearer <key>.")
    with context.database.reading() as session:
        found = find_key(session, credentials.credentials)
    if found is None:
        raise _unauthenticated("This key is not known, or it was revoked.")
    key, organisation = found
    return Caller(
        key_id=key.id,
        organisation_id=organisation.id,
        scopes=frozenset(key.scopes),
        operator=organisation.operator,
    )


def _require(scope: Scope) -> Callable[[Caller], Caller]:
    def check(caller: Annotated[Caller, Depends(get_caller)]) -> Caller:
        if scope not in caller.scopes:
            raise Problem(
                403, HttpCode.SCOPE_MISSING, f"This needs a key with the scope {scope!r}; yours lacks it."
            )
        return caller

    return check


def _unauthenticated(detail: str) -> Problem:
    return Problem(401, HttpCode.UNAUTHENTICATED, detail, headers={"WWW-Authenticate": "Bearer"})


Reader = Annotated[Caller, Depends(_require("read"))]
Uploader = Annotated[Caller, Depends(_require("upload"))]
Calibrator = Annotated[Caller, Depends(_require("calibrate"))]
Publisher = Annotated[Caller, Depends(_require("publish"))]
Admin = Annotated[Caller, Depends(_require("admin"))]
