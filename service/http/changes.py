"""The session of a request; of one that changes something one transaction, actor and idempotency key.

The commit happens here, before the answer exists: never in a dependency, which would run after it.
"""

import hashlib
import inspect
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import field
from functools import wraps
from typing import Annotated, Any, TypeVar

from fastapi import Depends, Header, Request, Response
from fastapi.responses import JSONResponse
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool

from radiometry.findings import interface
from radiometry.records import Record
from service.http import auth, lookup, models, problems
from service.http.context import Context, UsesContext
from store import log_fields, tables
from store.queries.usage import charge

_ATTEMPTS = 3
_BY_NAME = inspect.Parameter.KEYWORD_ONLY
REPLAYED = "Idempotent-Replayed"

Item = TypeVar("Item")


class Reply(Record):
    """Answer of a change, and the jobs that it left for the workers."""

    status: int
    body: models.Answer
    headers: dict[str, str] = field(default_factory=dict)
    jobs: list[tables.Job] = field(default_factory=list)
    frame_bytes: Sequence[int] = ()  # size of each frame that was added, which counts for the quotas
    had_room: bool = False  # whether they were counted when their uploads began


class Writing:
    """Runs a change once, however often its request is sent."""

    def __init__(self, context: Context, key: str | None, fingerprint: str) -> None:
        self.context = context
        self._key = key
        self._fingerprint = fingerprint
        self._fields = log_fields.present_fields()

    def with_content(self, sha256: str) -> "Writing":
        """The same, for a request whose body was streamed and is known by its hash."""
        return Writing(self.context, self._key, f"{self._fingerprint}{sha256}")

    def run(self, caller: auth.Caller, change: Callable[[Session], Reply]) -> JSONResponse:
        return run_all(caller, [(self, None)], lambda session, _: [change(session)])[0]

    def replay(self, caller: auth.Caller) -> JSONResponse | None:
        """Return the answer that this request had before, for one that has to prepare what it changes."""
        with self.context.database.reading() as session:
            earlier = self._earlier(session, caller)
        return None if earlier is None else _replay(earlier)

    def _keep(self, session: Session, caller: auth.Caller, reply: Reply) -> None:
        if self._key is not None:
            session.add(
                tables.IdempotentAnswer(
                    organisation_id=caller.organisation_id,
                    key=self._key,
                    fingerprint=self._digest(),
                    status=reply.status,
                    headers=reply.headers,
                    body=reply.body.keep(),
                )
            )

    def _earlier(self, session: Session, caller: auth.Caller) -> tables.IdempotentAnswer | None:
        if self._key is None:
            return None
        earlier = session.get(tables.IdempotentAnswer, (caller.organisation_id, self._key))
        if earlier is not None and earlier.fingerprint != self._digest():
            detail = "This Idempotency-Key was used for another request. Use a new one for each new request."
            raise problems.Problem(interface.IDEMPOTENCY_KEY_REUSED, detail)
        return earlier

    def _digest(self) -> str:
        return hashlib.sha256(self._fingerprint.encode()).hexdigest()


def run_all(
    caller: auth.Caller,
    requests: Sequence[tuple[Writing, Item]],
    change: Callable[[Session, Sequence[Item]], Sequence[Reply]],
) -> list[JSONResponse]:
    """Do what several requests of one caller ask in one transaction, each once, whoever does it too."""
    for _ in range(_ATTEMPTS - 1):
        with suppress(IntegrityError):
            return _run_all(caller, requests, change)
    return _run_all(caller, requests, change)


def _run_all(
    caller: auth.Caller,
    requests: Sequence[tuple[Writing, Item]],
    change: Callable[[Session, Sequence[Item]], Sequence[Reply]],
) -> list[JSONResponse]:
    context = requests[0][0].context
    with context.database.writing(caller.key_id, caller.organisation_id) as session:
        done = [writing._earlier(session, caller) for writing, _ in requests]  # noqa: SLF001  of this module
        new = [request for request, earlier in zip(requests, done, strict=True) if earlier is None]
        replies = list(change(session, [item for _, item in new])) if new else []
        for (writing, _), reply in zip(new, replies, strict=True):
            writing._keep(session, caller, reply)  # noqa: SLF001  of this module
        jobs = [job.id for reply in replies for job in reply.jobs]
        sizes = [size for reply in replies for size in reply.frame_bytes]
        if jobs or sizes:
            charge(
                session,
                caller.organisation_id,
                context.settings,
                sizes_bytes=sizes,
                had_room=all(reply.had_room for reply in replies if reply.frame_bytes),
                jobs=len(jobs),
            )
        answers = iter([JSONResponse(reply.body.dump(), reply.status, reply.headers) for reply in replies])
        # made before the commit: an answer that cannot be made changes nothing
        found = [next(answers) if earlier is None else _replay(earlier) for earlier in done]
    for (writing, _), reply in zip(new, replies, strict=True):
        if reply.jobs:
            writing._fields["jobs"] = [job.id for job in reply.jobs]
    return found


