"""Campaigns, regions, readings, manifests and crops, what has arrived, and the frames of the grid."""

import hashlib
import json
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC
from typing import Any, Final

from sqlalchemy import ColumnElement, Row, delete, func, literal_column, select, update
from sqlalchemy.orm import Session

from radiometry.findings import shared
from radiometry.fitting.evidence import Region
from radiometry.frame.roi import Polygon
from radiometry.records import Record, about
from store import jobs, tables
from store.queries import add
from store.queries.frame_times import find_time, read_zones
from store.queries.frames import Placed, extractor_of, region_ids
from store.tables import Blob, Campaign, ChannelRow, Crop, Extraction, FrameRow, Job, Manifest, Reading, Roi
from store.tables.base import new_id

RENEWAL_LANE: Final = "renewal"  # of frames that are read again in the background
_HASTENED: Final = 100
_FEW = 500  # jobs that are read at once to find those of one campaign


class Counts(Record):
    received: int = about("All frames of the campaign.")
    being_read: int = about("Frames with a job that waits or runs.")
    extracted: int
    refused: int
    readings: int


def count(session: Session, campaign: Campaign) -> Counts:
    counted = select(FrameRow.state, func.count()).group_by(FrameRow.state)
    rows = session.execute(counted.where(FrameRow.standing(campaign.id)))
    states = {row[0]: row[1] for row in rows}
    readings = session.scalar(select(func.count()).where(Reading.standing(campaign.id)))
    return Counts(
        received=sum(states.values()),
        being_read=count_being_read(session, campaign),
        extracted=states.get("extracted", 0),
        refused=states.get("refused", 0),
        readings=readings or 0,
    )


def count_measured(session: Session, campaign: Campaign) -> int:
    measured = select(func.count(tables.Measurement.frame_id.distinct()))
    return session.scalar(measured.where(tables.Measurement.campaign_id == campaign.id)) or 0


def count_being_read(session: Session, campaign: Campaign) -> int:
    """Frames of which more will be known without anybody doing anything."""
    # the condition as its index has it, in the index's order: SQLite would read every job that waits
    waits = Job.state.in_([literal_column("'queued'"), literal_column("'running'")])
    mine = Job.organisation_id == campaign.organisation_id
    live = waits & (Job.kind == literal_column("'extract'")) & mine
    few = session.scalars(select(Job.subject_id).where(live).order_by(Job.subject_id).limit(_FEW + 1)).all()
    # a long queue is not read for each campaign: each of its frames is then looked up
    each = select(Job.id).where(Job.subject_id == FrameRow.id, live).exists()
    busy = FrameRow.id.in_(few) if len(few) <= _FEW else each
    return session.scalar(select(func.count()).where(FrameRow.campaign_id == campaign.id, busy)) or 0


class Drawing(Record):
    """A region as it was drawn: one polygon, or several parts with names and the rectangle around them."""

    polygon: Polygon
    corners: Sequence[Sequence[float]]
    parts: Sequence[Region] = ()

    @classmethod
    def of_parts(cls, parts: Sequence[Region]) -> "Drawing":
        xs, ys = zip(*(point for part in parts for point in part.polygon.points), strict=True)
        corners = [[min(xs), min(ys)], [max(xs), min(ys)], [max(xs), max(ys)], [min(xs), max(ys)]]
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
    if found is not None:
        return found
    parts = [{"name": part.name, "points": [list(p) for p in part.polygon.points]} for part in drawing.parts]
    row = Roi(id=new_id("roi"), organisation_id=organisation_id, sha256=drawing.sha256, parts=parts or None)
    row.points = [list(corner) for corner in drawing.corners]
    return add(session, row)


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
    read = (FrameRow.campaign_id == campaign.id) & FrameRow.state.in_(("read", "extracted"))
    rows = session.execute(select(width, height).where(read, FrameRow.roi_id.is_(None)).distinct())
    sizes = sorted((row[0], row[1]) for row in rows)
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
    """Jobs that compute a campaign's frames, refused ones too; ``own_region``: also those with their own."""
    wanted = select(FrameRow).where(FrameRow.standing(campaign.id))
    if not own_region:
        wanted = wanted.where(FrameRow.roi_id.is_(None))
    frames = session.scalars(wanted.order_by(FrameRow.id))
    return [renew_extraction(session, frame, campaign.organisation_id, by=by) for frame in frames]


