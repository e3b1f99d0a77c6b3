"""Frames and the statistics that were computed of them."""

import hashlib
import json
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any, Protocol

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.findings import interface
from radiometry.frame.roi import Polygon
from radiometry.frame.statistics import ChannelStatistics
from radiometry.specification.roles import FIELD
from store import jobs
from store.blobs import StoredBlob
from store.columns import new_id
from store.database import read_plainly
from store.errors import Conflict
from store.files import keep_blobs
from store.software import EXTRACTOR
from store.tables import Campaign, ChannelRow, Extraction, FrameRow, Roi
from store.tables.base import Json

_STATISTICS = tuple(field.name for field in fields(ChannelStatistics))


class Sized(Protocol):
    """A frame, as an entity or in columns."""

    @property
    def id(self) -> str: ...
    @property
    def roi_id(self) -> str | None: ...
    @property
    def size_px(self) -> tuple[int, int] | None: ...


@dataclass(frozen=True, kw_only=True)
class NewFrame:
    """A frame as it was uploaded: what the field team says of it."""

    blob: StoredBlob
    filename: str
    role: str
    scene: str | None
    roi_id: str | None
    supplied: dict[str, float]


def require_role(campaign: Campaign, role: str) -> None:
    """Refuse every role but that of field frames in a night of measurements."""
    if campaign.measures and role != FIELD.name:
        raise Conflict(
            interface.MEASUREMENTS_ONLY,
            f"A {role} frame does not belong in a night of measurements, whose frames have the role "
            f"{FIELD.name}. Send it to a campaign of the kind calibration.",
        )


def find_or_add_frames(
    session: Session, arrived: Sequence[tuple[Campaign, NewFrame]]
) -> list[tuple[FrameRow, bool, bool]]:
    """The campaign's frame with these bytes; whether it is new; whether it is to be read (again).

    The same bytes again change nothing, except that a withdrawn frame is restored, a refused one gets another
    chance, and one whose reading was given up is read again.
    """
    # no frame has a file that is new
    stored = {new.blob.sha256 for _, new in arrived} - keep_blobs(session, [new.blob for _, new in arrived])
    campaigns = {campaign.id for campaign, _ in arrived}
    rows = select(FrameRow).where(FrameRow.campaign_id.in_(campaigns), FrameRow.sha256.in_(stored))
    known = {(row.campaign_id, row.sha256): row for row in (session.scalars(rows) if stored else ())}
    frames = []
    for campaign, new in arrived:
        key = campaign.id, new.blob.sha256
        if key in known:
            frames.append(_find_again(session, known[key], new))
            continue
        known[key] = FrameRow(
            id=new_id("frm"),
            campaign_id=campaign.id,
            sha256=new.blob.sha256,
            filename=new.filename,
            role=new.role,
            scene=new.scene,
            roi_id=new.roi_id,
            supplied=new.supplied,
            state="received",
        )
        session.add(known[key])
        frames.append((known[key], True, True))
    session.flush()
    return frames


def _find_again(session: Session, found: FrameRow, new: NewFrame) -> tuple[FrameRow, bool, bool]:
    found.withdrawn_at, withdrawn = None, found.withdrawn_at
    if withdrawn:
        return found, False, True
    if found.state != "refused":
        return found, False, found.state == "received" and not jobs.is_live(session, found.id)
    said = {"role": new.role, "scene": new.scene, "supplied": {**found.supplied, **new.supplied}}
    again = describe_anew(found, said | ({"roi_id": new.roi_id} if new.roi_id else {}))
    return found, False, again


def describe_anew(frame: FrameRow, values: dict[str, Any]) -> bool:
    """Correct what was said of a frame; whether that means reading it again."""
    changed = [name for name, value in values.items() if getattr(frame, name) != value]
    for name in changed:
        setattr(frame, name, values[name])
    if "role" in changed and frame.found and frame.roi_id == frame.found.get("roi_id"):
        # nobody drew it, and what else the frame shows is not in it
        frame.roi_id = None
    return bool(changed)


def extractor_of(campaign: Campaign) -> str:
    """Return what makes this campaign's extractions: the code, its method, and the target it was given."""
    return name_extractor(campaign.method, campaign.target)


def is_told(campaign: Campaign) -> bool:
    """Return True if the target is stated, where the method must know it."""
    return campaign.target is not None or methods.get_method(campaign.method).target is None


