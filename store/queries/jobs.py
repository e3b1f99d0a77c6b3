"""Jobs for those who wait for them, and counts of everything for whoever watches the service."""

from collections import Counter
from collections.abc import Collection, Sequence
from typing import Any

from sqlalchemy import ColumnElement, func, or_, select, text
from sqlalchemy.orm import Session, aliased

from radiometry.records import Record
from store.files import count_damaged, find_proof_age_s
from store.jobs import GIVEN_UP, PREVIEW_LANE, processes, queues
from store.queries import by_id
from store.tables import Calibration, FrameRow, Job, Measurement, PartRow, Publication, Usage, utc_now

MOST_COUNTED = 2000  # jobs of a state are counted up to here: 100,000 cost what a few thousand do


class Queue(Record):
    counts: dict[str, int]  # by state, at most `MOST_COUNTED` of each
    more: list[str]  # states of which there are more than were counted
    oldest_wait_s: float


def summarise_queue(session: Session, organisation_id: str, states: Sequence[str]) -> Queue:
    mine = select(Job.id).where(Job.organisation_id == organisation_id).limit(MOST_COUNTED + 1)
    some = [mine.where(Job.state == state).subquery() for state in states]
    counted = [select(func.count()).select_from(each).scalar_subquery() for each in some]
    row = session.execute(select(*counted)).one()
    counts = dict(zip(states, row, strict=True))
    return Queue(
        counts={state: min(count, MOST_COUNTED) for state, count in counts.items()},
        more=[state for state, count in counts.items() if count > MOST_COUNTED],
        oldest_wait_s=oldest_wait_s(session, organisation_id),
    )


class Cause(Record):
    """Jobs that failed for one reason: of one state, kind, error code and campaign."""

    count: int
    newest: Job


def list_causes(session: Session, organisation_id: str) -> list[Cause]:
    """List why jobs were given up, unless dismissed or done since; the most frequent cause first."""
    since = aliased(Job)
    ended = since.state.in_((*GIVEN_UP, "succeeded"))
    done_since = select(since.id).where(
        since.subject_id == Job.subject_id, since.kind == Job.kind, since.id > Job.id, ended
    )
    code = Job.error["code"].as_string()
    theirs = (Job.organisation_id == organisation_id) & Job.dismissed_at.is_(None)
    newest = [
        select(Job.id).where(theirs, Job.state == state).order_by(Job.id.desc()).limit(MOST_COUNTED)
        for state in GIVEN_UP
    ]
    groups = (
        select(func.count(), func.max(Job.id))
        .outerjoin(FrameRow, FrameRow.id == Job.subject_id)
        .where(or_(*(Job.id.in_(select(each.subquery().c.id)) for each in newest)), ~done_since.exists())
        .group_by(Job.state, Job.kind, code, func.coalesce(FrameRow.campaign_id, Job.subject_id))
    )
    counts = {row[1]: row[0] for row in session.execute(groups)}
    causes = [Cause(count=counts[key], newest=row) for key, row in by_id(session, Job, counts).items()]
    return sorted(causes, key=lambda cause: (-cause.count, cause.newest.id))


def select_given_up(
    organisation_id: str, *, state: str, kind: str | None, code: str | None, campaign_id: str | None
) -> ColumnElement[bool]:
    """Return which of an organisation's jobs are in a state, of a kind, ended by a code, of a campaign."""
    chosen = (Job.organisation_id == organisation_id) & (Job.state == state)
    if kind is not None:
        chosen &= Job.kind == kind
    if code is not None:
        chosen &= Job.error["code"].as_string() == code
    if campaign_id is not None:
        frames = select(FrameRow.id).where(FrameRow.campaign_id == campaign_id)
        chosen &= (Job.subject_id == campaign_id) | Job.subject_id.in_(frames)
    return chosen


def select_makers(made: Calibration | Measurement) -> ColumnElement[bool]:
    """Return which jobs made a version or a measurement; the same content made again is the same one."""
    if isinstance(made, Calibration):
        subject_id, kind, result = made.campaign_id, "fit", "calibration_id"
    else:
        subject_id, kind, result = made.frame_id, "measure", "measurement_id"
    named: ColumnElement[bool] = Job.result[result].as_string() == made.id
    return (Job.subject_id == subject_id) & (Job.kind == kind) & named


