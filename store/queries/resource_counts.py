"""How much there is of everything, for whoever watches the service."""

from collections import Counter
from dataclasses import dataclass

from sqlalchemy import ColumnElement, func, select, text
from sqlalchemy.orm import InstrumentedAttribute, Session

from store.columns import utc_now
from store.files import count_damaged, find_proof_age_s
from store.jobs import GIVEN_UP
from store.parts import Part, list_parts
from store.queries.jobs import oldest_wait_s
from store.queues import IS_QUEUED
from store.tables import FrameRow, Job, Publication, Usage

_BEGUN = ("running", *GIVEN_UP)


@dataclass(frozen=True, kw_only=True)
class QueueCounts:
    """Counts of what is under way, by its indexes."""

    jobs: dict[str, int]
    """By state, but those that succeeded."""
    oldest_queued_s: float
    due_later: int
    """Queued jobs that are not due yet: they are tried again later, or the clock was set back."""
    failures: dict[str, int]
    """Jobs that failed or were quarantined, by the code of their error."""
    waiting_for: dict[str, int]
    """Queued jobs whose last attempt found something away, by what that was."""
    parts: list[Part]

    def count_parts(self, kind: str, state: str) -> int:
        return sum((part.kind, part.state) == (kind, state) for part in self.parts)

    @property
    def workers_without(self) -> dict[str, int]:
        """Workers that begin no job which needs a dependency, as it does not serve, by the dependency."""
        return Counter(each for part in self._working() for each in part.details.get("away", {}))

    @property
    def sandboxes(self) -> dict[str, int]:
        """Workers at work, by the level of their decoders' sandbox."""
        said = (part.details.get("decoder_sandbox") for part in self._working())
        return Counter(sandbox["level"] for sandbox in said if sandbox)

    def _working(self) -> list[Part]:
        return [part for part in self.parts if part.state == "working"]


@dataclass(frozen=True, kw_only=True)
class Totals:
    """Counts of everything, over all organisations; counting jobs takes time in proportion to them."""

    jobs: dict[str, int]
    frames: dict[str, int]
    refusals: dict[str, int]
    """Refused frames by the code of their refusal."""
    versions_published: int
    damaged_files: dict[str, int]
    """Stored files that are not what was uploaded, by what is wrong."""
    proof_age_s: float
    """How long ago the stored file was last proven that has waited longest for it; 0 without one."""
    stored_bytes: int
    largest_organisation: dict[str, int]
    """The most that any one organisation uses, to be compared with the quotas; not which."""


def count_queue(session: Session) -> QueueCounts:
    # apart from the other states: queued jobs have indexes of their own, the narrowest of which is read
    queued = select(func.count()).select_from(Job).where(IS_QUEUED)
    due_later = queued.where(Job.due_at > utc_now()).scalar_subquery()
    waiting, later = session.execute(select(queued.scalar_subquery(), due_later)).one()
    return QueueCounts(
        jobs=dict.fromkeys(_BEGUN, 0)
        | {"queued": waiting}
        | _count_by(session, Job.state, Job.state.in_(_BEGUN)),
        oldest_queued_s=oldest_wait_s(session),
        due_later=later,
        failures=_count_by(session, Job.error["code"].as_string(), Job.state.in_(GIVEN_UP)),
        waiting_for=_count_by(session, Job.waits_for, IS_QUEUED, Job.waits_for.is_not(None)),
        parts=list_parts(session),
    )


def count_totals(session: Session) -> Totals:
    in_force = select(func.count(Publication.calibration_id.distinct())).where(
        Publication.known_to.is_(None), Publication.superseded_by.is_(None)
    )
    # the condition as its index has it: SQLite compares the words
    unfinished = session.execute(
        select(FrameRow.state, FrameRow.refusal_code, func.count())
        .where(text("frame.state <> 'extracted'"))
        .group_by(FrameRow.state, FrameRow.refusal_code)
        .order_by(FrameRow.refusal_code)
    ).all()
    frames = Counter[str]()
    for state, _, count in unfinished:
        frames[state] += count
    stored, all_frames, most_bytes, most_frames = session.execute(
        select(
            func.coalesce(func.sum(Usage.stored_bytes), 0),
            func.coalesce(func.sum(Usage.frames), 0),
            func.coalesce(func.max(Usage.stored_bytes), 0),
            func.coalesce(func.max(Usage.frames), 0),
        )
    ).one()
    return Totals(
        jobs=_count_by(session, Job.state),
        frames=frames | Counter(extracted=max(int(all_frames) - frames.total(), 0)),
        refusals={code: count for _, code, count in unfinished if code is not None},
        versions_published=session.scalar(in_force) or 0,
        damaged_files=count_damaged(session),
        proof_age_s=find_proof_age_s(session),
        stored_bytes=int(stored),
        largest_organisation={"stored_bytes": most_bytes, "frames": most_frames},
    )


def _count_by(
    session: Session,
    column: InstrumentedAttribute[str] | InstrumentedAttribute[str | None] | ColumnElement[str],
    *where: ColumnElement[bool],
) -> dict[str, int]:
    value = column.label("value")
    rows = select(value, func.count()).where(*where).group_by(value).order_by(value)
    return {row[0]: row[1] for row in session.execute(rows) if row[0] is not None}
