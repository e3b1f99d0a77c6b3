"""The revision of a campaign rises with every change that its review depends on, in the same transaction."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
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


@dataclass
class _Noted:
    own: set[str] = field(default_factory=set)
    shared: set[tuple[type, Any]] = field(default_factory=set)
    whole: set[str] = field(default_factory=set)  # campaigns that have changed themselves
    frames: dict[str, str] = field(default_factory=dict)  # their campaigns
    of_frames: set[str] = field(default_factory=set)


_STAMP = ("frame_id", "campaign_id", "revision")


def note_changes(session: Session, _context: object) -> None:
    rows = [*session.new, *session.deleted, *(row for row in session.dirty if session.is_modified(row))]
    noted: _Noted = session.info.setdefault("changes", _Noted())
    noted.frames |= {row.id: row.campaign_id for row in rows if isinstance(row, FrameRow)}
    noted.of_frames |= {row.frame_id for row in rows if isinstance(row, Extraction)}
    noted.whole |= {row.id for row in rows if isinstance(row, Campaign)}
    noted.own |= {_OWN[type(row)](row) for row in rows if type(row) in _OWN}
    noted.shared |= {(type(row), row) for row in rows if type(row) in _SHARED}
    if new := [{"campaign_id": row.id} for row in session.new if isinstance(row, Campaign)]:
        session.execute(insert(CampaignReview), new)


def raise_revisions(session: Session) -> None:
    """Raise the revision of each campaign that was noted; called before the audit entries are chained."""
    noted: _Noted = session.info.pop("changes", _Noted())
    changed = noted.own
    if where := [_SHARED[kind](row) for kind, row in noted.shared]:
        changed |= set(session.scalars(select(Campaign.id).where(or_(*where))))
    if not changed:
        return
    chosen = CampaignReview.campaign_id.in_(changed)
    if len(changed) > 1:
        locked = select(CampaignReview.campaign_id).where(chosen).order_by(CampaignReview.campaign_id)
        session.execute(locked.with_for_update())
    # by the connection: to look what a session holds of them costs more than the statement
    raised = update(CampaignReview).where(chosen).values(revision=CampaignReview.revision + 1)
    returned = raised.returning(CampaignReview.campaign_id, CampaignReview.revision)
    revisions: dict[str, int] = {row[0]: row[1] for row in session.connection().execute(returned)}
    # an organisation's time zone holds for all frames
    if whole := noted.whole | (changed if any(kind is Organisation for kind, _ in noted.shared) else set()):
        themselves = update(CampaignReview).where(CampaignReview.campaign_id.in_(whole))
        session.execute(themselves.values(whole_revision=CampaignReview.revision))
    frames = noted.frames
    if described := noted.of_frames - frames.keys():
        found = select(FrameRow.id, FrameRow.campaign_id).where(FrameRow.id.in_(described))
        frames |= {row[0]: row[1] for row in session.execute(found)}
    stamps = [(frame, campaign, revisions[campaign]) for frame, campaign in sorted(frames.items())]
    stamp_frames(session, stamps)


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
