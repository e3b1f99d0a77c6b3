"""Reviews of campaigns: verdicts, what is missing and what the checklist needs, once per revision."""

import gc
import hashlib
import json
import logging
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from functools import cache, partial
from pathlib import Path
from typing import Any

from sqlalchemy import ColumnElement, delete, insert, or_, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from radiometry import methods, records
from radiometry.drawing.text import name_few
from radiometry.findings import Reason, shared
from radiometry.findings.grouping import Cause, FindingGroup, Occurrence, group_causes, group_findings
from radiometry.frame.roi import Polygon
from radiometry.frame.verdicts import ReviewedFrame, Verdict, conclude, inspect_frame
from radiometry.methods.findings import FINDINGS
from radiometry.specification.roles import FIELD, Gap
from store import codec, fits, revisions
from store.database import Database, summarise
from store.queries import update_where
from store.queries.checklist import RecordState, read_record
from store.queries.evidence import Evidence, gather
from store.queries.frames import (
    FrameColumns,
    Memory,
    current_roi,
    is_told,
    read_frames,
    region_ids,
    whole_frame,
)
from store.tables import Campaign, CampaignReview, FrameRow, FrameVerdict, Roi, utc_now


class Assessment(records.Record):
    """All that is kept of a campaign.

    ``missing``: what any fit needs; ``advice``: what a good one does, equal ones as one; ``verdicts``: by id;
    ``record``: what the checklist needs; ``gaps``: what to photograph next, by its place in the grid;
    ``findings``: reasons of the verdicts, and what holds for the campaign, equal ones as one.
    """

    missing: Sequence[FindingGroup]
    advice: Sequence[FindingGroup]
    verdicts: Mapping[str, Verdict]
    record: RecordState | None
    gaps: Sequence[Gap] = ()
    findings: Sequence[FindingGroup] = ()


def assess(session: Session, campaign: Campaign, memory: Memory | None = None) -> Assessment:
    """Read a campaign once and judge all of it; ``memory``: what the last such call decoded of it."""
    memory = memory or Memory()
    memory.turn()
    frames = read_frames(session, campaign, memory=memory)
    spec = methods.get_method(campaign.method)
    every = fitted = gather(session, campaign, applied=True, frames=frames, memory=memory)
    if campaign.measures:
        unread = sum(row.state == "received" for row in frames)
        waiting = [Cause(f"{unread} of {len(frames)} frames are not read yet", shared.NOT_READ)]
        verdicts = _judge(session, campaign, frames, every, fits.make_params(session, campaign), memory)
        lacking = waiting[: bool(unread)] if frames else ["no frame: send the frames of the night"]
        return Assessment(
            missing=group_causes(lacking, shared.FIT_INCOMPLETE),
            advice=(),
            verdicts=verdicts,
            findings=group_findings(_list_reasons(frames, verdicts)),
            record=None,
        )
    params = fits.make_params(session, campaign)
    usable = stated = fits.leave_out_doubtful(params, every)
    if spec.applied_roles:
        fitted, stated = gather(session, campaign, frames=frames, memory=memory), params
    verdicts = _judge(session, campaign, frames, every, usable, memory)
    found = [*_list_lone_readings(frames, every), *_list_reasons(frames, verdicts)]
    more = () if fitted.outdated else spec.plan(every.frames, every.readings, usable)
    return Assessment(
        missing=group_causes(fits.list_missing(campaign, fitted, stated), shared.FIT_INCOMPLETE),
        advice=group_causes([*_name_other_lenses(frames, verdicts), *more], shared.COULD_IMPROVE),
        gaps=spec.find_gaps(every.frames, every.readings, usable),
        verdicts=verdicts,
        findings=group_findings(found),
        record=read_record(session, campaign, fitted),
    )


def _name_other_lenses(rows: Sequence[FrameColumns], verdicts: Mapping[str, Verdict]) -> Iterator[Cause]:
    """Name the frames of another lens, by which a fit would go wrong in silence."""
    found: dict[str, list[str]] = {}
    for row in rows:
        for reason in verdicts[row.id].reasons:
            if reason.code is shared.LENS_DIFFERS:
                found.setdefault(reason.detail, []).append(row.filename)
    for detail, names in found.items():
        subjects = tuple(f"frame {name}" for name in names)
        yield Cause(f"{name_few('frame', names)}: {detail}", shared.LENS_DIFFERS, subjects)


