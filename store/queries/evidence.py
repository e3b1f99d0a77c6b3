"""Everything a campaign has to offer to a fit, as the science wants it."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.findings import shared
from radiometry.fitting.evidence import Exclusion, FrameEvidence
from radiometry.frame import FrameHeader
from radiometry.specification.method import MethodSpec
from store.frame_times import Zones, find_offset, read_zones
from store.queries.frame_columns import (
    ExtractionColumns,
    FrameColumns,
    list_outdated,
    read_extractions,
    read_frames,
)
from store.queries.frames import region_ids
from store.queries.memory import Memory
from store.queries.references import Reference, find_reference
from store.tables import Campaign


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """Rows for the fit. ``names``: frame id to the fit's name of it; the others: by that name."""

    frames: list[Any]
    readings: list[Any]
    names: dict[str, str]
    hashes: dict[str, str]
    headers: dict[str, FrameHeader]
    offsets: dict[str, str]
    """Of clocks that state none, in the zone stated for them; only of methods with readings."""
    rois: dict[str, str]
    unread: list[str]
    """Frames of which nothing is known yet."""
    outdated: list[str]
    """Ids of frames whose statistics are of an earlier extractor or another target: they are read again."""
    doubtful: tuple[Exclusion, ...]
    """Frames that no fit may use: those that a person left out, and those whose pixels are doubtful."""
    references: dict[str, list[dict[str, Any]]]
    """What the readings were made with, as it is now: meters with their certificates, panels."""


def gather(
    session: Session,
    campaign: Campaign,
    *,
    applied: bool = False,
    frames: Sequence[FrameColumns] | None = None,
    memory: Memory | None = None,
) -> Evidence:
    """Frames with the statistics of the region that holds for them now, and the readings that stand.

    ``applied``: those too that no fit sees, which are only judged and measured. ``frames``: all of the
    campaign, where they have been read.
    """
    spec = methods.get_method(campaign.method)
    roles = spec.role_names | spec.applied_role_names if applied else spec.role_names
    rows = [
        row
        for row in frames or read_frames(session, campaign)
        if row.role in roles and row.state != "refused" and shared.FRAME_LEFT_OUT not in row.warnings
    ]
    rows.sort(key=lambda row: (row.filename, row.sha256))
    regions = region_ids(session, campaign, rows)
    current = read_extractions(session, campaign, regions, memory=memory)
    names = _names(rows)
    read = [row for row in rows if _is_read(row)]
    reference: Reference = find_reference(session, campaign, read)
    zones = read_zones(session, campaign) if spec.reference else Zones()
    offsets = {row.id: offset for row in read if (offset := find_offset(row.header, zones))}
    return Evidence(
        frames=[
            row.keep("row", given, partial(_make_row, spec, row, *given))
            for row in read
            for given in (
                (
                    *(names[row.id], current.get(row.id)),
                    *(spec.whole_frame or regions[row.id] is not None, offsets.get(row.id)),
                ),
            )
        ],
        readings=reference.readings,
        names=names,
        hashes={names[row.id]: row.sha256 for row in read},
        headers={names[row.id]: row.header for row in read if row.header},
        offsets={names[frame_id]: offset for frame_id, offset in offsets.items()},
        rois={names[row.id]: current[row.id].roi_id for row in read if row.id in current},
        unread=[names[row.id] for row in rows if not _is_read(row)],
        outdated=list_outdated(session, campaign, regions, current),
        doubtful=tuple(
            Exclusion(
                frame=names[row.id], **(row.left_out or {"reason": row.describe_doubt(), "by": "stilb"})
            )
            for row in read
            if row.left_out or shared.IMAGE_PART_EMPTY in row.warnings
        ),
        references=reference.sources,
    )


def _is_read(row: FrameColumns) -> bool:
    """Return True if a frame can enter a fit: a chart may do without an exposure."""
    return row.header is not None and (row.exposure is not None or row.role == "chart")


def _names(rows: list[FrameColumns]) -> dict[str, str]:
    """The file's name, with a piece of its hash where two files share one."""
    shared = Counter(row.filename for row in rows)
    return {
        row.id: row.filename if shared[row.filename] == 1 else f"{row.filename} ({row.sha256[:8]})"
        for row in rows
    }


def _make_row(
    spec: MethodSpec,
    row: FrameColumns,
    name: str,
    extraction: ExtractionColumns | None,
    has_region: bool,  # noqa: FBT001  given in order
    clock_offset: str | None,
) -> Any:  # noqa: ANN401  the method's own
    assert row.header is not None  # noqa: S101  it has been read
    return spec.make_row(
        FrameEvidence(
            frame=name,
            role=row.role,
            scene=row.scene,
            header=replace(row.header, clock_offset=clock_offset) if clock_offset else row.header,
            exposure=row.exposure,
            statistics=extraction.statistics if extraction else None,
            features=extraction.features if extraction else None,
            has_region=has_region,
            identified=row.found.get("serial"),
        )
    )
