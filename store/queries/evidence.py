"""Everything a campaign has to offer to a fit, as the science wants it."""

from collections import Counter
from dataclasses import dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.findings import shared
from radiometry.fitting.evidence import Exclusion, FrameEvidence
from radiometry.frame.proof import Proof
from radiometry.frame.statistics import ChannelStatistics
from store.codec import decode, decode_exposure, decode_header
from store.queries.frames import extractions_of, extractor_of, region_ids, statistics_of
from store.queries.references import Reference, find_reference
from store.tables import Campaign, Extraction, FrameRow


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """Rows for the fit. ``names``: frame id to the fit's name of it; ``hashes``, ``rois``: by that name."""

    frames: list[Any]
    readings: list[Any]
    names: dict[str, str]
    hashes: dict[str, str]
    rois: dict[str, str]
    unread: list[str]
    """Frames of which nothing is known yet."""
    doubtful: tuple[Exclusion, ...]
    """Frames that no fit may use, with what is doubted in them."""
    references: dict[str, list[dict[str, Any]]]
    """What the readings were made with, as it is now: meters with their certificates, panels."""


def gather(session: Session, campaign: Campaign, *, applied: bool = False) -> Evidence:
    """Frames with the statistics of the region that holds for them now, and the readings that stand.

    ``applied``: those too that no fit sees, which are only judged and measured.
    """
    room = methods.get_method(campaign.method)
    roles = room.role_names | room.applied_role_names if applied else room.role_names
    rows = list(
        session.scalars(
            select(FrameRow)
            .where(FrameRow.campaign_id == campaign.id, FrameRow.state != "refused")
            .where(FrameRow.role.in_(roles))
        )
    )
    rows = [row for row in rows if shared.FRAME_LEFT_OUT not in row.warnings]
    rows.sort(key=lambda row: (row.filename, row.sha256))
    regions = region_ids(session, campaign, rows)
    current = _current_extractions(session, campaign, rows, regions)
    statistics = statistics_of(session, [extraction.id for extraction in current.values()])
    names = _names(rows)
    read = [row for row in rows if _is_read(row)]
    reference: Reference = find_reference(session, campaign, read)
    return Evidence(
        frames=[
            methods.get_method(campaign.method).make_row(
                _describe_frame(
                    campaign, row, names[row.id], regions[row.id], current.get(row.id), statistics
                ),
            )
            for row in read
        ],
        readings=reference.readings,
        names=names,
        hashes={names[row.id]: row.sha256 for row in read},
        rois={names[row.id]: current[row.id].roi_id for row in read if row.id in current},
        unread=[names[row.id] for row in rows if not _is_read(row)],
        doubtful=tuple(_doubt(row, names[row.id]) for row in read if shared.IMAGE_PART_EMPTY in row.warnings),
        references=reference.sources,
    )


def _doubt(row: FrameRow, name: str) -> Exclusion:
    doubt = decode(Proof, row.proof).describe_doubt(decode_header(row.header or {}))
    return Exclusion(frame=name, reason=doubt, by="stilb")


def _is_read(row: FrameRow) -> bool:
    """Whether a fit can be told of it: a chart may do without an exposure."""
    return row.header is not None and (row.exposure is not None or row.role == "chart")


def _names(rows: list[FrameRow]) -> dict[str, str]:
    """The file's name, with a piece of its hash where two files share one."""
    shared = Counter(row.filename for row in rows)
    return {
        row.id: row.filename if shared[row.filename] == 1 else f"{row.filename} ({row.sha256[:8]})"
        for row in rows
    }


def _current_extractions(
    session: Session, campaign: Campaign, rows: list[FrameRow], regions: dict[str, str | None]
) -> dict[str, Extraction]:
    current: dict[str, Extraction] = {}
    extractor = extractor_of(campaign)
    extractions = extractions_of(session, [row.id for row in rows])
    for row in rows:
        for extraction in extractions[row.id]:
            if extraction.roi_id == regions[row.id] and extraction.extractor == extractor:
                current[row.id] = extraction
    return current


def _describe_frame(
    campaign: Campaign,
    row: FrameRow,
    name: str,
    roi_id: str | None,
    extraction: Extraction | None,
    statistics: dict[str, list[ChannelStatistics]],
) -> FrameEvidence[Any]:
    room = methods.get_method(campaign.method)
    features = extraction.features if extraction else None
    return FrameEvidence(
        frame=name,
        role=row.role,
        scene=row.scene,
        header=decode_header(row.header or {}),
        exposure=decode_exposure(row.exposure) if row.exposure else None,
        statistics=tuple(statistics[extraction.id]) if extraction else None,
        features=decode(room.features, features) if room.features and features else None,
        has_region=roi_id is not None or room.whole_frame,
        identified=(row.found or {}).get("serial"),
    )