def _list_reasons(rows: Sequence[FrameColumns], verdicts: Mapping[str, Verdict]) -> Iterator[Occurrence]:
    for row in rows:
        for reason in verdicts[row.id].reasons:
            if reason.outcome != "pass":
                yield Occurrence(
                    finding=reason.code,
                    severity=reason.outcome,
                    subject=f"frame {row.filename}",
                    detail=reason.detail,
                )


def _list_lone_readings(rows: Sequence[FrameColumns], evidence: Evidence) -> Iterator[Occurrence]:
    """List the scenes with meter readings and no frame that could be used."""
    shown = {row.scene for row in rows if row.state != "refused"}
    # rows of a table have no file
    shown |= {getattr(each, "scene", None) for each in evidence.frames}
    read = Counter(scene for each in evidence.readings if (scene := getattr(each, "scene", None)))
    for scene in sorted(read.keys() - shown) if any(shown) else ():
        yield Occurrence(
            finding=shared.READING_WITHOUT_FRAMES,
            severity="warn",
            subject=f"scene {scene}",
            detail=f"Scene {scene} has readings and no frames.",
            values={"readings": read[scene]},
        )


def _judge(
    session: Session,
    campaign: Campaign,
    rows: Sequence[FrameColumns],
    evidence: Evidence,
    params: Any,  # noqa: ANN401  the method's own
    memory: Memory,
) -> dict[str, Verdict]:
    of_frame = region_ids(session, campaign, rows)
    regions = memory.regions
    if unknown := {roi_id for roi_id in set(of_frame.values()) - {None} if regions[roi_id] is None}:
        for roi in session.scalars(select(Roi).where(Roi.id.in_(unknown))):
            regions[roi.id] = Polygon.from_points(roi.points)
    # what no fit sees needs no name, only one that no other frame has
    names = {row.id: evidence.names.get(row.id, row.id) for row in rows}
    told = is_told(campaign)
    taken = [
        row.keep("reviewed", (told, *given), partial(_take, told=told), row, campaign, *given)
        for row in rows
        for given in ((names[row.id], regions[of_frame[row.id]]),)
    ]
    verdicts = methods.get_method(campaign.method).judge(taken, evidence.frames, evidence.readings, params)
    return {row.id: verdicts[names[row.id]] for row in rows}


def judge_alone(session: Session, frame: FrameRow, campaign: Campaign) -> Verdict:
    """The verdict on a frame that is about to be read: nothing of it can be compared with others yet."""
    roi = current_roi(session, frame, campaign)
    region = Polygon.from_points(roi.points) if roi else None
    taken = _take(FrameColumns.of(frame), campaign, frame.id, region, told=is_told(campaign))
    return conclude(inspect_frame(taken))


def _take(
    row: FrameColumns, campaign: Campaign, name: str, drawn: Polygon | None, *, told: bool
) -> ReviewedFrame:
    spec = methods.get_method(campaign.method)
    fitted, applied = spec.role_names, spec.applied_role_names
    if campaign.measures:
        fitted, applied = frozenset(), frozenset({FIELD.name})
    if drawn is None and row.size_px and spec.whole_frame and row.role in fitted:
        drawn = whole_frame(*row.size_px)
    return ReviewedFrame(
        frame=name,
        role=row.role,
        scene=row.scene,
        state=row.state,
        refusal=row.refusal_detail or "",
        flags=row.warnings,
        format=(*row.size_px, row.header.cfa) if row.header and row.size_px else None,
        region=drawn,
        needs_region=row.role in fitted if spec.whole_frame else row.role not in applied,
        roles=fitted | applied,
        told=told,
        lens=_name_lens(row),
        left_out=_explain_left_out(row, campaign),
    )


def _name_lens(row: FrameColumns) -> str:
    # each band of a multispectral camera has a lens of its own
    if row.header is None or row.header.multispectral is not None:
        return ""
    return " ".join(filter(None, (row.header.lens_model, row.header.lens_serial)))


