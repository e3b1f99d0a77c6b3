"""Usage of each organisation: one row, locked by whoever adds to it, and recounted before anybody is refused.

Of jobs an upper bound is kept, which a job that ends does not lower: at the quota the jobs are counted. An
upload in pieces takes the room of its frame when it begins, and is refused then or never.
"""

from collections.abc import Sequence
from datetime import timedelta
from typing import Final, Literal

from sqlalchemy import func, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from radiometry.records import Record
from store.blobs.partials import Facts, Partials
from store.queries import update_where
from store.settings import Settings
from store.tables import Blob, Campaign, FrameRow, Job, Organisation, Usage, utc_now

Quota = Literal["stored_bytes", "frames", "jobs_waiting"]

MOST_JOBS_WAITING: Final = 50_000
_RECOUNT_AFTER: Final = timedelta(minutes=1)


class QuotaExceeded(Exception):  # noqa: N818  it says what was found
    """More would be used than an organisation may; ``used`` is what it uses without it."""

    def __init__(self, quota: Quota, *, limit: int, used: int) -> None:
        super().__init__(f"{quota}: {used} of {limit}")
        self.quota, self.limit, self.used = quota, limit, used


class Used(Record):
    stored_bytes: int
    frames: int
    jobs_waiting: int


def read_usage(session: Session, organisation_id: str) -> Used:
    """Return what an organisation uses now; for showing, and for refusing before a body is sent."""
    row = session.get(Usage, organisation_id) or _count(session, organisation_id)
    return Used(
        stored_bytes=row.stored_bytes,
        frames=row.frames,
        jobs_waiting=_count_jobs(session, organisation_id, "queued"),
    )


def limits_files(settings: Settings) -> bool:
    return bool(settings.quota_bytes or settings.quota_frames)


def check_room(
    session: Session, organisation_id: str, settings: Settings, *, size_bytes: int, keep: bool = False
) -> None:
    """Raise QuotaExceeded when one more frame is too much as it looks now: before its bytes are sent."""
    row = _lock(session, organisation_id)[0] if keep else session.get(Usage, organisation_id)
    row = row or _count(session, organisation_id)
    used = {"frames": row.frames, "stored_bytes": row.stored_bytes}
    _refuse_over(session, organisation_id, settings, [size_bytes], **used)
    if row.jobs_most >= MOST_JOBS_WAITING:
        _refuse_long_queue(session, organisation_id, room_for=1)


def charge(
    session: Session,
    organisation_id: str,
    settings: Settings,
    *,
    sizes_bytes: Sequence[int],
    had_room: bool,
    jobs: int,
) -> None:
    """Count, as the last step before the commit, the frames and jobs that it adds, or raise QuotaExceeded."""
    frames, size_bytes = len(sizes_bytes), sum(sizes_bytes)
    session.flush()
    row = session.execute(
        update(Usage)
        .where(Usage.organisation_id == organisation_id)
        .values(
            frames=Usage.frames + frames,
            stored_bytes=Usage.stored_bytes + size_bytes,
            jobs_most=Usage.jobs_most + jobs,
        )
        .returning(Usage.frames, Usage.stored_bytes, Usage.jobs_most)
        .execution_options(synchronize_session=False)
    ).first()
    # an organisation that was founded after the counts were made has none yet
    used = row or _lock(session, organisation_id)[0]
    if not had_room:
        before = {"frames": used.frames - frames, "stored_bytes": used.stored_bytes - size_bytes}
        _refuse_over(session, organisation_id, settings, sizes_bytes, **before)
    if jobs and used.jobs_most > MOST_JOBS_WAITING:
        _refuse_long_queue(session, organisation_id)
        bound = _count_jobs(session, organisation_id, "queued", "running")
        update_where(session, Usage, Usage.organisation_id == organisation_id, jobs_most=bound)


def add_jobs(session: Session, count: int, *, organisation_id: str | None = None) -> None:
    """Raise the bound by jobs that wait again or that nobody asked for, of one organisation or of all."""
    raised = update(Usage).values(jobs_most=Usage.jobs_most + count)
    if organisation_id is not None:
        raised = raised.where(Usage.organisation_id == organisation_id)
    session.execute(raised.execution_options(synchronize_session=False))


