"""Work of one process of all workers beside the jobs: old statistics are renewed, stored files proven."""

import time
from collections.abc import Callable
from datetime import timedelta
from typing import Final

from sqlalchemy import Select, or_, select, true
from sqlalchemy.orm import Session, aliased

from store import blobs, jobs, software
from store.database import Database
from store.files import SCRUB_DAYS, Files
from store.queries import campaigns, usage
from store.tables import Blob, Campaign, Extraction, FrameRow, Job, utc_now

_RENEWED_AT_ONCE: Final = 500
_IN_ONE_COMMIT: Final = 20  # while one lasts, nobody else writes to SQLite
_RENEWAL_REST_S: Final = 5.0
_RENEWED_S: Final = 24 * 3600.0  # only another version of the code, another process, leaves more to do


class Renewal:
    """Queues the frames of open campaigns that have no statistics of this version's extractor."""

    def __init__(
        self, database: Database, *, leads: Callable[[Session], bool] = lambda _session: True
    ) -> None:
        """``leads``: whether this process is the one of several that looks."""
        self._database, self._leads = database, leads
        self._before: str | None = None  # the last that was queued: each is queued once, whatever comes of it

    def do_round(self) -> float:
        """Queue some frames unless others wait; return the pause until the next round [s]."""
        with self._database.reading() as session:
            waiting = select(Job.id).where(Job.state == "queued", Job.lane == campaigns.RENEWAL_LANE).limit(1)
            if not self._leads(session) or session.scalar(waiting) is not None:
                return _RENEWAL_REST_S
            rest = FrameRow.id < self._before if self._before else true()
            found = session.scalars(_select_outdated().where(rest).limit(_RENEWED_AT_ONCE)).all()
        if not found:
            return _RENEWED_S
        for start in range(0, len(found), _IN_ONE_COMMIT):
            some = found[start : start + _IN_ONE_COMMIT]
            with self._database.writing("sweeper") as session:
                for frame_id in some:
                    _queue_renewal(session, frame_id)
            self._before = some[-1]
        return _RENEWAL_REST_S


def _queue_renewal(session: Session, frame_id: str) -> None:
    frame = session.get_one(FrameRow, frame_id)
    if frame.state == "extracted":
        organisation_id = session.get_one(Campaign, frame.campaign_id).organisation_id
        campaigns.renew_extraction(session, frame, organisation_id, by="sweeper", lane=campaigns.RENEWAL_LANE)
        usage.add_jobs(session, 1, organisation_id=organisation_id)


def _select_outdated() -> Select[str]:
    made_by = Extraction.extractor
    own = (made_by == software.EXTRACTOR) | made_by.startswith(f"{software.EXTRACTOR}+", autoescape=True)
    current = select(Extraction.id).where(Extraction.frame_id == FrameRow.id, own)
    return (
        select(FrameRow.id)
        .join(Campaign, Campaign.id == FrameRow.campaign_id)
        .where(FrameRow.state == "extracted", FrameRow.withdrawn_at.is_(None), ~current.exists())
        .where(Campaign.archived_at.is_(None))
        .order_by(FrameRow.id.desc())
    )


_BYTES_PER_S: Final = 20e6  # a disk reads ten times as fast: whoever works notices little. 1.7 TB a day
_REST_S: Final = 60.0
_LOOK_AGAIN_S: Final = 600.0  # at what is damaged: a backup may have brought it back
_PROVEN_AT_ONCE: Final = 50


class Scrub:
    """Reads what was not proven for `SCRUB_DAYS`."""

    def __init__(
        self,
        database: Database,
        files: Files,
        *,
        wait: Callable[[float], object] = time.sleep,
        leads: Callable[[Session], bool] = lambda _session: True,
    ) -> None:
        """``leads``: whether this process is the one of several that scrubs."""
        self._database, self._files, self._wait, self._leads = database, files, wait, leads
        self._look_again_at = 0.0

    def do_round(self) -> float:
        """Prove what is due, and look again at what is damaged; return the pause until the next round [s]."""
        with self._database.reading() as session:
            if not self._leads(session):
                return _REST_S
        while due := self._find_due():
            for sha256 in due:
                self._prove(sha256)
        if time.monotonic() >= self._look_again_at:
            with self._database.reading() as session:
                damaged = session.scalars(select(Blob.sha256).where(Blob.damage.is_not(None))).all()
            for sha256 in damaged:
                self._prove(sha256)
            self._redraw_previews()
            self._look_again_at = time.monotonic() + _LOOK_AGAIN_S
        return _REST_S

    def _prove(self, sha256: str) -> None:
        try:
            self._files.prove(sha256, lambda size: self._wait(size / _BYTES_PER_S))
        except blobs.BlobDamaged:
            # noted with the file; the next one is none the worse
            return

    def _find_due(self) -> list[str]:
        limit = utc_now() - timedelta(days=SCRUB_DAYS)
        late = or_(Blob.proven_at < limit, Blob.digests.is_(None))
        due = select(Blob.sha256).where(Blob.damage.is_(None), late)
        with self._database.reading() as session:
            return list(session.scalars(due.order_by(Blob.proven_at).limit(_PROVEN_AT_ONCE)))

    def _redraw_previews(self) -> None:
        """Have the frames read again whose preview is damaged: nobody else could bring it back."""
        for frame_id in self._list_without_preview():
            with self._database.writing("sweeper") as session:
                frame = session.get_one(FrameRow, frame_id)
                campaign = session.get_one(Campaign, frame.campaign_id)
                if not jobs.is_live(session, frame.id):
                    jobs.enqueue_extraction(session, frame, campaign.organisation_id, by="sweeper")
                    usage.add_jobs(session, 1, organisation_id=campaign.organisation_id)

    def _list_without_preview(self) -> list[str]:
        preview, content = aliased(Blob), aliased(Blob)
        frames = (
            select(FrameRow.id)
            .join(preview, preview.sha256 == FrameRow.preview_sha256)
            .join(content, content.sha256 == FrameRow.sha256)
            .where(preview.damage.is_not(None), content.damage.is_(None))
        )
        with self._database.reading() as session:
            return list(session.scalars(frames))
