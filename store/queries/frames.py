"""Frames and the statistics that were computed of them, as entities and in columns."""

import hashlib
import json
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any, NamedTuple

from sqlalchemy import Select, Text, cast, select, true
from sqlalchemy.orm import InstrumentedAttribute, Session

from radiometry import methods, records
from radiometry.findings import interface, shared
from radiometry.frame import FrameHeader, verdicts
from radiometry.frame.exposure import Exposure
from radiometry.frame.proof import Proof
from radiometry.frame.roi import Polygon
from radiometry.frame.statistics import ChannelStatistics
from radiometry.specification.roles import FIELD
from store import blobs, codec, jobs, software
from store.blobs.proof import digest_piece
from store.database import Conflict, read_plainly
from store.files import keep_blobs
from store.queries import add, group_by
from store.tables import Campaign, ChannelRow, Extraction, FrameRow, Json, Roi, new_id


class _Turns(dict[Any, Any]):
    """Values of this turn; those of the turn before are found until the next."""

    before: dict[Any, Any]

    def __init__(self) -> None:
        super().__init__()
        self.before = {}

    def __missing__(self, key: object) -> Any:  # noqa: ANN401  whatever is kept
        if (value := self.before.get(key)) is not None:
            self[key] = value
        return value

    def turn(self) -> None:
        self.before = dict(self)
        self.clear()


class Memory:
    def __init__(self) -> None:
        self.frames, self.extractions, self.regions = _Turns(), _Turns(), _Turns()

    def turn(self) -> None:
        """Begin a review: what the one before did not use is forgotten."""
        for each in (self.frames, self.extractions, self.regions):
            each.turn()


_STATISTICS = tuple(field.name for field in fields(ChannelStatistics))


class Placed(NamedTuple):
    id: str
    roi_id: str | None
    size_px: tuple[int, int] | None


class NewFrame(records.Record):
    blob: blobs.StoredBlob
    filename: str
    role: str
    scene: str | None
    roi_id: str | None
    supplied: dict[str, float]


def require_role(campaign: Campaign, role: str) -> None:
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

    The same bytes restore a withdrawn frame, and read again one that was refused or given up.
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
        said = {name: getattr(new, name) for name in ("filename", "role", "scene", "roi_id", "supplied")}
        known[key] = FrameRow(id=new_id("frm"), campaign_id=key[0], sha256=key[1], state="received", **said)
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
        return software.EXTRACTOR
    text = json.dumps(target, sort_keys=True) if target else ""
    told = f"+{hashlib.sha256(text.encode()).hexdigest()[:16]}" if text else ""
    return f"{software.EXTRACTOR}+{method}{told}"


def current_roi(session: Session, frame: FrameRow, campaign: Campaign) -> Roi | None:
    """The region that holds for a frame now: its own, else the campaign's, else perhaps the whole frame."""
    roi_id = region_ids(session, campaign, [frame])[frame.id]
    return session.get_one(Roi, roi_id) if roi_id else None


def region_ids(
    session: Session, campaign: Campaign, frames: Iterable["Placed | FrameRow | FrameColumns"]
) -> dict[str, str | None]:
    """The region that holds for each frame now, by the frame's id; None where there is none yet."""
    ids = {frame.id: frame.roi_id or campaign.roi_id for frame in frames}
    if campaign.roi_id is not None or not methods.get_method(campaign.method).whole_frame:
        return ids
    sizes = {frame.id: frame.size_px for frame in frames if frame.size_px is not None}
    hashes = {size: whole_frame(*size).sha256 for size in set(sizes.values())}
    if not (keys := {frame_id: hashes[size] for frame_id, size in sizes.items()}):
        return ids
    mine = (Roi.organisation_id == campaign.organisation_id) & Roi.sha256.in_(set(keys.values()))
    rois = session.execute(select(Roi.sha256, Roi.id).where(mine))
    found: dict[str, str] = {row[0]: row[1] for row in rois}
    return {frame_id: roi_id or found.get(keys.get(frame_id, "")) for frame_id, roi_id in ids.items()}


def whole_frame_of(frame: FrameRow) -> Polygon:
    assert frame.size_px is not None  # noqa: S101  it has been read
    return whole_frame(*frame.size_px)


@lru_cache(256)
def whole_frame(width_px: int, height_px: int) -> Polygon:
    return Polygon.from_points([(0, 0), (width_px, 0), (width_px, height_px), (0, height_px)])