def _explain_left_out(row: FrameColumns, campaign: Campaign) -> str:
    if row.header is None or shared.FRAME_LEFT_OUT not in row.warnings:
        return ""
    found = methods.get_method(campaign.method).check_frame(row.header, exposure=None)
    return next((raised.detail for raised in found), shared.FRAME_LEFT_OUT.sentence)


log = logging.getLogger(__name__)

_CLAIM = timedelta(minutes=2)  # longer than the largest campaign takes; a lost worker is then replaced

_PAUSE, _LONGEST_PAUSE_S = 4.0, 30.0
"""A worker rests so many times as long as a review took: frames that keep coming are reviewed in batches."""


_MOST_REMEMBERED = 20_000  # frames whose decoded parts are kept for the next review of their campaign


class Reviews:
    """The reviews of one database; one thread of a process computes a campaign's, the others wait for it."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._computing: dict[str, threading.Lock] = defaultdict(threading.Lock)
        self._memories: dict[str, Memory] = {}  # of the last ones: one that grows is reviewed again and again
        self._remembering = threading.Lock()

    def find(
        self, session: Session, campaign_id: str, *, verdicts_of: Collection[str] | None = ()
    ) -> Assessment:
        """Return a campaign's review, with the verdicts on these frames; None asks for all of them."""
        if (kept := _find_kept(session, campaign_id, verdicts_of)) is not None:
            return kept
        with self._computing[campaign_id], self._database.reading() as own:
            return _find_kept(own, campaign_id, verdicts_of) or self._compute(own, campaign_id)

    def claim_next(self) -> str | None:
        """Return a campaign whose review is stale, to be computed by one worker; None if there is none."""
        now = utc_now()
        with self._database.writing("review") as session:
            campaign_id = session.scalar(select(CampaignReview.campaign_id).where(is_stale(now)).limit(1))
            mine = (CampaignReview.campaign_id == campaign_id) & is_stale(now)
            claimed = update_where(session, CampaignReview, mine, not_before=now + _CLAIM)
            return campaign_id if claimed else None

    def renew(self, campaign_id: str) -> None:
        with self._computing[campaign_id], self._database.reading() as session:
            self._compute(session, campaign_id)

    def _compute(self, session: Session, campaign_id: str) -> Assessment:
        mine = CampaignReview.campaign_id == campaign_id
        revision = session.scalars(select(CampaignReview.revision).where(mine)).one()
        began = time.monotonic()
        # a large campaign is a million objects, all of which stay until the end: to search them for garbage
        # takes a third of the time
        gc.disable()
        try:
            with self._remembering:
                memory = self._memories.pop(campaign_id, None) or Memory()
            found = assess(session, session.get_one(Campaign, campaign_id), memory)
            with self._remembering:
                self._memories[campaign_id] = memory
                while sum(len(each.frames) for each in self._memories.values()) > _MOST_REMEMBERED:
                    del self._memories[next(iter(self._memories))]
        finally:
            gc.enable()
        rest = timedelta(seconds=min(_PAUSE * (time.monotonic() - began), _LONGEST_PAUSE_S))
        values, verdicts = _encode(found), _encode_verdicts(found.verdicts)
        try:
            with self._database.writing("review") as writing:
                values["not_before"] = utc_now() + rest
                _keep(writing, campaign_id, revision, values, verdicts)
        except SQLAlchemyError as error:
            # what was asked for is known, and the next who asks computes it again
            log.warning("the review of %s is not kept: %s", campaign_id, summarise(error))
        return found


def is_stale(now: datetime | ColumnElement[datetime]) -> ColumnElement[bool]:
    """Match a review that is stale and computed by no worker."""
    free = or_(CampaignReview.not_before.is_(None), CampaignReview.not_before < now)
    return (CampaignReview.kept_revision < CampaignReview.revision) & free


_KEPT: dict[str, Any] = dict.fromkeys(("missing", "advice", "findings"), tuple[FindingGroup, ...]) | {
    "gaps": tuple[Gap, ...]
}
"""Lists of an assessment that the review's row keeps."""


