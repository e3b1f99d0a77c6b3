"""What the service computes for you."""

from typing import Annotated

import typer

from stilb.client import Client
from stilb.commands.exits import Exit
from stilb.commands.output import Output, command
from stilb.commands.tables import table
from stilb.records import Job

_SHOWN = 20


@command
def jobs(
    output: Output,
    job: Annotated[str | None, typer.Argument(metavar="[JOB]", help="One job; else the newest.")] = None,
    state: Annotated[
        str | None, typer.Option(help="queued, running, succeeded, failed, quarantined.")
    ] = None,
    kind: Annotated[str | None, typer.Option(help="extract, fit, measure.")] = None,
    limit: Annotated[int, typer.Option(min=1, help="How many at most.")] = _SHOWN,
    *,
    wait: Annotated[bool, typer.Option("--wait", help="Wait until the job has ended.")] = False,
) -> None:
    """Show the newest jobs, or one, and what became of it."""
    with output.client() as client:
        if job is not None:
            _one(output, client.wait(job) if wait else client.job(job))
            return
        found = [each for each, _ in zip(client.jobs(state=state, kind=kind), range(limit), strict=False)]
        about = _about(client, found)
    rows = [
        (each.kind, about[each.id], each.state, f"{each.progress:.0%}", each.id, _error(each))
        for each in found
    ]
    output.answer(
        {"items": [each.raw for each in found]},
        table(("kind", "of", "state", "done", "job", "error"), rows),
    )


@command
def retry(
    output: Output,
    job: Annotated[str | None, typer.Argument(metavar="[JOB]", help="One job; else all that fit.")] = None,
    state: Annotated[str | None, typer.Option(help="failed, quarantined.")] = None,
    kind: Annotated[str | None, typer.Option(help="extract, fit, measure.")] = None,
    code: Annotated[str | None, typer.Option(help="The error's code: temporarily_unavailable.")] = None,
    campaign: Annotated[str | None, typer.Option(help="Its id or project number.")] = None,
) -> None:
    """Try a job again that failed, or all in a state (--state) that fit the other options."""
    if (job is None) == (state is None):
        raise typer.BadParameter("name one job, or choose many with --state", param_hint="JOB")
    with output.client() as client:
        if job is not None:
            found = client.retry_job(job)
            output.answer(found.raw, f"{found.id} {found.kind} {found.state}")
            return
        campaign_id = client.find_campaign(campaign).id if campaign is not None else None
        count = client.retry_jobs(str(state), kind=kind, code=code, campaign_id=campaign_id)
    output.answer({"retried": count}, f"{count} jobs are tried again")


def _about(client: Client, found: list[Job]) -> dict[str, str]:
    """Of each job its file, else its campaign by project number."""
    named: dict[str, str | None] = {}
    if any("filename" not in each.raw for each in found):
        named = {each.id: each.project_number for each in client.campaigns()}
    return {
        each.id: each.raw.get("filename") or named.get(each.raw.get("campaign_id", "")) or ""
        for each in found
    }


def _one(output: Output, found: Job) -> None:
    result = ", ".join(f"{name} {value}" for name, value in (found.result or {}).items())
    output.answer(
        found.raw, f"{found.id} {found.kind} {found.state} {found.progress:.0%} {result}{_error(found)}"
    )
    if found.state in {"failed", "quarantined"}:
        raise typer.Exit(Exit.FINDINGS)


def _error(job: Job) -> str:
    return f"{job.error.get('code', '')}: {job.error.get('detail', '')}" if job.error else ""
