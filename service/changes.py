"""One request that changes something: one transaction, one audit actor, and its idempotency key.

The commit happens here, before the answer exists: never in a dependency, which would run after it.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Header, Request
from fastapi.responses import JSONResponse
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.auth import Caller
from service.context import Context, get_context
from service.problems import Problem
from service.schemas.base import Answer, Text
from store.tables import IdempotentAnswer, Job
from store.usage import refuse_long_queue

_ATTEMPTS = 3


@dataclass(frozen=True, kw_only=True)
class Reply:
    """What a change answers, and the jobs it left for the workers."""

    status: int
    body: Answer
    headers: dict[str, str] = field(default_factory=dict)
    jobs: list[Job] = field(default_factory=list)


class Writing:
    """Runs a change once, however often its request is sent."""

    def __init__(self, context: Context, key: str | None, fingerprint: str) -> None:
        self._context = context
        self._key = key
        self._fingerprint = fingerprint

    def with_content(self, sha256: str) -> "Writing":
        """The same, for a request whose body was streamed and is known by its hash."""
        return Writing(self._context, self._key, f"{self._fingerprint}{sha256}")

    def run(self, caller: Caller, change: Callable[[Session], Reply]) -> JSONResponse:
        """Do it in a transaction; when another did the same at once, look again and find it done."""
        for attempt in range(_ATTEMPTS):
            try:
                return self._run(caller, change)
            except IntegrityError:
                if attempt == _ATTEMPTS - 1:
                    raise
        raise AssertionError("unreachable")

    def _run(self, caller: Caller, change: Callable[[Session], Reply]) -> JSONResponse:
        with self._context.database.writing(caller.key_id, caller.organisation_id) as session:
            earlier = self._earlier(session, caller)
            if earlier is not None:
                return JSONResponse(
                    earlier.body, earlier.status, {**earlier.headers, "Idempotent-Replayed": "true"}
                )
            reply = change(session)
            if reply.jobs:
                refuse_long_queue(session, caller.organisation_id, self._context.quotas)
            body = reply.body.dump()
            if self._key is not None:
                session.add(
                    IdempotentAnswer(
                        organisation_id=caller.organisation_id,
                        key=self._key,
                        fingerprint=self._digest(),
                        status=reply.status,
                        headers=reply.headers,
                        body=reply.body.keep(),
                    )
                )
        self._context.hints.send([job.id for job in reply.jobs])
        return JSONResponse(body, reply.status, reply.headers)

    def _earlier(self, session: Session, caller: Caller) -> IdempotentAnswer | None:
        if self._key is None:
            return None
        earlier = session.get(IdempotentAnswer, (caller.organisation_id, self._key))
        if earlier is not None and earlier.fingerprint != self._digest():
            raise Problem(
                interface.IDEMPOTENCY_KEY_REUSED,
                "This Idempotency-Key was used for another request. Use a new one for each new request.",
            )
        return earlier

    def _digest(self) -> str:
        return hashlib.sha256(self._fingerprint.encode()).hexdigest()


IdempotencyKey = Annotated[
    Text | None,
    Header(
        alias="Idempotency-Key", description="Send the same request again with the same key: it is done once."
    ),
]


def stream_writing(
    request: Request,
    context: Annotated[Context, Depends(get_context)],
    idempotency_key: IdempotencyKey = None,
) -> Writing:
    """For a request whose body the route streams itself."""
    return Writing(context, idempotency_key, f"{request.method} {request.url.path}?{request.url.query}\n")


async def body_writing(request: Request, writing: Annotated[Writing, Depends(stream_writing)]) -> Writing:
    """For a request with a small body, which takes part in the fingerprint."""
    return writing.with_content(hashlib.sha256(await request.body()).hexdigest())


Writes = Annotated[Writing, Depends(body_writing)]
StreamWrites = Annotated[Writing, Depends(stream_writing)]