def check_again(session: Session, campaign: Campaign, *, by: str) -> list[Job]:
    """Jobs that hold every frame against the campaign's camera, refused ones too; what was computed stays."""
    found = session.scalars(select(FrameRow).where(FrameRow.standing(campaign.id)).order_by(FrameRow.id))
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


_HEADER = FrameRow.header
COLUMNS = {
    **{
        name: getattr(FrameRow, name)
        for name in (
            *("id", "filename", "role", "scene", "state", "exposure_time_s", "f_number", "iso", "roi_id"),
            *("left_out", "withdrawn_at", "refusal_code", "preview_sha256"),
        )
    },
    "width_px": _HEADER["width_px"].as_integer(),
    "height_px": _HEADER["height_px"].as_integer(),
    "taken_at": _HEADER["taken_at"].as_string(),
    "band": _HEADER["multispectral"]["band"].as_string(),
    "system": _HEADER["multispectral"]["system"].as_string(),
    "capture_id": _HEADER["multispectral"]["capture_id"].as_string(),
    "found": FrameRow.found,
}
_GREEN = frozenset({"G", "G1", "G2"})


def read_grid(
    session: Session, campaign: Campaign, *, after: str, limit: int, since: int | None = None
) -> list[dict[str, Any]]:
    """Read a page of a campaign's frames in the order in which they came, withdrawn ones too.

    ``since``: those alone that have changed since this revision. ``instant`` is None where the zone of the
    clock is not known, ``time_zone`` where none had to be stated; signals are those of the region that holds.
    """
    chosen = FrameRow.campaign_id == campaign.id
    if since is not None:
        newer = (tables.FrameChange.campaign_id == campaign.id) & (tables.FrameChange.revision > since)
        chosen &= FrameRow.id.in_(select(tables.FrameChange.frame_id).where(newer))
    columns = select(*(column.label(name) for name, column in COLUMNS.items()))
    rows = session.execute(columns.where(chosen, FrameRow.id > after).order_by(FrameRow.id).limit(limit))
    frames = [dict(row._mapping) for row in rows]  # noqa: SLF001  the public name of a row's mapping
    if not frames:
        return frames
    sizes = [(f["width_px"], f["height_px"]) if f["width_px"] else None for f in frames]
    placed = [Placed(f["id"], f["roi_id"], size) for f, size in zip(frames, sizes, strict=True)]
    regions = region_ids(session, campaign, placed)
    within = chosen & FrameRow.id.between(frames[0]["id"], frames[-1]["id"])
    measured, zones = _read_signals(session, campaign, within), read_zones(session, campaign)
    for frame in frames:
        region = frame["region_id"] = regions[frame["id"]]
        frame["signal_dn"], frame["clipped_share"] = measured.get((frame["id"], region or ""), (None, None))
        taken = find_time(frame["taken_at"], zones, system=frame.pop("system"))
        read = taken is not None and (taken.is_known or taken.zone is not None)
        frame["instant"] = taken.earliest.astimezone(UTC) if taken and read else None
        frame["time_zone"] = taken.zone if taken else None
        origin = "found" if (frame.pop("found") or {}).get("roi_id") == frame["roi_id"] else "drawn"
        frame["roi_origin"] = None if frame["roi_id"] is None else origin
    return frames


def _read_signals(
    session: Session, campaign: Campaign, chosen: ColumnElement[bool]
) -> dict[tuple[str, str], tuple[float, float]]:
    rows: Any = session.execute(
        select(
            *(Extraction.frame_id, Extraction.roi_id),
            *(ChannelRow.channel, ChannelRow.mean_dn, ChannelRow.saturated_share),
        )
        .join(Extraction, Extraction.id == ChannelRow.extraction_id)
        .join(FrameRow, FrameRow.id == Extraction.frame_id)
        .where(chosen, Extraction.extractor == extractor_of(campaign))
    )
    means: dict[tuple[str, str], dict[str, float]] = defaultdict(dict)
    clipped: dict[tuple[str, str], float] = defaultdict(float)
    for frame_id, roi_id, channel, mean_dn, share in rows:
        key = (frame_id, roi_id)
        means[key][channel] = mean_dn
        clipped[key] = max(clipped[key], share)
    return {key: (_average(by_channel), clipped[key]) for key, by_channel in means.items()}


