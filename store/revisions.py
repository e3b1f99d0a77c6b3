"""The revision of a campaign rises with every change that its review depends on, in the same transaction."""

from collections.abc import Callable, Sequence
from typing import Any

from sqlalchemy import ColumnElement, insert, or_, select, update
from sqlalchemy.orm import Session

from store.tables.base import insert_or_not
from store.tables.calibration import Calibration, Revocation
from store.tables.campaign import Campaign, CampaignReview, Extraction, FrameChange, FrameRow, Reading
from store.tables.organisation import Camera, Meter, Organisation, Panel

_MOST_AT_ONCE = 5000

_OWN: dict[type, Callable[[Any], str]] = {
    Campaign: lambda row: row.id,
    FrameRow: lambda row: row.campaign_id,
    Reading: lambda row: row.campaign_id,
    Calibration: lambda row: row.campaign_id,
}

_SHARED: dict[type, Callable[[Any], ColumnElement[bool]]] = {
    Extraction: lambda row: Campaign.id.in_(select(FrameRow.campaign_id).where(FrameRow.id == row.frame_id)),
    Revocation: lambda row: Campaign.id.in_(
        select(Calibration.campaign_id).where(Calibration.id == row.calibration_id)
    ),
    Camera: lambda row: Campaign.camera_id == row.id,
    Meter: lambda row: Campaign.id.in_(select(Reading.campaign_id).where(Reading.meter_id == row.id)),
    # a campaign that names no panel takes the one that its organisation has
    Panel: lambda row: Campaign.organisation_id == row.organisation_id,
    Organisation: lambda row: Campaign.organisation_id == row.id,
}


_NOTED = (
    *("changed_campaigns", "changed_of_campaigns", "campaigns_changed_themselves"),
    *("changed_frames", "changed_of_frames"),
)
_STAMP = ("frame_id", "campaign_id", "revision")


def note_changes(session: Session, _context: object) -> None:
    """Note the campaigns that a flush has just changed."""
    rows = [*session.new, *session.deleted, *(row for row in session.dirty if session.is_modified(row))]
    frames = session.info.setdefault("changed_frames", {})
    frames |= {row.id: row.campaign_id for row in rows if isinstance(row, FrameRow)}
    of_frames = session.info.setdefault("changed_of_frames", set())
    of_frames |= {row.frame_id for row in rows if isinstance(row, Extraction)}
    whole = session.info.setdefault("campaigns_changed_themselves", set())
    whole |= {row.id for row in rows if isinstance(row, Campaign)}
    own = session.info.setdefault("changed_campaigns", set())
    own |= {_OWN[type(row)](row) for row in rows if type(row) in _OWN}
    shared = {(type(row), row) for row in rows if type(row) in _SHARED}
    session.info.setdefault("changed_of_campaigns", set()).update(shared)
    new = [{"campaign_id": row.id} for row in session.new if isinstance(row, Campaign)]
    if new:
        session.execute(insert(CampaignReview), new)


def raise_revisions(session: Session) -> None:
    """Raise the revision of each campaign that was noted; called before the audit entries are chained."""
    changed: set[str] = session.info.pop("changed_campaigns", set())
    shared = session.info.pop("changed_of_campaigns", set())
    where = [_SHARED[kind](row) for kind, row in shared]
    if where:
        changed |= set(session.scalars(select(Campaign.id).where(or_(*where))))
    if not changed:
        return
    chosen = CampaignReview.campaign_id.in_(changed)
    if len(changed) > 1:
        locked = select(CampaignReview.campaign_id).where(chosen).order_by(CampaignReview.campaign_id)
        session.execute(locked.with_for_update())
    # by the connection: to look what a session holds of them costs more than the statement
    raised = update(CampaignReview).where(chosen).values(revision=CampaignReview.revision + 1)
    revised = session.connection().execute(
        raised.returning(CampaignReview.campaign_id, CampaignReview.revision)
    )
    revisions: dict[str, int] = {row[0]: row[1] for row in revised}
    whole: set[str] = session.info.pop("campaigns_changed_themselves", set())
    # its time zone holds for all frames
    whole |= changed if any(kind is Organisation for kind, _ in shared) else set()
    if whole:
        themselves = update(CampaignReview).where(CampaignReview.campaign_id.in_(whole))
        session.execute(themselves.values(whole_revision=CampaignReview.revision))
    frames: dict[str, str] = session.info.pop("changed_frames", {})
    described: set[str] = session.info.pop("changed_of_frames", set()) - frames.keys()
    if described:
        found = select(FrameRow.id, FrameRow.campaign_id).where(FrameRow.id.in_(described))
        frames |= {row[0]: row[1] for row in session.execute(found)}
    stamp_frames(
        session, [(frame, campaign, revisions[campaign]) for frame, campaign in sorted(frames.items())]
    )


def stamp_frames(session: Session, stamps: Sequence[tuple[str, str, int]]) -> None:
    """Keep id, campaign and revision of frames that have changed; the campaign's review is locked by now."""
    for first in range(0, len(stamps), _MOST_AT_ONCE):
        some = stamps[first : first + _MOST_AT_ONCE]
        added = insert_or_not(session, FrameChange)
        newer = {"campaign_id": added.excluded.campaign_id, "revision": added.excluded.revision}
        session.connection().execute(
            added.on_conflict_do_update(index_elements=[FrameChange.frame_id], set_=newer),
            [dict(zip(_STAMP, each, strict=True)) for each in some],
        )


def forget_changes(session: Session) -> None:
    """Forget what was rolled back."""
    for noted in _NOTED:
        session.info.pop(noted, None)
