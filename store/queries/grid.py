"""The frames of a campaign for its grid: columns, without an entity and without what no cell shows."""

from collections import defaultdict
from dataclasses import dataclass
from datetime import UTC
from typing import Any

from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from store.frame_times import find_time, read_zones
from store.queries.frames import extractor_of, region_ids
from store.tables import Campaign, ChannelRow, Extraction, FrameChange, FrameRow

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


@dataclass(frozen=True, slots=True)
class _Placed:
    """A frame as `region_ids` asks for it."""

    id: str
    roi_id: str | None
    size_px: tuple[int, int] | None


def read_grid(
    session: Session, campaign: Campaign, *, after: str, limit: int, since: int | None = None
) -> list[dict[str, Any]]:
    """Read a page of a campaign's frames in the order in which they came, withdrawn ones too.

    ``since`` : only those that have changed since this revision of the campaign.

    ``instant`` is None where the zone of the clock is not known, ``time_zone`` where none had to be stated;
    ``signal_dn`` is the mean of the green channels, else of all, in the region that holds for the frame;
    ``clipped_share`` that of the channel with the largest share of pixels at the white level; ``region_id``
    is the region that holds.
    """
    chosen = FrameRow.campaign_id == campaign.id
    if since is not None:
        newer = (FrameChange.campaign_id == campaign.id) & (FrameChange.revision > since)
        chosen &= FrameRow.id.in_(select(FrameChange.frame_id).where(newer))
    rows = session.execute(
        select(*(column.label(name) for name, column in COLUMNS.items()))
        .where(chosen, FrameRow.id > after)
        .order_by(FrameRow.id)
        .limit(limit)
    )
    frames = [dict(row._mapping) for row in rows]  # noqa: SLF001  the public name of a row's mapping
    if not frames:
        return frames
    placed = [
        _Placed(f["id"], f["roi_id"], (f["width_px"], f["height_px"]) if f["width_px"] else None)
        for f in frames
    ]
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
        found = frame.pop("found") or {}
        own = frame["roi_id"] is not None
        frame["roi_origin"] = (
            ("found" if found.get("roi_id") == frame["roi_id"] else "drawn") if own else None
        )
    return frames


def _read_signals(
    session: Session, campaign: Campaign, chosen: ColumnElement[bool]
) -> dict[tuple[str, str], tuple[float, float]]:
    """Signal and clipping of some frames, by frame and region."""
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