def name_extractor(method: str, target: Json | None) -> str:
    if methods.get_method(method).features is None:
        return EXTRACTOR
    text = json.dumps(target, sort_keys=True) if target else ""
    told = f"+{hashlib.sha256(text.encode()).hexdigest()[:16]}" if text else ""
    return f"{EXTRACTOR}+{method}{told}"


def current_roi(session: Session, frame: FrameRow, campaign: Campaign) -> Roi | None:
    """The region that holds for a frame now: its own, else the campaign's, else perhaps the whole frame."""
    roi_id = region_ids(session, campaign, [frame])[frame.id]
    return session.get_one(Roi, roi_id) if roi_id else None


def region_ids(session: Session, campaign: Campaign, frames: Iterable["Sized"]) -> dict[str, str | None]:
    """The region that holds for each frame now, by the frame's id; None where there is none yet."""
    ids = {frame.id: frame.roi_id or campaign.roi_id for frame in frames}
    if campaign.roi_id is not None or not methods.get_method(campaign.method).whole_frame:
        return ids
    sizes = {frame.id: frame.size_px for frame in frames if frame.size_px is not None}
    hashes = {size: whole_frame(*size).sha256 for size in set(sizes.values())}
    keys = {frame_id: hashes[size] for frame_id, size in sizes.items()}
    if not keys:
        return ids
    rois = session.execute(
        select(Roi.sha256, Roi.id).where(
            Roi.organisation_id == campaign.organisation_id, Roi.sha256.in_(set(keys.values()))
        )
    )
    found: dict[str, str] = {row[0]: row[1] for row in rois}
    return {frame_id: roi_id or found.get(keys.get(frame_id, "")) for frame_id, roi_id in ids.items()}


def whole_frame_of(frame: FrameRow) -> Polygon:
    """The region that is all of a frame that has been read."""
    assert frame.size_px is not None  # noqa: S101  it has been read
    return whole_frame(*frame.size_px)


@lru_cache(256)
def whole_frame(width_px: int, height_px: int) -> Polygon:
    return Polygon.from_points([(0, 0), (width_px, 0), (width_px, height_px), (0, height_px)])


def find_extraction(session: Session, frame: FrameRow, roi: Roi, extractor: str) -> Extraction | None:
    return session.scalar(
        select(Extraction).where(
            Extraction.frame_id == frame.id, Extraction.roi_id == roi.id, Extraction.extractor == extractor
        )
    )


def find_equal_extraction(session: Session, frame: FrameRow, roi: Roi, extractor: str) -> Extraction | None:
    """Return what the same code has already computed from the same bytes in the same region."""
    return session.scalar(
        select(Extraction)
        .join(FrameRow, FrameRow.id == Extraction.frame_id)
        .where(FrameRow.sha256 == frame.sha256, Extraction.roi_id == roi.id)
        .where(Extraction.extractor == extractor)
        .limit(1)
    )


def add_extraction(
    session: Session,
    frame: FrameRow,
    roi: Roi,
    extractor: str,
    *,
    rows: list[dict[str, Any]],
    features: dict[str, Any] | None,
) -> None:
    extraction = Extraction(
        id=new_id("ext"), frame_id=frame.id, roi_id=roi.id, extractor=extractor, features=features
    )
    session.add(extraction)
    session.flush()
    session.add_all([ChannelRow(extraction_id=extraction.id, **row) for row in rows])
    session.flush()


def statistics_of(
    session: Session, extraction_ids: Collection[str] | Select[Any]
) -> dict[str, list[ChannelStatistics]]:
    """The statistics of each extraction, channels in alphabetical order."""
    found: dict[str, list[ChannelStatistics]] = defaultdict(list)
    # rows as the driver has them: a campaign of ten thousand frames has four times as many
    rows = read_plainly(
        session,
        select(ChannelRow.extraction_id, *(getattr(ChannelRow, name) for name in _STATISTICS))
        .where(ChannelRow.extraction_id.in_(extraction_ids))
        .order_by(ChannelRow.extraction_id, ChannelRow.channel),
    )
    for extraction_id, *values in rows:
        found[extraction_id].append(ChannelStatistics(**dict(zip(_STATISTICS, values, strict=True))))
    return found


def extractions_of(session: Session, frame_ids: list[str]) -> dict[str, list[Extraction]]:
    """Every extraction of each frame, oldest first."""
    found: dict[str, list[Extraction]] = defaultdict(list)
    rows = session.scalars(
        select(Extraction).where(Extraction.frame_id.in_(frame_ids)).order_by(Extraction.id)
    )
    for row in rows:
        found[row.frame_id].append(row)
    return found
