"""Jobs, whose rows are the authority on work, the turns of queues, and the processes that run."""

from datetime import datetime
from typing import Literal

from sqlalchemy import CheckConstraint, Index, text
from sqlalchemy.orm import Mapped, mapped_column

from store.log_fields import present_request_id
from store.tables.base import Base, Dated, Identified, Json, Owned, index_some, one_of, utc_now

JobKind = Literal["extract", "fit", "measure"]
JobState = Literal["queued", "running", "succeeded", "failed", "quarantined"]

_QUEUED = text("state = 'queued'")
_SENT = text("state = 'queued' AND sent_at IS NOT NULL")
_READING = text("kind = 'extract' AND state IN ('queued', 'running')")


class Job(Identified, Dated, Owned, Base, prefix="job"):
    __table_args__ = (
        one_of("kind", JobKind),
        one_of("state", JobState),
        CheckConstraint("progress BETWEEN 0 AND 1", "progress_share"),
        CheckConstraint("(state = 'running') = (lease_until IS NOT NULL)", "running_has_lease"),
        Index("ix_job_state_lane_organisation_id_due_at", "state", "lane", "organisation_id", "due_at"),
        Index("ix_job_organisation_id_id", "organisation_id", "id"),
        Index("ix_job_organisation_id_state_id", "organisation_id", "state", "id"),
        Index("ix_job_subject_id", "subject_id"),
        index_some("ix_job_state_due_at", "state", "due_at", where=_QUEUED),
        index_some("ix_job_state_waits_for", "state", "waits_for", where=_QUEUED),
        index_some("ix_job_lane_sent_at", "lane", "sent_at", where=_SENT),
        index_some("ix_job_reading", "organisation_id", "subject_id", where=_READING),
    )

    kind: Mapped[str]
    subject_id: Mapped[str]  # the frame or campaign it works on
    lane: Mapped[str]  # what it is: `store.jobs.queues.LANES` names its queue and its task
    parameters: Mapped[Json] = mapped_column(default=dict)
    state: Mapped[str] = mapped_column(default="queued")
    progress: Mapped[float] = mapped_column(default=0.0)
    attempt: Mapped[int] = mapped_column(default=0)
    lost: Mapped[int] = mapped_column(default=0)  # how many workers were lost in it: three quarantine it
    fence: Mapped[int] = mapped_column(default=0)  # rises with every claim: a lost lease can store nothing
    lease_until: Mapped[datetime | None]
    holder: Mapped[str | None]  # the process that runs it or ran it last, as host:pid
    sent_at: Mapped[datetime | None]  # of its message, while it is queued
    due_at: Mapped[datetime] = mapped_column(default=utc_now)
    faulty_since: Mapped[datetime | None]  # something that it needs did not answer: tried again for a day
    request_id: Mapped[str | None] = mapped_column(default=present_request_id)
    """The request that queued it, as its log line and `X-Request-ID` name it."""
    traceparent: Mapped[str | None]  # of releases before 0.4, which sent traces
    waits_for: Mapped[str | None]  # what serves nobody, as the last attempt found; None: its turn alone
    error: Mapped[Json | None]
    result: Mapped[Json | None] = mapped_column(doc="Ids and links of what was made.")
    traceback: Mapped[str | None]  # kept for the operator, never served
    created_by: Mapped[str]
    finished_at: Mapped[datetime | None]
    dismissed_at: Mapped[datetime | None] = mapped_column(
        doc="When a person dismissed its failure: it is no longer listed as one to mend."
    )


class Turn(Base):
    """A queue's way round the organisations. Not audited: it is nobody's decision."""

    queue: Mapped[str] = mapped_column(primary_key=True)
    organisation_id: Mapped[str] = mapped_column(default="")  # the one whose job was sent last


PartState = Literal["working", "hung", "gone"]
STALE_AFTER_S = 35.0  # three missed beats and a moment


class PartRow(Base):
    """One run of one process. Not audited: it records that somebody is there, and nobody's decision."""

    __table_args__ = (one_of("kind", Literal["service", "worker", "sweeper"]),)

    # its kind and slot, such as "worker-1": a process that starts takes the lowest slot that is free
    id: Mapped[str] = mapped_column(primary_key=True)
    kind: Mapped[str]
    host: Mapped[str]
    pid: Mapped[int]
    started_at: Mapped[datetime] = mapped_column(default=utc_now)
    seen_at: Mapped[datetime]  # when the process last wrote this row
    worked_at: Mapped[datetime]  # when the loop that does the work last did some, or was free to
    details: Mapped[Json] = mapped_column(default=dict)
    counts: Mapped[Json | None]  # what the other processes of its kind must count with: shown to nobody

    @property
    def seen_s_ago(self) -> float:
        # a beat from the future was written before the clock was set back: as far away as one as old
        return abs((utc_now() - self.seen_at).total_seconds())

    @property
    def worked_s_ago(self) -> float:
        return abs((utc_now() - self.worked_at).total_seconds())

    @property
    def state(self) -> PartState:
        """Return "gone" without a heartbeat, "hung" if it beats and no work goes on, else "working"."""
        if self.seen_s_ago > STALE_AFTER_S:
            return "gone"
        return "hung" if self.worked_s_ago > STALE_AFTER_S else "working"
