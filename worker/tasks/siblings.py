"""Panels that were found in one band of a capture, for the bands in which they were not."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.findings import InputRejected
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.roi import Polygon
from radiometry.specification.application import FoundBy
from store.blobs.proof import BlobDamaged
from store.codec import decode_header
from store.jobs import enqueue_extraction
from store.queries.usage import add_jobs
from store.tables import Campaign, FrameRow, Roi
from worker.context import Context
from worker.decode.pool import DecoderCrashed

_CAPTURE = ("multispectral", "capture_id")
_ACTOR = "sweeper"


@dataclass(frozen=True, kw_only=True)
class TakenRegion:
    """The region of a panel in this band; ``serial`` : as read in the other."""

    region: Polygon
    serial: str | None
    by: FoundBy = "other_band"

    def read_albedo(self, wavelength_nm: float | None) -> float | None:
        """None: what the code states is read in the other band."""


def list_siblings(
    session: Session, campaign: Campaign, frame_id: str, header: FrameHeader, *, found: bool
) -> Sequence[FrameRow]:
    """The other bands of a frame's capture: those in which the panel was found, or those without a region."""
    capture = header.multispectral.capture_id if header.multispectral else None
    spec = methods.get_method(campaign.method)
    if capture is None or not spec.finds_region:
        return []
    rows = session.scalars(
        select(FrameRow)
        .where(FrameRow.campaign_id == campaign.id, FrameRow.id != frame_id)
        .where(FrameRow.withdrawn_at.is_(None))
        .where(FrameRow.role.in_(spec.role_names), FrameRow.state.in_(("read", "extracted")))
        .where(FrameRow.header[_CAPTURE].as_string() == capture)
        .order_by(FrameRow.id)
    ).all()
    return [row for row in rows if (_has_found(row) if found else row.roi_id is None)]


def _has_found(row: FrameRow) -> bool:
    found = row.found or {}
    return row.roi_id is not None and found.get("roi_id") == row.roi_id and found.get("by") != "other_band"


def take_region(
    context: Context, campaign: Campaign, frame_id: str, frame: Frame, header: FrameHeader
) -> tuple[TakenRegion | None, int]:
    """Find a panel where other bands of the capture show it; and how many of those there were."""
    spec = methods.get_method(campaign.method)
    best: tuple[float, TakenRegion | None] = (0.0, None)
    with context.database.reading() as session:
        others = [
            (row.sha256, decode_header(row.header or {}), session.get_one(Roi, row.roi_id), row.found or {})
            for row in list_siblings(session, campaign, frame_id, header, found=True)
        ]
    for sha256, other_header, roi, found in others:
        try:
            with context.files.local(sha256) as file:
                window = (0, 0, other_header.height_px, other_header.width_px)
                other = context.decoders.read_window(file, window)
        except (BlobDamaged, DecoderCrashed, InputRejected):
            continue  # what is wrong with that file is said of it, not of this one
        region = Polygon.from_points(roi.points)
        taken = spec.take_region(frame, header=header, other=other, other_header=other_header, region=region)
        if taken is not None and taken[1] > best[0]:
            best = (taken[1], TakenRegion(region=taken[0], serial=found.get("serial")))
    return best[1], len(others)


def ask_siblings(
    session: Session, campaign: Campaign, frame: FrameRow, header: FrameHeader, *, considered: int
) -> None:
    """Have the bands that still lack a region read again, once this or another one shows where it is."""
    if campaign.roi_id is not None or frame.role not in methods.get_method(campaign.method).role_names:
        return
    # two bands that are stored at once must not miss one another
    session.refresh(campaign, with_for_update=True)
    waiting: Sequence[Any] = []
    if _has_found(frame):
        waiting = list_siblings(session, campaign, frame.id, header, found=False)
    elif frame.roi_id is None:
        later = len(list_siblings(session, campaign, frame.id, header, found=True)) > considered
        waiting = [frame] if later else []
    for each in waiting:
        enqueue_extraction(session, each, campaign.organisation_id, by=_ACTOR)
    if waiting:
        add_jobs(session, len(waiting), organisation_id=campaign.organisation_id)
