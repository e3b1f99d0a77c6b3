"""Recalls: all versions with a common cause, found by their recorded inputs and revoked together.

The inputs of a version record its meters, their certificates and the software. A later replacement of any of
these does not hide the version.
"""

import json
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Select, or_, select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from store.columns import utc_now
from store.errors import Conflict
from store.impact import Touched, list_touched
from store.publications import revoke
from store.queries.calibrations import VersionStatus, read_version_statuses
from store.tables import AuditEntry, Calibration, Camera, Campaign, Meter, Reading, Recall

_ENGRAVED = ("kind", "make", "model", "serial")


@dataclass(frozen=True, kw_only=True)
class Condemned:
    """A version found by a recall, its status, and the measurements made with it."""

    calibration: Calibration
    camera: Camera
    status: VersionStatus
    measurements: list[Touched]


def find_versions(session: Session, organisation_id: str, cause: dict[str, str]) -> list[str]:
    """Return the ids of all versions made with the cause, drafts and revoked versions included, in order."""
    ((kind, value),) = cause.items()
    mine = select(Calibration.id).where(Calibration.organisation_id == organisation_id)
    match kind:
        case "meter_id":
            return _by_meter(session, mine, session.get_one(Meter, value))
        case "meter_certificate_number":
            return _by_certificate(session, mine, value)
        case "software":
            by_software = mine.where(Calibration.software["stilb"].as_string() == value)
            return sorted(session.scalars(by_software))
        case _:
            return sorted(session.scalars(mine.where(Calibration.campaign_id.in_(_recorded_by(value)))))


def propose(session: Session, organisation_id: str, cause: dict[str, str], *, reason: str, by: str) -> Recall:
    """Record the versions that the cause finds, for review and confirmation."""
    recall = Recall(
        organisation_id=organisation_id,
        cause=cause,
        reason=reason,
        calibration_ids=find_versions(session, organisation_id, cause),
        created_by=by,
    )
    session.add(recall)
    session.flush()
    return recall


def confirm(session: Session, recall: Recall, *, by: str) -> None:
    """Revoke every version of a recall in this transaction. A confirmed recall is not changed."""
    session.refresh(recall, with_for_update=True)
    if recall.confirmed_at is not None:
        return
    found = find_versions(session, recall.organisation_id, recall.cause)
    if found != recall.calibration_ids:
        more, fewer = set(found) - set(recall.calibration_ids), set(recall.calibration_ids) - set(found)
        raise Conflict(
            interface.RECALL_OUTDATED,
            f"The cause now finds other versions than at the review: {len(more)} more, {len(fewer)} fewer. "
            "Propose the recall again and review it.",
        )
    for calibration in _in_locking_order(session, found):
        revoke(session, calibration, reason=f"{recall.reason} (recall {recall.id})", by=by)
    recall.confirmed_by, recall.confirmed_at = by, utc_now()
    session.flush()


def review(session: Session, recall: Recall) -> list[Condemned]:
    """Return every version of a recall with its status, and its measurements with their successors."""
    ids = recall.calibration_ids
    status = read_version_statuses(session, ids)
    rows = session.execute(
        select(Calibration, Camera)
        .join(Camera, Camera.id == Calibration.camera_id)
        .where(Calibration.id.in_(ids))
        .order_by(Camera.id, Calibration.method, Calibration.version)
    )
    return [
        Condemned(
            calibration=row[0],
            camera=row[1],
            status=status[row[0].id],
            measurements=list_touched(session, row[0], without=ids),
        )
        for row in rows
    ]


def _in_locking_order(session: Session, ids: list[str]) -> list[Calibration]:
    """Return the versions in an order in which concurrent recalls lock the same slots."""
    rows = session.scalars(select(Calibration).where(Calibration.id.in_(ids)))
    return sorted(
        rows,
        key=lambda row: (row.camera_id, row.method, json.dumps(row.configuration, sort_keys=True), row.id),
    )


def _by_meter(session: Session, mine: Select[Any], meter: Meter) -> list[str]:
    """Find versions by meter, in the campaigns with a reading of it: readings are never deleted."""
    had_it = select(Reading.campaign_id).where(Reading.meter_id == meter.id)
    rows = session.execute(
        mine.add_columns(Calibration.inputs["meters"]).where(Calibration.campaign_id.in_(had_it))
    )
    engraved = [getattr(meter, name) for name in _ENGRAVED]
    return sorted(
        row[0] for row in rows if any([used[name] for name in _ENGRAVED] == engraved for used in row[1] or [])
    )


def _by_certificate(session: Session, mine: Select[Any], number: str) -> list[str]:
    rows = session.execute(mine.add_columns(Calibration.inputs["meters"]))
    return sorted(
        row[0]
        for row in rows
        if any(used.get("certificate", {}).get("number") == number for used in row[1] or [])
    )


def _recorded_by(recorder: str) -> Select[Any]:
    """Select the campaigns that name this recorder, or did before."""
    once = select(AuditEntry.subject_id).where(
        AuditEntry.subject_type == "campaign", AuditEntry.after["recorder"].as_string() == recorder
    )
    return select(Campaign.id).where(or_(Campaign.recorder == recorder, Campaign.id.in_(once)))
