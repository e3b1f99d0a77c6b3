"""Verdicts for a field team on site: on each frame, and what its campaign still lacks."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.findings import shared
from radiometry.findings.grouping import FindingGroup, Occurrence, group_findings
from radiometry.frame.roi import Polygon
from radiometry.frame.verdicts import ReviewedFrame, Verdict, conclude, inspect_frame
from radiometry.specification.roles import FIELD, Gap
from store.fits import leave_out_doubtful, list_missing, make_params
from store.queries.checklist import RecordState, read_record
from store.queries.evidence import Evidence, gather
from store.queries.frame_columns import FrameColumns, read_frames
from store.queries.frames import current_roi, is_told, region_ids, whole_frame
from store.queries.memory import Memory
from store.tables import Campaign, FrameRow, Roi


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """All that is kept of a campaign.

    ``missing``: what any fit needs; ``advice``: what a good one does; ``verdicts``: by the frame's id;
    ``record``: what the checklist needs; ``gaps``: what to photograph next, by its place in the grid;
    ``findings``: reasons of the verdicts, and what holds for the campaign, equal ones as one.
    """

    missing: list[str]
    advice: list[str]
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
        waiting = [f"{unread} of {len(frames)} frames are not read yet"] if unread else []
        verdicts = _judge(session, campaign, frames, every, make_params(session, campaign), memory)
        return Assessment(
            missing=waiting if frames else ["no frame: send the frames of the night"],
            advice=[],
            verdicts=verdicts,
            findings=group_findings(_list_reasons(frames, verdicts)),
            record=None,
        )
    params = make_params(session, campaign)
    usable = stated = leave_out_doubtful(params, every)
    if spec.applied_roles:
        fitted, stated = gather(session, campaign, frames=frames, memory=memory), params
    verdicts = _judge(session, campaign, frames, every, usable, memory)
    found = [*_list_lone_readings(frames, every), *_list_reasons(frames, verdicts)]
    return Assessment(
        missing=list_missing(campaign, fitted, stated),
        advice=[] if fitted.outdated else list(spec.plan(every.frames, every.readings, usable)),
        gaps=spec.find_gaps(every.frames, every.readings, usable),
        verdicts=verdicts,
        findings=group_findings(found),
        record=read_record(session, campaign, fitted),
    )


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
            detail="",
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
    unknown = {roi_id for roi_id in set(of_frame.values()) - {None} if regions[roi_id] is None}
    if unknown:
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
        left_out=_explain_left_out(row, campaign),
    )


def _explain_left_out(row: FrameColumns, campaign: Campaign) -> str:
    if row.header is None or shared.FRAME_LEFT_OUT not in row.warnings:
        return ""
    found = methods.get_method(campaign.method).check_frame(row.header, exposure=None)
    return next((raised.detail for raised in found), shared.FRAME_LEFT_OUT.sentence)
