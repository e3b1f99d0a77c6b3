"""Statistics that an earlier version extracted: their frames are read again, a few at a time."""

from collections.abc import Callable
from typing import Final

from sqlalchemy import Select, select, true
from sqlalchemy.orm import Session

from store.database import Database
from store.jobs.processes import repeat
from store.queries.campaigns import RENEWAL_LANE, renew_extraction
from store.queries.usage import add_jobs
from store.software import EXTRACTOR
from store.tables import Campaign, Extraction, FrameRow, Job

_AT_ONCE: Final = 500
_IN_ONE_COMMIT: Final = 20
"""While one lasts, nobody else writes to SQLite."""
_REST_S: Final = 5.0
_DONE_S: Final = 24 * 3600.0
"""Only another version of the code, which is another process, leaves more to do."""


class Renewal:
    """Queues the frames of open campaigns that have no statistics of this version's extractor.

    A fit takes no others. The jobs have a lane of their own, so that a card which is sent meanwhile does not
    wait for them.
    """

    def __init__(
        self, database: Database, *, leads: Callable[[Session], bool] = lambda _session: True
    ) -> None:
        """``leads``: whether this process is the one of several that looks."""
        self._database = database
        self._leads = leads
        self._before: str | None = None
        """The last frame that was queued: each is queued once, whatever comes of it."""

    def start(self) -> None:
        """Renew in a thread that ends with the process."""
        repeat("renewal", self.do_round)

    def do_round(self) -> float:
        """Queue some frames unless others wait; return the pause until the next round [s]."""
        with self._database.reading() as session:
            waiting = select(Job.id).where(Job.state == "queued", Job.lane == RENEWAL_LANE).limit(1)
            if not self._leads(session) or session.scalar(waiting) is not None:
                return _REST_S
            rest = FrameRow.id < self._before if self._before else true()
            found = session.scalars(_select_outdated().where(rest).limit(_AT_ONCE)).all()
        if not found:
            return _DONE_S
        for start in range(0, len(found), _IN_ONE_COMMIT):
            some = found[start : start + _IN_ONE_COMMIT]
            with self._database.writing("sweeper") as session:
                for frame_id in some:
                    _queue(session, frame_id)
            self._before = some[-1]
        return _REST_S


def _queue(session: Session, frame_id: str) -> None:
    frame = session.get_one(FrameRow, frame_id)
    if frame.state == "extracted":
        organisation_id = session.get_one(Campaign, frame.campaign_id).organisation_id
        renew_extraction(session, frame, organisation_id, by="sweeper", lane=RENEWAL_LANE)
        add_jobs(session, 1, organisation_id=organisation_id)


def _select_outdated() -> Select[str]:
    made_by = Extraction.extractor
    own = (made_by == EXTRACTOR) | made_by.startswith(f"{EXTRACTOR}+", autoescape=True)
    current = select(Extraction.id).where(Extraction.frame_id == FrameRow.id, own)
    return (
        select(FrameRow.id)
        .join(Campaign, Campaign.id == FrameRow.campaign_id)
        .where(FrameRow.state == "extracted", FrameRow.withdrawn_at.is_(None), ~current.exists())
        .where(Campaign.archived_at.is_(None))
        .order_by(FrameRow.id.desc())
    )