def _find_kept(session: Session, campaign_id: str, verdicts_of: Collection[str] | None) -> Assessment | None:
    if (ids := verdicts_of) is None:
        ids = session.scalars(select(FrameRow.id).where(FrameRow.standing(campaign_id))).all()
    columns = [getattr(CampaignReview, name) for name in (*_KEPT, "checklist")]
    fresh = (CampaignReview.kept_revision == CampaignReview.revision, CampaignReview.kept_by == hash_code())
    row = session.execute(select(*columns).where(CampaignReview.campaign_id == campaign_id, *fresh)).first()
    if row is None:
        return None
    *lists, checklist = row
    chosen = FrameVerdict.campaign_id == campaign_id
    if verdicts_of is not None:
        chosen = FrameVerdict.frame_id.in_(verdicts_of)
    reasons = session.execute(select(FrameVerdict.frame_id, FrameVerdict.reasons).where(chosen))
    verdicts = dict.fromkeys(ids, conclude(()))
    for frame_id, text in reasons:
        said = json.loads(text)
        verdicts[frame_id] = conclude(
            Reason(code=FINDINGS[code], outcome=outcome, detail=detail) for code, outcome, detail in said
        )
    return Assessment(
        **{name: codec.decode(_KEPT[name], kept or []) for name, kept in zip(_KEPT, lists, strict=True)},
        record=codec.decode(RecordState, checklist) if checklist else None,
        verdicts=verdicts,
    )


def _encode_verdicts(verdicts: Mapping[str, Verdict]) -> dict[str, str]:
    texts: dict[int, str] = {}  # by the reason's identity: frames share most of theirs

    def encode_reason(each: Reason) -> str:
        if (text := texts.get(id(each))) is None:
            text = texts[id(each)] = json.dumps([str(each.code), each.outcome, each.detail])
        return text

    return {
        frame_id: f"[{', '.join(map(encode_reason, verdict.reasons))}]"
        for frame_id, verdict in verdicts.items()
        if verdict.reasons
    }


def _encode(found: Assessment) -> dict[str, Any]:
    return {
        "kept_by": hash_code(),
        **{name: [codec.encode(each) for each in getattr(found, name)] for name in _KEPT},
        "checklist": codec.encode(found.record) if found.record else None,
    }


def _keep(
    session: Session, campaign_id: str, revision: int, values: Mapping[str, Any], now: Mapping[str, str]
) -> None:
    """Keep what was computed unless the campaign has changed meanwhile; only what differs is written."""
    mine = CampaignReview.campaign_id == campaign_id
    unchanged = mine & (CampaignReview.revision == revision)
    if not update_where(session, CampaignReview, unchanged, kept_revision=revision, **values):
        update_where(session, CampaignReview, mine, not_before=values["not_before"])
        return
    kept = select(FrameVerdict.frame_id, FrameVerdict.reasons).where(FrameVerdict.campaign_id == campaign_id)
    before = {row[0]: row[1] for row in session.execute(kept)}
    gone = [frame_id for frame_id, reasons in before.items() if now.get(frame_id) != reasons]
    new = [
        {"frame_id": frame_id, "campaign_id": campaign_id, "reasons": reasons}
        for frame_id, reasons in now.items()
        if before.get(frame_id) != reasons
    ]
    for first in range(0, len(gone), _MOST_AT_ONCE):
        some = FrameVerdict.frame_id.in_(gone[first : first + _MOST_AT_ONCE])
        session.execute(delete(FrameVerdict).where(some))
    if new:
        session.execute(insert(FrameVerdict), new)
    changed = {*gone, *(row["frame_id"] for row in new)}
    revisions.stamp_frames(session, [(frame_id, campaign_id, revision) for frame_id in sorted(changed)])


_MOST_AT_ONCE = 5000


@cache
def hash_code() -> str:
    """Return the hash of the code that judges: a release that judges otherwise keeps no older verdict."""
    root, sources = Path(__file__).parents[1], hashlib.sha256()
    for path in sorted([*(root / "radiometry").rglob("*.py"), *(root / "store").rglob("*.py")]):
        sources.update(path.read_bytes())
    return sources.hexdigest()[:16]
