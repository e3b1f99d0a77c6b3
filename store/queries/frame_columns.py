"""A campaign's frames in columns: each is read once, without an entity and without what no judge needs."""

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from sqlalchemy import Text, cast, select, true
from sqlalchemy.orm import InstrumentedAttribute, Session

from radiometry import methods
from radiometry.findings import shared
from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.proof import Proof
from radiometry.frame.statistics import ChannelStatistics
from radiometry.frame.verdicts import Keeping
from store.codec import decode, read_text
from store.database import read_plainly
from store.digests import digest_piece
from store.queries.frames import extractor_of, statistics_of
from store.queries.memory import Memory
from store.tables import Campaign, Extraction, FrameRow

# the exposures of a campaign are few, however many its frames are
_read_exposure = lru_cache(4096)(lambda text: read_text(Exposure, text))
_read_list = lru_cache(4096)(lambda text: tuple(json.loads(text)))


@dataclass(frozen=True)
class FrameColumns(Keeping):
    """Columns of a frame's row that a verdict or a fit needs."""

    warnings: tuple[str, ...]
    left_out: dict[str, str] | None
    found: dict[str, Any]
    header: FrameHeader | None
    exposure: Exposure | None
    proof: str | None
    id: str
    filename: str
    sha256: str
    role: str
    scene: str | None
    roi_id: str | None
    state: str
    refusal_detail: str | None

    @classmethod
    def of(cls, row: FrameRow) -> "FrameColumns":
        return cls(
            tuple(row.warnings),
            row.left_out,
            row.found or {},
            decode(FrameHeader, row.header) if row.header else None,
            decode(Exposure, row.exposure) if row.exposure else None,
            json.dumps(row.proof),
            *(getattr(row, column.key) for column in _PLAIN),
        )

    @property
    def size_px(self) -> tuple[int, int] | None:
        return (self.header.width_px, self.header.height_px) if self.header else None

    def describe_doubt(self) -> str:
        """Return what is doubtful in the pixels of a frame of which a part is empty."""
        proof: Proof = read_text(Proof, self.proof)
        assert self.header is not None  # noqa: S101  its pixels were read
        return proof.describe_doubt(self.header)


_PLAIN: tuple[InstrumentedAttribute[Any], ...] = (
    *(FrameRow.id, FrameRow.filename, FrameRow.sha256, FrameRow.role, FrameRow.scene, FrameRow.roi_id),
    *(FrameRow.state, FrameRow.refusal_detail),
)
_JSON = (
    FrameRow.warnings,
    FrameRow.left_out,
    FrameRow.found,
    FrameRow.header,
    FrameRow.exposure,
    FrameRow.proof,
)
_ID = len(_JSON)
"""Place of the id in a row."""

_MOST_NAMED = 500
"""More extractions than this are not named one by one in a query."""


def read_frames(
    session: Session,
    campaign: Campaign,
    roles: Collection[str] | None = None,
    *,
    memory: Memory | None = None,
) -> list[FrameColumns]:
    """Read all frames of a campaign, or those of some roles, in the order in which they came."""
    kept = (memory or Memory()).frames
    rows = read_plainly(
        session,
        select(*(cast(column, Text) for column in _JSON), *_PLAIN)
        .where(FrameRow.campaign_id == campaign.id, FrameRow.withdrawn_at.is_(None))
        .where(FrameRow.role.in_(roles) if roles else true())
        .order_by(FrameRow.id),
    )
    for row in rows:
        before = kept[row[_ID]]
        # the texts themselves take as much memory as all that is made of them
        digest = digest_piece("\0".join(["\0" if each is None else each for each in row]).encode())
        if before is None or before[0] != digest:
            kept[row[_ID]] = digest, _decode(row)
    return [kept[row[_ID]][1] for row in rows]


def _decode(row: Sequence[Any]) -> FrameColumns:
    text, left_out, found, header, exposure, proof, *plain = row
    warnings = _read_list(text)
    return FrameColumns(
        warnings,
        read_text(dict[str, str], left_out),
        read_text(dict[str, Any], found) or {},
        read_text(FrameHeader, header),
        _read_exposure(exposure),
        # only of a doubtful frame anybody asks why
        proof if shared.IMAGE_PART_EMPTY in warnings else None,
        *plain,
    )


@dataclass(frozen=True, slots=True)
class ExtractionColumns:
    """The extraction of the region that holds for a frame now, with its statistics by channel."""

    roi_id: str
    features: Any
    statistics: tuple[ChannelStatistics, ...]


def list_outdated(
    session: Session, campaign: Campaign, regions: dict[str, str | None], current: Collection[str]
) -> list[str]:
    """Return the frames whose region was extracted, though not by what extracts it now."""
    if all(frame_id in current for frame_id, roi_id in regions.items() if roi_id):
        return []
    made = (
        select(Extraction.frame_id, Extraction.roi_id)
        .join(FrameRow, FrameRow.id == Extraction.frame_id)
        .where(FrameRow.campaign_id == campaign.id)
    )
    found = {frame_id for frame_id, roi_id in read_plainly(session, made) if regions.get(frame_id) == roi_id}
    return sorted(found - set(current))


def read_extractions(
    session: Session, campaign: Campaign, regions: dict[str, str | None], *, memory: Memory | None = None
) -> dict[str, ExtractionColumns]:
    """Read the extraction of each frame in its region of now, by the frame's id."""
    kept = (memory or Memory()).extractions
    features = methods.get_method(campaign.method).features
    mine = (
        select(Extraction.id, Extraction.frame_id, Extraction.roi_id)
        .join(FrameRow, FrameRow.id == Extraction.frame_id)
        .where(FrameRow.campaign_id == campaign.id, Extraction.extractor == extractor_of(campaign))
        .where(Extraction.roi_id.in_({roi_id for roi_id in regions.values() if roi_id}))
    )
    found = read_plainly(session, mine)
    fresh = [extraction_id for extraction_id, *_ in found if kept[extraction_id] is None]
    if fresh:
        some = mine if len(fresh) > _MOST_NAMED else mine.where(Extraction.id.in_(fresh))
        statistics = statistics_of(session, some.with_only_columns(Extraction.id))
        columns = (Extraction.id, Extraction.roi_id, cast(Extraction.features, Text))
        for extraction_id, roi_id, text in read_plainly(session, some.with_only_columns(*columns)):
            kept[extraction_id] = ExtractionColumns(
                roi_id=roi_id,
                features=read_text(features, text) if features else None,
                statistics=tuple(statistics[extraction_id]),
            )
    return {frame_id: kept[each] for each, frame_id, roi_id in found if regions.get(frame_id) == roi_id}
