"""The procedure's checklist of a campaign: what the record ticks, and what people tick and sign."""

import hashlib
import json
from collections import defaultdict
from collections.abc import Mapping
from datetime import datetime
from typing import Any

from sqlalchemy import Text, cast, func, select
from sqlalchemy.orm import Session

from radiometry.checklist import ITEMS, Facts, Finding, FrameFacts, IsoFacts, Item, VersionFacts, find
from radiometry.findings import shared
from radiometry.frame import FrameHeader
from radiometry.methods import get_method
from radiometry.records import Record, about
from store import tables
from store.queries.evidence import Evidence
from store.tables import Calibration, Campaign, ChecklistSignature, ChecklistTick, FrameRow, Reading
from store.tables.base import utc_now

BY_ITSELF = "stilb"  # who ticked what follows from the record

KEYS = frozenset(item.key for item in ITEMS)


class ChecklistItem(Record):
    key: str
    section: str
    text: str
    done_by: str | None = about('A key\'s id; "stilb" for what follows from the record. Absent while open.')
    done_at: datetime | None
    evidence: str | None = about("The sentence from which it follows.")
    missing: str | None = about("What the record still lacks for it.")
    note: str | None = about("What was written beside it.")


class RecordState(Record):
    """State of a campaign by its record: of each item, and since when each part is as it is."""

    findings: dict[str, Finding]
    times: dict[str, datetime]


def read_record(session: Session, campaign: Campaign, evidence: Evidence) -> RecordState | None:
    """Return what the record ticks; None for a campaign of a method without a checklist."""
    if not has_checklist(campaign):
        return None
    facts = _gather_facts(session, campaign, evidence)
    return RecordState(findings=find(facts), times=_times(session, campaign))


def read_checklist(session: Session, campaign: Campaign, record: RecordState | None) -> list[ChecklistItem]:
    """Every item in the print's order. A tick counts unless the record shows the item undone."""
    if record is None:
        return []
    found, times = record.findings, record.times
    rows = session.scalars(select(ChecklistTick).where(ChecklistTick.campaign_id == campaign.id))
    ticks = {tick.key: tick for tick in rows}
    return [_stand(item, found.get(item.key), ticks.get(item.key), times) for item in ITEMS]


def has_checklist(campaign: Campaign) -> bool:
    return get_method(campaign.method).has_checklist and not campaign.measures


def read_signature(session: Session, campaign: Campaign) -> ChecklistSignature | None:
    return session.get(ChecklistSignature, campaign.id)


def set_tick(
    session: Session, campaign: Campaign, key: str, *, done: bool, note: str | None, by: str
) -> None:
    """Tick or untick an item; a note stays until another takes its place."""
    tick = session.get(ChecklistTick, (campaign.id, key)) or ChecklistTick(campaign_id=campaign.id, key=key)
    session.add(tick)
    if done != (tick.done_by is not None):
        tick.done_by, tick.done_at = (by, utc_now()) if done else (None, None)
    if note is not None:
        tick.note = note


def sign(session: Session, campaign: Campaign, *, name: str, by: str) -> None:
    """Sign the checklist as it stands; a new signature replaces the one before."""
    signature = read_signature(session, campaign) or ChecklistSignature(campaign_id=campaign.id)
    session.add(signature)
    signature.name, signature.signed_by, signature.signed_at = name, by, utc_now()
    session.flush()
    signature.state_sha256 = hash_state(session, campaign)


def hash_state(session: Session, campaign: Campaign) -> str:
    """Return the hash of what a signature signs: details, frames, readings, region and ticks as they are."""
    details = [getattr(campaign, name) for name in _SIGNED_DETAILS]
    started, ended = (at.isoformat() if at else None for at in (campaign.started_at, campaign.ended_at))
    # of what is not stated nothing is signed: a hash from before there was such a field stays what it is
    stated = {name: value for name, value in (("ended_at", ended), ("lens", campaign.lens)) if value}
    parts = (
        select(FrameRow.sha256, FrameRow.role, FrameRow.scene, FrameRow.roi_id, cast(FrameRow.left_out, Text))
        .where(FrameRow.standing(campaign.id))
        .order_by(FrameRow.sha256),
        select(Reading.scene, Reading.quantity, Reading.value, Reading.meter_id)
        .where(Reading.standing(campaign.id))
        .order_by(Reading.id),
        select(ChecklistTick.key, ChecklistTick.done_by.is_not(None), ChecklistTick.note)
        .where(ChecklistTick.campaign_id == campaign.id)
        .order_by(ChecklistTick.key),
    )
    # a column of JSON knows two kinds of nothing
    rows = [[[None if v == "null" else v for v in row] for row in session.execute(part)] for part in parts]
    signed = json.dumps([details, started, *rows, *([stated] if stated else [])])
    return hashlib.sha256(signed.encode()).hexdigest()


_SIGNED_DETAILS = (
    *("camera_id", "method", "project_number", "recorder", "customer", "place", "conditions", "comments"),
    *("roi_id", "panel_id", "target"),
)


def _stand(
    item: Item, finding: Finding | None, tick: ChecklistTick | None, times: Mapping[str, datetime]
) -> ChecklistItem:
    undone = finding is not None and not finding.done
    by, at = (tick.done_by, tick.done_at) if tick and not undone else (None, None)
    if tick is None and finding is not None and finding.done:
        by, at = BY_ITSELF, times.get(item.key) or times[finding.source]
    return ChecklistItem(
        key=item.key,
        section=item.section,
        text=item.text,
        done_by=by,
        done_at=at,
        evidence=finding.sentence if finding and finding.done else None,
        missing=finding.sentence if finding and not finding.done else None,
        note=tick.note if tick else None,
    )


