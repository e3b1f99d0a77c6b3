"""Campaigns, regions, readings, and what has arrived of them."""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import func, literal_column, select, update
from sqlalchemy.orm import Session

from radiometry.findings import shared
from radiometry.fitting.evidence import Region
from radiometry.frame.roi import Polygon
from store import jobs
from store.columns import new_id
from store.tables import Campaign, FrameRow, Job, Measurement, Reading, Roi

RENEWAL_LANE: Final = "renewal"
"""Of frames that are read again in the background."""
_HASTENED: Final = 100
_FEW = 500
"""Jobs that are read at once to find those of one campaign."""


@dataclass(frozen=True, kw_only=True)
class Counts:
    """How many frames and readings a campaign has.

    Attributes
    ----------
    received : int
        All frames of the campaign.
    being_read : int
        Frames with a job that waits or runs.
    """

    received: int
    being_read: int
    extracted: int
    refused: int
    readings: int


def count(session: Session, campaign: Campaign) -> Counts:
    """Count what has arrived, and how far it has come."""
    rows = session.execute(
        select(FrameRow.state, func.count())
        .where(FrameRow.campaign_id == campaign.id, FrameRow.withdrawn_at.is_(None))
        .group_by(FrameRow.state)
    )
    states = {row[0]: row[1] for row in rows}
    readings = session.scalar(
        select(func.count()).where(Reading.campaign_id == campaign.id, Reading.withdrawn_at.is_(None))
    )
    return Counts(
        received=sum(states.values()),
        being_read=count_being_read(session, campaign),
        extracted=states.get("extracted", 0),
        refused=states.get("refused", 0),
        readings=readings or 0,
    )


def count_measured(session: Session, campaign: Campaign) -> int:
    """Count the frames of a campaign that have a measurement."""
    measured = select(func.count(Measurement.frame_id.distinct()))
    return session.scalar(measured.where(Measurement.campaign_id == campaign.id)) or 0


def count_being_read(session: Session, campaign: Campaign) -> int:
    """Frames of which more will be known without anybody doing anything."""
    # the condition as its index has it, in the index's order: SQLite would read every job that waits
    waits = Job.state.in_([literal_column("'queued'"), literal_column("'running'")])
    live = (
        waits & (Job.kind == literal_column("'extract'")) & (Job.organisation_id == campaign.organisation_id)
    )
    few = session.scalars(select(Job.subject_id).where(live).order_by(Job.subject_id).limit(_FEW + 1)).all()
    # a long queue is not read for each campaign: each of its frames is then looked up
    busy = (
        FrameRow.id.in_(few)
        if len(few) <= _FEW
        else select(Job.id).where(Job.subject_id == FrameRow.id, live).exists()
    )
    return session.scalar(select(func.count()).where(FrameRow.campaign_id == campaign.id, busy)) or 0


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """A region as it was drawn: one polygon, or several parts with their names and the rectangle around them.

    ``corners`` : as they were given, in their order
    """

    polygon: Polygon
    corners: Sequence[Sequence[float]]
    parts: Sequence[Region] = ()

    @classmethod
    def of_parts(cls, parts: Sequence[Region]) -> "Drawing":
        xs, ys = zip(*(point for part in parts for point in part.polygon.points), strict=True)
        corners = [
            [min(xs), min(ys)],
            [max(xs), min(ys)],
            [max(xs), max(ys)],
            [min(xs), max(ys)],
        ]
        return cls(polygon=Polygon.from_points(corners), corners=corners, parts=parts)

    @property
    def sha256(self) -> str:
        """Equal for every way of writing the same region."""
        if not self.parts:
            return self.polygon.sha256
        texts = sorted(f"{part.name}: {part.polygon.text}" for part in self.parts)
        return hashlib.sha256("; ".join(texts).encode()).hexdigest()


def find_or_add_roi(session: Session, organisation_id: str, drawing: Drawing) -> Roi:
    """The region with exactly these corners, which are kept in the order in which they were first given."""
    found = session.scalar(
        select(Roi).where(Roi.organisation_id == organisation_id, Roi.sha256 == drawing.sha256)
    )
    if found is None:
        parts = [
            {"name": part.name, "points": [list(p) for p in part.polygon.points]} for part in drawing.parts
        ]
        found = Roi(
            id=new_id("roi"),
            organisation_id=organisation_id,
            sha256=drawing.sha256,
            points=[list(corner) for corner in drawing.corners],
            parts=parts or None,
        )
        session.add(found)
        session.flush()
    return found


