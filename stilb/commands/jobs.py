"""Jobs of the service."""

from typing import Annotated

import typer

from stilb.client import Client
from stilb.commands.output import CampaignChosen, Exit, Output, command
from stilb.commands.terminal import counted, table
from stilb.records import Job

_SHOWN = 20
_GIVEN_UP = frozenset({"failed", "quarantined"})
KindChosen = Annotated[str | None, typer.Option(help="Kind of job, such as fit.")]


@command
def jobs(
    output: Output,
    job: str | None = typer.Argument(None, metavar="[JOB]", help="One job; default: the newest."),
    state: str | None = typer.Option(None, help="queued, running, succeeded, failed, quarantined."),
    kind: KindChosen = None,
    limit: int = typer.Option(_SHOWN, min=1, help="Largest number of jobs."),
    *,
    wait: bool = typer.Option(False, "--wait", help="Wait until the job ends."),
) -> None:
    """Show the newest jobs, or one job with its result."""
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
    shown = table(("kind", "of", "state", "done", "job", "error"), rows)
    output.answer({"items": [each.raw for each in found]}, shown)


@command
def dismiss(
    output: Output,
    state: str = typer.Option(..., help="failed, quarantined."),
    kind: KindChosen = None,
    code: str | None = typer.Option(None, help="Error code, such as not_a_raw_file."),
    campaign: CampaignChosen = None,
    *,
    undo: bool = typer.Option(False, "--undo", help="List them again."),
) -> None:
    """Dismiss failed jobs: they are not listed as failures."""
    with output.client() as client:
        campaign_id = client.find_campaign(campaign).id if campaign is not None else None
        count = client.dismiss_jobs(state, kind=kind, code=code, campaign_id=campaign_id, dismissed=not undo)
    output.answer({"dismissed": count}, f"{'listed again' if undo else 'dismissed'}: {counted(count, 'job')}")


@command
def retry(
    output: Output,
    job: str | None = typer.Argument(None, metavar="[JOB]", help="One job; default: all that match."),
    state: str | None = typer.Option(None, help="failed, quarantined."),
    kind: KindChosen = None,
    code: str | None = typer.Option(None, help="Error code, such as temporarily_unavailable."),
    campaign: CampaignChosen = None,
) -> None:
    """Retry a failed job, or with --state all that match."""
    if (job is None) == (state is None):
        raise typer.BadParameter("name one job, or select jobs with --state", param_hint="JOB")
    with output.client() as client:
        if job is not None:
            found = client.retry_job(job)
            output.answer(found.raw, f"{found.id} {found.kind} {found.state}")
            return
        campaign_id = client.find_campaign(campaign).id if campaign is not None else None
        count = client.retry_jobs(str(state), kind=kind, code=code, campaign_id=campaign_id)
    output.answer({"retried": count}, f"retried: {counted(count, 'job')}")


def _about(client: Client, found: list[Job]) -> dict[str, str]:
    """Return the file of each job, else the project number of its campaign."""
    named: dict[str, str | None] = {}
    if any("filename" not in each.raw for each in found):
        named = {each.id: each.project_number for each in client.campaigns()}
    return {
        each.id: each.raw.get("filename") or named.get(each.raw.get("campaign_id", "")) or ""
        for each in found
    }


def _one(output: Output, found: Job) -> None:
    result = ", ".join(f"{name} {value}" for name, value in (found.result or {}).items())
    said = f"{found.id} {found.kind} {found.state} {found.progress:.0%} {result}{_error(found)}"
    output.answer(found.raw, said)
    if found.state in _GIVEN_UP:
        raise typer.Exit(Exit.FINDINGS)


def _error(job: Job) -> str:
    return f"{job.error.get('code', '')}: {job.error.get('detail', '')}" if job.error else ""
