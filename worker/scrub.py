"""Proves every stored file once in a while, slowly: what a disk spoils is found before anybody needs it.

A file carries the time of its last proof in its row, so that a restart goes on where the last run was.
"""

import time
from collections.abc import Callable
from datetime import timedelta
from typing import Final

from sqlalchemy import or_, select
from sqlalchemy.orm import Session, aliased

from store import jobs
from store.blobs import BlobDamaged
from store.database import Database
from store.files import Files
from store.jobs.processes import repeat
from store.queries.usage import add_jobs
from store.tables import Blob, Campaign, FrameRow
from store.tables.base import utc_now

_BYTES_PER_S: Final = 20e6
"""A disk reads ten times as fast: whoever works meanwhile notices little. 1.7 TB a day."""
_REST_S: Final = 60.0
_LOOK_AGAIN_S: Final = 600.0
"""How often what is damaged is looked at again: a backup may have brought it back."""
_AT_ONCE: Final = 50


class Scrub:
    """Reads what was not proven for so many days."""

    def __init__(
        self,
        database: Database,
        files: Files,
        *,
        days: float,
        wait: Callable[[float], object] = time.sleep,
        leads: Callable[[Session], bool] = lambda _session: True,
    ) -> None:
        """``leads``: whether this process is the one of several that scrubs."""
        self._database = database
        self._files = files
        self._days = days
        self._wait = wait
        self._leads = leads
        self._look_again_at = 0.0

    def start(self) -> None:
        """Scrub in a thread that ends with the process; 0 days mean never."""
        if self._days > 0:
            repeat("scrub", self.do_round)

    def do_round(self) -> float:
        """Prove what is due, and look again at what is damaged; return the pause until the next round [s]."""
        with self._database.reading() as session:
            if not self._leads(session):
                return _REST_S
        while due := self._find_due():
            for sha256 in due:
                self._prove(sha256)
        if time.monotonic() >= self._look_again_at:
            for sha256 in self._find_damaged():
                self._prove(sha256)
            self._redraw_previews()
            self._look_again_at = time.monotonic() + _LOOK_AGAIN_S
        return _REST_S

    def _prove(self, sha256: str) -> None:
        try:
            self._files.prove(sha256, lambda size: self._wait(size / _BYTES_PER_S))
        except BlobDamaged:
            # noted with the file; the next one is none the worse
            return

    def _find_due(self) -> list[str]:
        limit = utc_now() - timedelta(days=self._days)
        due = select(Blob.sha256).where(
            Blob.damage.is_(None), or_(Blob.proven_at < limit, Blob.digests.is_(None))
        )
        with self._database.reading() as session:
            return list(session.scalars(due.order_by(Blob.proven_at).limit(_AT_ONCE)))

    def _find_damaged(self) -> list[str]:
        with self._database.reading() as session:
            return list(session.scalars(select(Blob.sha256).where(Blob.damage.is_not(None))))

    def _redraw_previews(self) -> None:
        """Have the frames read again whose preview is damaged: nobody else could bring it back."""
        for frame_id in self._list_without_preview():
            with self._database.writing("sweeper") as session:
                frame = session.get_one(FrameRow, frame_id)
                campaign = session.get_one(Campaign, frame.campaign_id)
                if not jobs.is_live(session, frame.id):
                    jobs.enqueue_extraction(session, frame, campaign.organisation_id, by="sweeper")
                    add_jobs(session, 1, organisation_id=campaign.organisation_id)

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