def _average(by_channel: dict[str, float]) -> float:
    used = [mean for name, mean in by_channel.items() if name in _GREEN] or list(by_channel.values())
    return sum(used) / len(used)


MOST_KEPT: Final = 32  # of an organisation: with the largest crop there is they take 32 MiB of the database


def say_asked(window: Sequence[int], low_dn: float | None, high_dn: float | None) -> str:
    return " ".join(map(str, (*window, low_dn, high_dn)))


def find_crop_job(session: Session, frame: FrameRow, asked: str) -> Job | None:
    """Return the job that drew what is asked for, while its picture is kept and its file is whole."""
    drawn = select(Job).join(Crop, Crop.job_id == Job.id).join(Blob, Blob.sha256 == frame.sha256)
    kept = drawn.where(Crop.frame_id == frame.id, Crop.asked == asked, Blob.damage.is_(None))
    return session.scalar(kept.order_by(Crop.id.desc()).limit(1))


def keep_crop(session: Session, crop: Crop) -> None:
    """Add a crop, and delete the oldest of its organisation beyond the most that are kept."""
    add(session, crop)
    owns = Crop.organisation_id == crop.organisation_id
    last = session.scalar(select(Crop.id).where(owns).order_by(Crop.id.desc()).offset(MOST_KEPT).limit(1))
    if last is not None:
        session.execute(delete(Crop).where(owns, Crop.id <= last))


def find_known(session: Session, campaign: Campaign, hashes: Sequence[str]) -> dict[str, FrameRow]:
    """The campaign's frames with these bytes, by hash; a withdrawn one is restored when it is sent again."""
    rows = select(FrameRow).where(FrameRow.standing(campaign.id), FrameRow.sha256.in_(set(hashes)))
    return {frame.sha256: frame for frame in session.scalars(rows)}


def find_known_anywhere(session: Session, organisation_id: str, hashes: Sequence[str]) -> list[FrameRow]:
    """Every frame of an organisation with these bytes, in the order in which they came."""
    frames = select(FrameRow).join(Campaign, Campaign.id == FrameRow.campaign_id).order_by(FrameRow.id)
    mine = (Campaign.organisation_id == organisation_id) & FrameRow.sha256.in_(set(hashes))
    return list(session.scalars(frames.where(mine)))


def read_sizes(session: Session, hashes: Iterable[str]) -> dict[str, int]:
    rows = session.execute(select(Blob.sha256, Blob.size_bytes).where(Blob.sha256.in_(set(hashes))))
    return {row[0]: row[1] for row in rows}


def write_canonical(value: object) -> bytes:
    """Return text, integers, lists, and objects with names in ASCII, as RFC 8785 spells them."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False).encode()


def find_manifest(session: Session, campaign: Campaign, manifest_id: str | None) -> Manifest | None:
    rows = select(Manifest).where(Manifest.campaign_id == campaign.id)
    if manifest_id is not None:
        rows = rows.where(Manifest.id == manifest_id)
    return session.scalar(rows.order_by(Manifest.id.desc()).limit(1))


def read_stored(session: Session, campaign_id: str, hashes: set[str]) -> Mapping[str, Row[Any]]:
    """Return the campaign's frames with these bytes and their files, withdrawn and refused ones included."""
    rows = session.execute(
        select(
            *(FrameRow.sha256, FrameRow.state, FrameRow.refusal_code, FrameRow.withdrawn_at, Blob.size_bytes),
            *(FrameRow.id.label("frame_id"), FrameRow.created_at.label("received_at")),
            Blob.proven_at.label("hash_checked_at"),
        )
        .join(Blob, Blob.sha256 == FrameRow.sha256)
        .where(FrameRow.campaign_id == campaign_id)
    )
    found: list[Row[Any]] = list(rows)  # type: ignore[arg-type]
    return {row.sha256: row for row in found if row.sha256 in hashes}