def recount_if_old(session: Session, organisation_id: str) -> None:
    """Recount what an organisation stores, unless that was just done: before it is refused for it."""
    row, _ = _lock(session, organisation_id)
    if utc_now() - row.counted_at >= _RECOUNT_AFTER:
        _recount(session, row)


def recount_all(session: Session) -> None:
    """Recount what every organisation stores, whatever was done to the counts."""
    for organisation_id in session.scalars(select(Organisation.id).order_by(Organisation.id)):
        row, counted = _lock(session, organisation_id)
        if not counted:
            _recount(session, row)


def _refuse_over(
    session: Session,
    organisation_id: str,
    settings: Settings,
    sizes_bytes: Sequence[int],
    *,
    frames: int,
    stored_bytes: int,
) -> None:
    """Raise QuotaExceeded if new frames have no room beside those that are stored and those under way."""
    if not sizes_bytes or not limits_files(settings):
        return
    begun = _list_begun(session, Partials.of(settings).list_facts(organisation_id))
    frames, stored_bytes = frames + len(begun), stored_bytes + sum(begun)
    if 0 < settings.quota_frames < frames + len(sizes_bytes):
        raise QuotaExceeded("frames", limit=settings.quota_frames, used=frames)
    if 0 < settings.quota_bytes < stored_bytes + sum(sizes_bytes):
        raise QuotaExceeded("stored_bytes", limit=settings.quota_bytes, used=stored_bytes)


def _list_begun(session: Session, begun: Sequence[Facts]) -> list[int]:
    """Return the sizes [bytes] that uploads under way will add; a file that its campaign has adds none."""
    hashes = {facts.sha256 for facts in begun if facts.sha256}
    rows = select(FrameRow.campaign_id, FrameRow.sha256).where(FrameRow.sha256.in_(hashes))
    known = {(row[0], row[1]) for row in session.execute(rows)} if hashes else set()
    return [facts.size_bytes for facts in begun if (facts.campaign_id, facts.sha256) not in known]


def _refuse_long_queue(session: Session, organisation_id: str, *, room_for: int = 0) -> None:
    waiting = _count_jobs(session, organisation_id, "queued", most=MOST_JOBS_WAITING + 1)
    if waiting + room_for > MOST_JOBS_WAITING:
        raise QuotaExceeded("jobs_waiting", limit=MOST_JOBS_WAITING, used=min(waiting, MOST_JOBS_WAITING))


def _lock(session: Session, organisation_id: str) -> tuple[Usage, bool]:
    """Return an organisation's counts, locked, and whether they were counted just now."""
    found = session.get(Usage, organisation_id, with_for_update=True, populate_existing=True)
    if found is not None:
        return found, False
    # founded after the counts were made; of two that come at once the second finds the first one's
    made = Usage(organisation_id=organisation_id, frames=0, stored_bytes=0, jobs_most=0, counted_at=utc_now())
    try:
        with session.begin_nested():
            session.add(made)
    except IntegrityError:
        return session.get_one(Usage, organisation_id, with_for_update=True), False
    _recount(session, made)
    return made, True


def _recount(session: Session, row: Usage) -> None:
    counted = _count(session, row.organisation_id)
    row.frames, row.stored_bytes, row.jobs_most = counted.frames, counted.stored_bytes, counted.jobs_most
    row.counted_at = utc_now()
    session.flush()


def _count(session: Session, organisation_id: str) -> Usage:
    frames, stored_bytes = session.execute(
        select(func.count(FrameRow.id), func.coalesce(func.sum(Blob.size_bytes), 0))
        .select_from(FrameRow)
        .join(Campaign, Campaign.id == FrameRow.campaign_id)
        .join(Blob, Blob.sha256 == FrameRow.sha256)
        .where(Campaign.organisation_id == organisation_id)
    ).one()
    return Usage(
        organisation_id=organisation_id,
        frames=frames,
        stored_bytes=int(stored_bytes),
        jobs_most=_count_jobs(session, organisation_id, "queued", "running"),
    )


def _count_jobs(session: Session, organisation_id: str, *states: str, most: int | None = None) -> int:
    jobs = select(Job.id).where(Job.state.in_(states), Job.organisation_id == organisation_id).limit(most)
    return session.scalar(select(func.count()).select_from(jobs.subquery())) or 0