def set_roi(session: Session, campaign: Campaign, roi: Roi, *, by: str) -> list[Job]:
    """Set the region of a campaign; return the jobs that recompute each frame without its own region."""
    if campaign.roi_id == roi.id:
        return []
    _refuse_outside(session, campaign, roi)
    campaign.roi_id = roi.id
    session.flush()
    return renew_extractions(session, campaign, by=by, own_region=False)


def _refuse_outside(session: Session, campaign: Campaign, roi: Roi) -> None:
    """Refuse a region that fits in no frame that has been read and has none of its own."""
    width, height = (FrameRow.header[name].as_integer() for name in ("width_px", "height_px"))
    read = select(width, height).where(
        FrameRow.campaign_id == campaign.id,
        FrameRow.state.in_(("read", "extracted")),
        FrameRow.roi_id.is_(None),
    )
    sizes = sorted((row[0], row[1]) for row in session.execute(read.distinct()))
    xs, ys = zip(*roi.points, strict=True)
    inside = min(*xs, *ys) >= 0
    if not sizes or (inside and any(max(xs) <= size[0] and max(ys) <= size[1] for size in sizes)):
        return
    said = " or ".join(f"{width_px} x {height_px}" for width_px, height_px in sizes)
    raise shared.ROI_OUTSIDE_FRAME.refuse(
        f"The region goes from x {min(xs):g}, y {min(ys):g} to x {max(xs):g}, y {max(ys):g}; the frames of "
        f"this campaign have {said} pixels."
    )


def renew_extractions(session: Session, campaign: Campaign, *, by: str, own_region: bool = True) -> list[Job]:
    """Jobs that recompute a campaign's frames; ``own_region``: also those with a region of their own."""
    wanted = select(FrameRow).where(FrameRow.campaign_id == campaign.id, FrameRow.state != "refused")
    wanted = wanted.where(FrameRow.withdrawn_at.is_(None))
    if not own_region:
        wanted = wanted.where(FrameRow.roi_id.is_(None))
    frames = session.scalars(wanted.order_by(FrameRow.id))
    return [renew_extraction(session, frame, campaign.organisation_id, by=by) for frame in frames]


def check_again(session: Session, campaign: Campaign, *, by: str) -> list[Job]:
    """Jobs that hold every frame against the campaign's camera, refused ones too; what was computed stays."""
    frames = select(FrameRow).where(FrameRow.campaign_id == campaign.id, FrameRow.withdrawn_at.is_(None))
    found = session.scalars(frames.order_by(FrameRow.id))
    return [jobs.enqueue_extraction(session, frame, campaign.organisation_id, by=by) for frame in found]


def renew_extraction(
    session: Session, frame: FrameRow, organisation_id: str, *, by: str, lane: str | None = None
) -> Job:
    """As enqueue_extraction, for a frame whose statistics no longer are those of its region."""
    if frame.state == "extracted":
        frame.state = "read"
    return jobs.enqueue_extraction(session, frame, organisation_id, by=by, lane=lane)


def hasten_renewal(session: Session, campaign: Campaign, frame_ids: Sequence[str], *, by: str) -> list[Job]:
    """Have outdated frames read before those of other campaigns; return the jobs of the first of them."""
    some = frame_ids[:_HASTENED]
    waiting = (Job.subject_id.in_(some)) & (Job.state == "queued") & (Job.lane == RENEWAL_LANE)
    session.execute(update(Job).where(waiting).values(lane="extract"))
    return [
        renew_extraction(session, session.get_one(FrameRow, frame_id), campaign.organisation_id, by=by)
        for frame_id in some
        if not jobs.is_live(session, frame_id)
    ]


def add_readings(session: Session, campaign: Campaign, values: Iterable[dict[str, Any]]) -> list[Reading]:
    rows = [Reading(id=new_id("rdg"), campaign_id=campaign.id, **value) for value in values]
    session.add_all(rows)
    session.flush()
    return rows