def find_extraction(session: Session, frame: FrameRow, roi: Roi, extractor: str) -> Extraction | None:
    wanted = {"frame_id": frame.id, "roi_id": roi.id, "extractor": extractor}
    return session.scalar(select(Extraction).filter_by(**wanted))


def find_equal_extraction(session: Session, frame: FrameRow, roi: Roi, extractor: str) -> Extraction | None:
    """Return what the same code has already computed from the same bytes in the same region."""
    same = (FrameRow.sha256 == frame.sha256) & (Extraction.roi_id == roi.id)
    rows = select(Extraction).join(FrameRow, FrameRow.id == Extraction.frame_id)
    return session.scalar(rows.where(same, Extraction.extractor == extractor).limit(1))


def add_extraction(
    session: Session, frame: FrameRow, roi: Roi, extractor: str, *, rows: list[Json], features: Json | None
) -> None:
    key = {"id": new_id("ext"), "frame_id": frame.id, "roi_id": roi.id}
    extraction = add(session, Extraction(**key, extractor=extractor, features=features))
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


def extractions_of(session: Session, frame_ids: list[str]) -> Mapping[str, list[Extraction]]:
    mine = select(Extraction).where(Extraction.frame_id.in_(frame_ids)).order_by(Extraction.id)
    return group_by(session.scalars(mine), lambda row: row.frame_id)


# the exposures of a campaign are few, however many its frames are
_read_exposure = lru_cache(4096)(lambda text: codec.read_text(Exposure, text))
_read_list = lru_cache(4096)(lambda text: tuple(json.loads(text)))


@dataclass(frozen=True)
class FrameColumns(verdicts.Keeping):
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

    @staticmethod
    def of(row: FrameRow) -> "FrameColumns":
        texts = (json.dumps(getattr(row, column.key)) for column in _JSON)
        return _decode([*texts, *(getattr(row, column.key) for column in _PLAIN)])

    @property
    def size_px(self) -> tuple[int, int] | None:
        return (self.header.width_px, self.header.height_px) if self.header else None

    def describe_doubt(self) -> str:
        proof: Proof = codec.read_text(Proof, self.proof)
        assert self.header is not None  # noqa: S101  its pixels were read
        return proof.describe_doubt(self.header)


_PLAIN: tuple[InstrumentedAttribute[Any], ...] = (
    *(FrameRow.id, FrameRow.filename, FrameRow.sha256, FrameRow.role, FrameRow.scene, FrameRow.roi_id),
    *(FrameRow.state, FrameRow.refusal_detail),
)
_JSON = (
    *(FrameRow.warnings, FrameRow.left_out, FrameRow.found),
    *(FrameRow.header, FrameRow.exposure, FrameRow.proof),
)
_ID = len(_JSON)  # place of the id in a row

_MOST_NAMED = 500  # more extractions than this are not named one by one in a query


def read_frames(
    session: Session, campaign: Campaign, roles: Collection[str] | None = None, memory: Memory | None = None
) -> list[FrameColumns]:
    """Read all frames of a campaign, or those of some roles, in the order in which they came."""
    kept = (memory or Memory()).frames
    rows = read_plainly(
        session,
        select(*(cast(column, Text) for column in _JSON), *_PLAIN)
        .where(FrameRow.standing(campaign.id))
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
        codec.read_text(dict[str, str], left_out),
        codec.read_text(dict[str, Any], found) or {},
        codec.read_text(FrameHeader, header),
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
    made = select(Extraction.frame_id, Extraction.roi_id).where(FrameRow.campaign_id == campaign.id)
    made = made.join(FrameRow, FrameRow.id == Extraction.frame_id)
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
    if fresh := [extraction_id for extraction_id, *_ in found if kept[extraction_id] is None]:
        some = mine if len(fresh) > _MOST_NAMED else mine.where(Extraction.id.in_(fresh))
        statistics = statistics_of(session, some.with_only_columns(Extraction.id))
        columns = (Extraction.id, Extraction.roi_id, cast(Extraction.features, Text))
        for extraction_id, roi_id, text in read_plainly(session, some.with_only_columns(*columns)):
            kept[extraction_id] = ExtractionColumns(
                roi_id=roi_id,
                features=codec.read_text(features, text) if features else None,
                statistics=tuple(statistics[extraction_id]),
            )
    return {frame_id: kept[each] for each, frame_id, roi_id in found if regions.get(frame_id) == roi_id}