def _gather_facts(session: Session, campaign: Campaign, evidence: Evidence) -> Facts:
    readings: dict[str, list[float]] = defaultdict(list)
    for reading in evidence.readings:
        if reading.quantity == "luminance":
            readings[reading.scene].append(reading.value)
    region = session.get_one(tables.Roi, campaign.roi_id).points if campaign.roi_id else []
    started = campaign.started_at
    return Facts(
        project_number=campaign.project_number,
        started_on=started.strftime("%Y-%m-%d") if started else None,
        started_at=started.strftime("%H:%M UTC") if started else None,
        recorder=campaign.recorder,
        frames=tuple(
            frame.keep("facts", None, _frame_facts, frame, evidence.headers[frame.frame])
            for frame in evidence.frames
        ),
        unread=tuple(evidence.unread),
        readings={scene: tuple(values) for scene, values in readings.items()},
        region=tuple((x, y) for x, y in region),
        version=_version_facts(_newest_version(session, campaign)),
    )


def _frame_facts(frame: Any, header: FrameHeader) -> FrameFacts:  # noqa: ANN401  the method's own
    exposure, said = frame.exposure, header.exposure_mode or header.exposure_program
    origins = {
        "exposure time": exposure.exposure_time_origin,
        "f-number": exposure.f_number_origin,
        "ISO": exposure.iso_origin,
    }
    return FrameFacts(
        name=frame.frame,
        role=frame.role,
        scene=frame.scene,
        container=header.container,
        rendered=frame.rendered,
        manual=said == "manual" if said and said != "not_defined" else None,
        exposure_time_s=exposure.exposure_time_s,
        f_number=exposure.f_number,
        iso=exposure.iso,
        typed_in=tuple(name for name, origin in origins.items() if origin == "supplied"),
        extracted=frame.statistics is not None,
    )


def _newest_version(session: Session, campaign: Campaign) -> Calibration | None:
    valid = Calibration.id.not_in(select(tables.Revocation.calibration_id))
    rows = select(Calibration).where(Calibration.campaign_id == campaign.id, valid)
    return session.scalar(rows.order_by(Calibration.version.desc()).limit(1))


def _version_facts(version: Calibration | None) -> VersionFacts | None:
    if version is None or not get_method(version.method).has_checklist:
        return None
    return VersionFacts(
        version=version.version,
        isos=tuple(_iso_facts(version, fit["coefficient"]) for fit in version.result["iso_fits"]),
    )


def _iso_facts(version: Calibration, coefficient: Mapping[str, Any]) -> IsoFacts:
    iso = coefficient["iso"]
    flags = [flag["flag"] for flag in version.result["flags"] if flag["where"] == f"iso {iso:g}"]
    excluded = {exclusion["frame"] for exclusion in version.parameters["exclude"]}
    dark = [
        frame
        for frame in version.inputs["frames"]
        if frame["role"] == "dark" and frame["exposure"]["iso"] == iso and frame["frame"] not in excluded
    ]
    return IsoFacts(
        iso=iso,
        model=coefficient["model"],
        luminance_k=coefficient["luminance_k"],
        luminance_k_standard_uncertainty=coefficient["luminance_k_standard_uncertainty"],
        luminance_k_unit=coefficient["luminance_k_unit"],
        dark_signal_dn=coefficient["dark_signal_dn"],
        dark_frames=0 if shared.DARK_FROM_BLACK_LEVEL in flags else len(dark),
        points=sum(1 for point in version.result["points"] if point["used"] and point["iso"] == iso),
    )


def _times(session: Session, campaign: Campaign) -> dict[str, datetime]:
    """Since when each part of the record is as it is; by an item's key where the audit trail knows that."""
    frames, version = FrameRow.campaign_id == campaign.id, _newest_version(session, campaign)
    extractions = tables.Extraction.frame_id.in_(select(FrameRow.id).where(frames))
    newest = {
        "frames": session.scalar(select(func.max(FrameRow.created_at)).where(frames)),
        "readings": session.scalar(select(func.max(Reading.created_at)).where(Reading.standing(campaign.id))),
        "statistics": session.scalar(select(func.max(tables.Extraction.created_at)).where(extractions)),
        "version": version.created_at if version else None,
        **_last_changes(session, campaign),
    }
    times = dict.fromkeys(("campaign", "frames", "readings", "region", "statistics"), campaign.created_at)
    return times | {name: at for name, at in newest.items() if at is not None}


def _last_changes(session: Session, campaign: Campaign) -> dict[str, datetime]:
    """When each thing that is written on the campaign was last written, from the audit trail."""
    named = {
        "project_number": ["general_project_number"],
        "started_at": ["general_date", "general_time"],
        "recorder": ["general_recorder"],
        "roi_id": ["region"],
    }
    entries = session.scalars(
        select(tables.AuditEntry)
        .where(tables.AuditEntry.subject_id == campaign.id)
        .order_by(tables.AuditEntry.seq)
    )
    return {key: entry.at for entry in entries for name in entry.after for key in named.get(name, [])}
