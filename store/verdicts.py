"""What a field team is told on site: the verdict on each frame, and what its campaign still lacks."""

from dataclasses import dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.findings import shared
from radiometry.frame.roi import Polygon
from radiometry.frame.verdicts import ReviewedFrame, Verdict, conclude, inspect_frame
from store.codec import decode_header
from store.fitting import leave_out_doubtful, list_missing, make_params
from store.queries.evidence import gather
from store.queries.frames import current_roi, is_told, region_ids, whole_frame_of
from store.tables import Campaign, FrameRow, Roi


@dataclass(frozen=True, kw_only=True)
class Readiness:
    """What a campaign lacks. ``missing``: for any fit; ``advice``: for a good one."""

    missing: list[str]
    advice: list[str]


def assess_readiness(session: Session, campaign: Campaign) -> Readiness:
    params = make_params(session, campaign)
    every = gather(session, campaign, applied=True)
    spec = methods.get_method(campaign.method)
    fitted = gather(session, campaign) if spec.applied_roles else every
    return Readiness(
        missing=list_missing(campaign, fitted, params),
        advice=list(spec.plan(every.frames, every.readings, leave_out_doubtful(params, every))),
    )


def judge_frames(session: Session, campaign: Campaign) -> dict[str, Verdict]:
    """The verdict on every frame of a campaign, by id; in as many queries for a thousand as for one."""
    rows = session.scalars(
        select(FrameRow).where(FrameRow.campaign_id == campaign.id).order_by(FrameRow.id)
    ).all()
    evidence = gather(session, campaign, applied=True)
    of_frame = region_ids(session, campaign, rows)
    regions = _read_regions(session, set(of_frame.values()))
    # what no fit sees needs no name, only one that no other frame has
    names = {row.id: evidence.names.get(row.id, row.id) for row in rows}
    taken = [_take(row, campaign, names[row.id], regions.get(of_frame[row.id])) for row in rows]
    params = leave_out_doubtful(make_params(session, campaign), evidence)
    verdicts = methods.get_method(campaign.method).judge(taken, evidence.frames, evidence.readings, params)
    return {row.id: verdicts[names[row.id]] for row in rows}


def judge_alone(session: Session, frame: FrameRow, campaign: Campaign) -> Verdict:
    """The verdict on a frame that is about to be read: nothing of it can be held against others yet."""
    roi = current_roi(session, frame, campaign)
    region = Polygon.from_points(roi.points) if roi else None
    return conclude(inspect_frame(_take(frame, campaign, frame.id, region)))


def _region(row: FrameRow, campaign: Campaign, drawn: Polygon | None) -> Polygon | None:
    """What is drawn, or the whole of a frame that needs no drawing."""
    room = methods.get_method(campaign.method)
    if drawn is None and row.header is not None and room.whole_frame and row.role in room.role_names:
        return whole_frame_of(row)
    return drawn


def _read_regions(session: Session, roi_ids: set[str | None]) -> dict[str | None, Polygon]:
    rois = session.scalars(select(Roi).where(Roi.id.in_(roi_ids - {None})))
    return {roi.id: Polygon.from_points(roi.points) for roi in rois}


def _take(row: FrameRow, campaign: Campaign, name: str, drawn: Polygon | None) -> ReviewedFrame:
    room = methods.get_method(campaign.method)
    drawn_for = room.role_names if room.whole_frame else {row.role} - room.applied_role_names
    return ReviewedFrame(
        frame=name,
        role=row.role,
        scene=row.scene,
        state=row.state,
        refusal=row.refusal_detail or "",
        flags=tuple(row.warnings),
        format=_read_format(row.header),
        region=_region(row, campaign, drawn),
        needs_region=row.role in drawn_for,
        roles=room.role_names | room.applied_role_names,
        told=is_told(campaign),
        left_out=_explain_left_out(row, campaign),
    )


def _explain_left_out(row: FrameRow, campaign: Campaign) -> str:
    if row.header is None or shared.FRAME_LEFT_OUT not in row.warnings:
        return ""
    found = methods.get_method(campaign.method).check_frame(decode_header(row.header), exposure=None)
    return next((raised.detail for raised in found), shared.FRAME_LEFT_OUT.sentence)


def _read_format(header: dict[str, Any] | None) -> tuple[int, int, str] | None:
    return (header["width_px"], header["height_px"], header["cfa"]) if header else None
