"""Liveness and readiness of the service."""

import shutil
from typing import Any, Literal

from fastapi import Depends, Request, Response
from fastapi.responses import PlainTextResponse
from fastapi.routing import APIRoute
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.http import answers, auth, models, operations, problems, processes
from service.http.context import UsesContext
from store.files import SCRUB_DAYS, count_damaged, find_proof_age_s
from store.queries.jobs import count_queue
from store.tables import Blob, PartRow

probes = operations.Router(tags=["system"], route_class=APIRoute)  # as probes ask, with whatever parameters
router = operations.Router(tags=["system"])


_ONLY_FOR_THE_OPERATOR: dict[int | str, dict[str, Any]] = answers.problems(401, 403, 503)
"""What may be answered where `STILB_HEALTH_FOR` is `operator`."""


class Life(models.Answer):
    status: Literal["ok"]


class PartAnswer(models.Answer):
    """A process of the service, by its own heartbeat."""

    kind: str = models.told("service or worker")
    state: Literal["working", "hung", "gone"]
    silent_s: float = models.told("How long ago its last heartbeat was.")
    idle_s: float = models.told("How long ago its work last went on.")
    details: dict[str, Any] = models.told("What it says of itself.")

    @classmethod
    def of(cls, part: PartRow) -> "PartAnswer":
        return cls.restate(part, silent_s=round(part.seen_s_ago, 1), idle_s=round(part.worked_s_ago, 1))


class Readiness(models.Answer):
    """Only the operator is told more than the status, where `STILB_HEALTH_FOR` says so."""

    status: Literal["ok", "degraded"]
    warnings: list[str] | None = models.maybe("What waits, and why. Requests are served all the same.")
    damaged_files: int | None = models.maybe("Damaged or missing ones; the same upload heals each.")
    parts: list[PartAnswer] | None = None


async def require_operator(request: Request, context: UsesContext) -> None:
    if context.settings.health_for == "operator":
        await auth.identify(request)
        caller: auth.Caller = request.state.caller
        if not caller.operator:
            raise problems.Problem(interface.SCOPE_MISSING, "Only the operator can see this.")


@probes.get("/livez", response_model=Life)
async def get_livez() -> Response:
    """The process answers: without a thread or the database, for which others may wait."""
    return Life(status="ok").respond()


@probes.get("/readyz", response_model=Readiness, responses=_ONLY_FOR_THE_OPERATOR)
async def get_readyz(request: Request, context: UsesContext) -> Response:
    """Requests can be served: database and file store answer, the schema is ours, and no stop was requested.

    Answers within two seconds. `degraded`, and 200, without a worker: what is sent is kept, and waits.
    """
    if context.traffic.stopping:
        raise processes.stopping()
    is_told = context.settings.health_for == "everybody" or "authorization" in request.headers
    if is_told:
        await require_operator(request, context)
    report = await context.health.look()
    if (unfit := report.unfit) is not None and unfit.code is not None:
        found = {finding.name: finding.detail or "ok" for finding in report.findings}
        detail = f"Not ready ({unfit.name}): {unfit.detail}"
        extra: dict[str, Any] = {"checks": found} if is_told else {}
        raise problems.Problem(unfit.code, detail, headers={"Retry-After": "2"}, **extra)
    status: Literal["ok", "degraded"] = "degraded" if report.warnings else "ok"
    if not is_told:
        return Readiness(status=status).respond()
    parts = [PartAnswer.of(part) for part in report.parts]
    return Readiness(
        status=status, warnings=report.warnings, damaged_files=report.damaged_files, parts=parts
    ).respond()


class OperatorHealth(models.Answer):
    """State of the whole service, over all organisations."""

    parts: list[PartAnswer]
    jobs_waiting: int
    jobs_running: int
    oldest_wait_s: float = models.told("How long the job that waits longest has been due.", ge=0)
    disk_total_bytes: int = models.told("Of the disk that holds the data folder, without what is reserved.")
    disk_free_bytes: int
    files: int = models.told("Stored files.")
    damaged_files: int
    oldest_proof_s: float = models.told("How long ago the file was verified that waits longest.", ge=0)
    verified_within_s: float = models.told("Every file is verified in this time; 0: never.")


@router.get("/v1/health", response_model=OperatorHealth)
def get_operator_health(caller: auth.Admin, context: UsesContext, session: Session) -> Response:
    """Workers, queue, disk and verified files of the whole service. Only the operator's admins may ask."""
    if not caller.operator:
        raise problems.Problem(interface.SCOPE_MISSING, "Only an administrator of the operator can see this.")
    disk = shutil.disk_usage(context.settings.data)
    queue = count_queue(session)
    return OperatorHealth(
        parts=[PartAnswer.of(part) for part in queue.parts],
        jobs_waiting=queue.jobs["queued"],
        jobs_running=queue.jobs["running"],
        oldest_wait_s=queue.oldest_queued_s,
        disk_total_bytes=disk.used + disk.free,
        disk_free_bytes=disk.free,
        files=session.scalar(select(func.count()).select_from(Blob)) or 0,
        damaged_files=sum(count_damaged(session).values()),
        oldest_proof_s=find_proof_age_s(session),
        verified_within_s=SCRUB_DAYS * 86400,
    ).respond()


@probes.get(
    "/metrics",
    dependencies=[Depends(require_operator)],
    response_class=PlainTextResponse,
    responses={
        **_ONLY_FOR_THE_OPERATOR,
        200: {"content": {"text/plain": {"example": "stilb_oldest_queued_job_age_seconds 0\n"}}},
    },
)
def get_metrics(context: UsesContext) -> PlainTextResponse:
    """Jobs, frames and versions, counted for Prometheus, durations, the version and the room on the disk.

    What is under way is counted each time, all rows of a table at most once a minute.
    """
    with context.database.reading() as session:
        text = context.traffic.metrics.render(session, data=context.settings.data)
    return PlainTextResponse(text, media_type="text/plain; version=0.0.4")
