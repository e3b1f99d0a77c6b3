"""Jobs, as a client sees them."""

from typing import Literal

from pydantic import Field

from service.http import models, problems
from store.queries.jobs import MOST_COUNTED, Queue
from store.tables import FrameRow, Job, job


class JobAnswer(
    models.Answer,
    restates=Job,
    fields="id kind subject_id state progress attempt result created_at finished_at dismissed_at",
):
    state: job.JobState
    progress: float = Field(ge=0, le=1)
    error: models.ProblemAnswer | None = None
    filename: str | None = models.maybe("Of the frame that it works on, where it is one.")
    campaign_id: str | None = models.maybe("The campaign of that frame, or its subject.")
    next_attempt_at: models.Instant | None = models.maybe(
        "When a job is tried again that waits for what `error.waits_for` names, if not sooner."
    )

    @classmethod
    def of(cls, row: Job, frame: FrameRow | None = None) -> "JobAnswer":
        error = None
        if row.error is not None:
            status = 422 if row.state == "failed" and row.traceback is None else 500
            error = problems.problem_body(row.error.get("status", status), **row.error)
        return cls.restate(
            row,
            error=error,
            next_attempt_at=row.due_at if row.state == "queued" and error is not None else None,
            filename=frame.filename if frame else None,
            campaign_id=frame.campaign_id if frame else row.subject_id if row.kind == "fit" else None,
        )


class RetriedJobs(models.Form):
    """Which jobs are tried again: those that all of this holds for."""

    state: Literal["failed", "quarantined"]
    kind: job.JobKind | None = None
    code: models.Text | None = models.maybe("The code of the error that they ended with.")
    campaign_id: models.Text | None = models.maybe("Jobs on this campaign and its frames.")


class DismissedJobs(RetriedJobs):
    """Which jobs are dismissed: those that all of this holds for."""

    dismissed: models.Flag = models.told("false: list them again.", default=True)


class DismissedAnswer(models.Answer):
    dismissed: int = models.told("How many jobs were changed.", ge=0)


class JobCauseAnswer(models.Answer):
    """Jobs that failed for one reason, with the newest of them."""

    count: int = Field(ge=1)
    newest: JobAnswer


class JobCausesAnswer(models.Answer):
    items: list[JobCauseAnswer]


class RetriedAnswer(models.Answer):
    retried: int = models.told("How many jobs are queued again.", ge=0)


class QueueAnswer(models.Answer):
    queued: int
    running: int
    succeeded: int
    failed: int
    quarantined: int
    more: list[job.JobState] = models.told(
        f"States with more jobs than their number states: each is counted up to {MOST_COUNTED}."
    )
    oldest_wait_s: float = models.told("How long the job that waits longest has been due.", ge=0)

    @classmethod
    def of(cls, queue: Queue) -> "QueueAnswer":
        return cls.model_validate(queue.counts | {"more": queue.more, "oldest_wait_s": queue.oldest_wait_s})
