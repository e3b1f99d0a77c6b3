"""All versions made with something that turned out wrong: found by what they recorded, revoked as one.

A version's own inputs say by which meters, under which certificates and with which software it was made: what
has been replaced since does not hide it.
"""

import json
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Select, or_, select
from sqlalchemy.orm import Session

from store.columns import utc_now
from store.errors import Conflict
from store.impact import Touched, list_touched
from store.publications import revoke
from store.queries.calibrations import Standing, standings
from store.tables import AuditEntry, Calibration, Camera, Campaign, Meter, Purge, Reading

_ENGRAVED = ("kind", "make", "model", "serial")


@dataclass(frozen=True, kw_only=True)
class Condemned:
    """A version that a purge finds, how it stands, and the measurements that lose it."""

    calibration: Calibration
    camera: Camera
    standing: Standing
    measurements: list[Touched]


def find_versions(session: Session, organisation_id: str, cause: dict[str, str]) -> list[str]:
    """The ids of every version made with the cause, drafts and revoked ones too, in order."""
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


def propose(session: Session, organisation_id: str, cause: dict[str, str], *, reason: str, by: str) -> Purge:
    """Write down what the cause finds, for somebody to look at and confirm."""
    purge = Purge(
        organisation_id=organisation_id,
        cause=cause,
        reason=reason,
        calibration_ids=find_versions(session, organisation_id, cause),
        created_by=by,
    )
    session.add(purge)
    session.flush()
    return purge


def confirm(session: Session, purge: Purge, *, by: str) -> None:
    """Revoke every version of a purge in this transaction; what is confirmed already stays as it is."""
    session.refresh(purge, with_for_update=True)
    if purge.confirmed_at is not None:
        return
    found = find_versions(session, purge.organisation_id, purge.cause)
    if found != purge.calibration_ids:
        more, fewer = set(found) - set(purge.calibration_ids), set(purge.calibration_ids) - set(found)
        raise Conflict(
            "purge_outdated",
            f"The cause finds other versions now than when this was reviewed: {len(more)} more, "
            f"{len(fewer)} fewer. Propose it anew, and look again.",
        )
    for calibration in _in_locking_order(session, found):
        revoke(session, calibration, reason=f"{purge.reason} (purge {purge.id})", by=by)
    purge.confirmed_by, purge.confirmed_at = by, utc_now()
    session.flush()


def review(session: Session, purge: Purge) -> list[Condemned]:
    """Every version of a purge as it stands now, with what another would make of its measurements."""
    ids = purge.calibration_ids
    standing = standings(session, ids)
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
            standing=standing[row[0].id],
            measurements=list_touched(session, row[0], without=ids),
        )
        for row in rows
    ]


def _in_locking_order(session: Session, ids: list[str]) -> list[Calibration]:
    """Two purges that touch the same slots lock them in the same order."""
    rows = session.scalars(select(Calibration).where(Calibration.id.in_(ids)))
    return sorted(
        rows,
        key=lambda row: (row.camera_id, row.method, json.dumps(row.configuration, sort_keys=True), row.id),
    )


def _by_meter(session: Session, mine: Select[Any], meter: Meter) -> list[str]:
    """A campaign that never had a reading of the meter is not looked at: its readings are never deleted."""
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
    """Campaigns that name this recorder, or once did."""
    once = select(AuditEntry.subject_id).where(
        AuditEntry.subject_type == "campaign", AuditEntry.after["recorder"].as_string() == recorder
    )
    return select(Campaign.id).where(or_(Campaign.recorder == recorder, Campaign.id.in_(once)))