def _replay(earlier: tables.IdempotentAnswer) -> JSONResponse:
    return JSONResponse(earlier.body, earlier.status, {**earlier.headers, REPLAYED: "true"})


IdempotencyKey = Annotated[
    models.Text | None,
    Header(
        alias="Idempotency-Key", description="Send the same request again with the same key: it is done once."
    ),
]


async def stream_writing(
    request: Request, context: UsesContext, idempotency_key: IdempotencyKey = None
) -> Writing:
    return Writing(context, idempotency_key, f"{request.method} {request.url.path}?{request.url.query}\n")


async def body_writing(request: Request, writing: Annotated[Writing, Depends(stream_writing)]) -> Writing:
    """For a request with a small body, which takes part in the fingerprint."""
    return writing.with_content(hashlib.sha256(await request.body()).hexdigest())


Writes = Annotated[Writing, Depends(body_writing)]
StreamWrites = Annotated[Writing, Depends(stream_writing)]


def with_session(endpoint: Callable[..., Any]) -> Callable[..., Any]:
    """Hand a route its `session` and rows (`lookup.Own`): those of its change, where it returns a `Reply`."""
    stated = inspect.signature(endpoint)
    kinds = {name: each.annotation for name, each in stated.parameters.items()}
    own = {name: kind for name, kind in kinds.items() if lookup.is_own(kind)}
    if not own and "session" not in stated.parameters:
        return endpoint
    changes = stated.return_annotation is Reply
    if inspect.iscoroutinefunction(endpoint) and (changes or "session" in kinds):
        raise TypeError(f"{endpoint.__name__} takes rows alone: a session ends before it goes on")

    def take(session: Session, asked: dict[str, Any]) -> dict[str, Any]:
        rows = {
            name: lookup.find_own(session, kind, asked[f"{name}_id"], _find_caller(asked))
            for name, kind in own.items()
        }
        held = {"session": session} | asked | rows
        return {name: each for name, each in held.items() if name in stated.parameters}

    def read(given: Context, asked: dict[str, Any]) -> Any:  # noqa: ANN401  what the route takes, or its answer
        with given.database.reading() as session:
            taken = take(session, asked)
            return endpoint(**taken) if "session" in taken else taken

    @wraps(endpoint)
    def route(given: Any, **asked: Any) -> Response:  # noqa: ANN401  as the route asks for it
        if changes:
            return given.run(_find_caller(asked), lambda session: endpoint(**take(session, asked)))  # type: ignore[no-any-return]
        found = read(given, asked)
        return endpoint(**found) if isinstance(found, dict) else found  # type: ignore[no-any-return]

    @wraps(endpoint)
    async def route_in_loop(given: Any, **asked: Any) -> Response:  # noqa: ANN401
        return await endpoint(**await run_in_threadpool(read, given, asked))  # type: ignore[no-any-return]

    chosen: Any = route_in_loop if inspect.iscoroutinefunction(endpoint) else route
    chosen.__signature__ = _restate(stated, own.keys(), Writes if changes else UsesContext)
    return chosen  # type: ignore[no-any-return]


def _find_caller(asked: dict[str, Any]) -> auth.Caller:
    """Return who asks, as a route states it: for itself, for its rows alone, or with its page."""
    found = [each for each in asked.values() if isinstance(each, auth.Caller)]
    return found[0] if found else asked["page"].caller


def _restate(stated: inspect.Signature, own: Collection[str], given: Any) -> inspect.Signature:  # noqa: ANN401  a type
    """Return what the framework is to ask for: ids in place of rows, and what the session is taken from."""
    asked = [
        each.replace(name=f"{name}_id", annotation=lookup.Id) if name in own else each
        for name, each in stated.parameters.items()
        if name != "session"
    ]
    if own and not stated.parameters.keys() & {"caller", "_caller", "page"}:
        asked.append(inspect.Parameter("caller", _BY_NAME, annotation=auth.Reader))
    asked.append(inspect.Parameter("given", _BY_NAME, annotation=given))
    return stated.replace(
        parameters=[each.replace(kind=_BY_NAME) for each in asked], return_annotation=Response
    )