def find_reading_jobs(session: Session, frame_ids: Collection[str]) -> dict[str, str]:
    """Return the newest job that reads each frame, by the frame's id; previews do not count."""
    newest = select(Job.subject_id, func.max(Job.id)).group_by(Job.subject_id)
    rows = newest.where(Job.subject_id.in_(frame_ids), Job.kind == "extract", Job.lane != PREVIEW_LANE)
    return {row[0]: row[1] for row in session.execute(rows)}


def oldest_wait_s(session: Session, organisation_id: str | None = None) -> float:
    """How long the job that has waited longest has been due [s], of all or of one; 0 when none waits."""
    now = utc_now()
    first = select(Job.due_at).where(Job.due_at <= now).order_by(Job.due_at).limit(1)
    if organisation_id is None:
        found = [session.scalar(first.where(queues.IS_QUEUED))]
    else:
        # lane by lane: each is a look into the index of what is sent next, however many jobs wait
        theirs = (Job.state == "queued") & (Job.organisation_id == organisation_id)
        found = [session.scalar(first.where(theirs, Job.lane == lane)) for lane in queues.LANES]
    return max(((now - due_at).total_seconds() for due_at in found if due_at), default=0.0)


_BEGUN = ("running", *GIVEN_UP)


class QueueCounts(Record):
    jobs: dict[str, int]  # by state, but those that succeeded
    oldest_queued_s: float
    due_later: int  # queued jobs that are not due yet: they are tried again later, or the clock was set back
    failures: dict[str, int]  # jobs that failed or were quarantined, by the code of their error
    waiting_for: dict[str, int]  # queued jobs whose last attempt found something away, by what that was
    parts: list[PartRow]

    def count_parts(self, kind: str, state: str) -> int:
        return sum((part.kind, part.state) == (kind, state) for part in self.parts)

    @property
    def workers_without(self) -> dict[str, int]:
        """Workers that begin no job which needs a dependency, as it does not serve, by the dependency."""
        return Counter(each for part in self._working() for each in part.details.get("away", {}))

    @property
    def sandboxes(self) -> dict[str, int]:
        said = (part.details.get("decoder_sandbox") for part in self._working())
        return Counter(sandbox["level"] for sandbox in said if sandbox)

    def _working(self) -> list[PartRow]:
        return [part for part in self.parts if part.state == "working"]


class Totals(Record):
    """Counts of everything, over all organisations; counting jobs takes time in proportion to them."""

    jobs: dict[str, int]
    frames: dict[str, int]
    refusals: dict[str, int]  # refused frames by the code of their refusal
    versions_published: int
    damaged_files: dict[str, int]  # stored files that are not what was uploaded, by what is wrong
    proof_age_s: float  # how long the file that has waited longest for its proof has waited; 0 without one
    stored_bytes: int
    largest_organisation: dict[str, int]  # the most that one uses, to be compared with the quotas; not which


def count_queue(session: Session) -> QueueCounts:
    # apart from the other states: queued jobs have indexes of their own, the narrowest of which is read
    queued = select(func.count()).select_from(Job).where(queues.IS_QUEUED)
    due_later = queued.where(Job.due_at > utc_now()).scalar_subquery()
    waiting, later = session.execute(select(queued.scalar_subquery(), due_later)).one()
    begun = _count_by(session, Job.state, Job.state.in_(_BEGUN))
    return QueueCounts(
        jobs=dict.fromkeys(_BEGUN, 0) | {"queued": waiting} | begun,
        oldest_queued_s=oldest_wait_s(session),
        due_later=later,
        failures=_count_by(session, Job.error["code"].as_string(), Job.state.in_(GIVEN_UP)),
        waiting_for=_count_by(session, Job.waits_for, queues.IS_QUEUED, Job.waits_for.is_not(None)),
        parts=processes.list_parts(session),
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
    used = (Usage.stored_bytes, Usage.frames)
    figures = [func.coalesce(of(column), 0) for of in (func.sum, func.max) for column in used]
    stored, all_frames, most_bytes, most_frames = list(session.execute(select(*figures)).one())
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


def _count_by(session: Session, column: Any, *where: ColumnElement[bool]) -> dict[str, int]:  # noqa: ANN401
    value = column.label("value")
    rows = select(value, func.count()).where(*where).group_by(value).order_by(value)
    return {row[0]: row[1] for row in session.execute(rows) if row[0] is not None}
