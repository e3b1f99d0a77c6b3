"""Effect of a decision about a version, and recalls: all versions with a common cause, revoked together."""

import json
from collections.abc import Callable, Collection, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import Select, or_, select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from radiometry.fitting.comparison import Comparison, MeasuredChange, compare_quantities
from radiometry.fitting.evidence import Quantity
from radiometry.methods import METHODS, get_method
from radiometry.records import Record
from radiometry.specification.application import BandApplication, SurfaceApplication
from store import codec, database, tables
from store.measuring.comparison import Reference, compare_meters, compare_panels, touch_band
from store.measuring.version import list_corrected
from store.publications import InForce, list_held, revoke
from store.queries import add, by_id
from store.queries.calibrations import VersionStatus, coefficients_of, read_version_statuses
from store.queries.frame_times import FrameClocks, FrameTime
from store.tables import Calibration, Camera, CoefficientRow, FrameRow, Measurement, Recall, Road, RoadResult
from store.tables.base import utc_now


class Touched(Record):
    """A measurement made with a version, and what another would make of it."""

    measurement: Measurement
    frame: FrameRow
    successor: Calibration | None = None
    change: MeasuredChange | None = None
    why: str | None


class CoefficientChange(Record):
    """A coefficient of two versions. ``comparison`` : None where their units differ."""

    old: CoefficientRow
    new: CoefficientRow
    comparison: Comparison | None


class Impact(Record):
    """A version against the one in force; each flag with where it is."""

    against: InForce
    meter_calibration: Reference
    coefficients: list[CoefficientChange]
    isos_gained: list[float]
    isos_lost: list[float]
    flags_gained: list[tuple[str, str]]
    flags_lost: list[tuple[str, str]]
    measurements: list[Touched]


def find_in_force(session: Session, calibration: Calibration, at: datetime) -> InForce | None:
    """Return what holds the version's own slot at a time, as far as is known now."""
    return next((held for held in _list_open(session, calibration) if held.holds(at, at)), None)


def assess(session: Session, calibration: Calibration, against: InForce) -> Impact:
    old = against.calibration
    shared, common = _compare_references(old, calibration)
    rows = coefficients_of(session, [old.id, calibration.id])
    isos = {key: {row.iso for row in rows[key] if row.iso is not None} for key in (old.id, calibration.id)}
    flags = {
        version.id: {(flag["flag"], flag["where"]) for flag in version.result.get("flags", [])}
        for version in (old, calibration)
    }
    return Impact(
        against=against,
        meter_calibration=shared,
        coefficients=_compare(rows[old.id], rows[calibration.id], common),
        isos_gained=sorted(isos[calibration.id] - isos[old.id]),
        isos_lost=sorted(isos[old.id] - isos[calibration.id]),
        flags_gained=sorted(flags[calibration.id] - flags[old.id]),
        flags_lost=sorted(flags[old.id] - flags[calibration.id]),
        measurements=[_touch(*row, old, calibration) for row in _measured_with(session, old)],
    )


def list_touched(
    session: Session, calibration: Calibration, *, without: Collection[str] = ()
) -> list[Touched]:
    """The measurements made with a version, each with what would take its place if these versions went."""
    gone = {calibration.id, *without}
    others = [held for held in _list_open(session, calibration) if held.calibration.id not in gone]
    touched, clocks = [], FrameClocks(session)
    for measurement, frame in _measured_with(session, calibration):
        successor, why = _find_successor(clocks.find(frame), others)
        kept = Touched(measurement=measurement, frame=frame, why=why)
        touched.append(_touch(measurement, frame, calibration, successor) if successor else kept)
    return touched


def list_roads(session: Session, calibration: Calibration) -> list[tuple[RoadResult, Road]]:
    """Return the evaluations of roads that rest on a version: by K, lens or geometry of a frame."""
    frames = RoadResult.inputs["frames"].as_string()
    ids = [calibration.id, *list_corrected(session, calibration)]
    rows = session.execute(
        select(RoadResult, Road)
        .join(Road, Road.id == RoadResult.road_id)
        .where(RoadResult.organisation_id == calibration.organisation_id)
        .where(or_(*(frames.contains(each, autoescape=True) for each in ids)))
        .order_by(RoadResult.id)
    )
    return [(row[0], row[1]) for row in rows]


def _find_successor(taken: FrameTime | None, others: Sequence[InForce]) -> tuple[Calibration | None, str]:
    if taken is None:
        return None, "The frame does not state when it was taken."
    for held in others:
        if held.holds(taken.earliest, taken.latest):
            return held.calibration, ""
    return None, "No other version is in force when the frame was taken."


def _touch(measurement: Measurement, frame: FrameRow, old: Calibration, new: Calibration) -> Touched:
    application = get_method(old.method).application
    if isinstance(application, BandApplication) and old.method == new.method:
        change = touch_band(application, measurement, frame, old, new)
        return Touched(measurement=measurement, frame=frame, successor=new, change=change, why=change.why)
    if not isinstance(application, SurfaceApplication) or frame.exposure is None:
        told = [spec.name for spec in METHODS if spec.reference is not None and spec.application]
        why = f"What changes is told for versions of {' and '.join(told)} only."
        return Touched(measurement=measurement, frame=frame, successor=new, why=why)
    lens_share = application.summarise(measurement.result).figures["lens_share"]
    change = application.change(
        codec.read_applied(old),
        codec.read_applied(new),
        exposure=codec.decode_exposure(frame.exposure),
        signal_dn=measurement.result.get("signal_dn"),
        lens_share=lens_share["value"] if lens_share else 1.0,
        common_u_rel=compare_meters(old, new)[1],
    )
    return Touched(measurement=measurement, frame=frame, successor=new, change=change, why=change.why)


def _measured_with(session: Session, calibration: Calibration) -> list[tuple[Measurement, FrameRow]]:
    rows = session.execute(
        select(Measurement, FrameRow)
        .join(FrameRow, FrameRow.id == Measurement.frame_id)
        .where(Measurement.calibration_id.in_([calibration.id, *list_corrected(session, calibration)]))
        .order_by(Measurement.id)
    )
    return [(row[0], row[1]) for row in rows]


def _list_open(session: Session, calibration: Calibration) -> list[InForce]:
    """Every validity that stands in the slot of a version, in the order of time."""
    return list_held(
        session,
        tables.Slot.camera_id == calibration.camera_id,
        tables.Slot.method == calibration.method,
        tables.Slot.configuration == json.dumps(calibration.configuration, sort_keys=True),
    )


def _compare_references(
    old: Calibration, new: Calibration
) -> tuple[Reference, dict[tuple[str, str | None], float]]:
    """Compare the meters or panel of two versions; return the error that they share, by coefficient, band."""
    spec = get_method(old.method)
    name = spec.coefficients[0].name
    if old.method == new.method and spec.reference == "panel":
        shared, of_bands = compare_panels(old, new)
        return shared, {(name, band): u_rel for band, u_rel in of_bands.items()}
    shared, u_rel = compare_meters(old, new)
    # the meter's error is in K alone, and in no semilogarithmic slope
    return shared, {(name, None): u_rel}


def _compare(
    old: list[CoefficientRow], new: list[CoefficientRow], common: dict[tuple[str, str | None], float]
) -> list[CoefficientChange]:
    found = {_key(row): row for row in new}
    pairs = [(row, found[_key(row)]) for row in old if _key(row) in found]
    return [
        CoefficientChange(
            old=before,
            new=after,
            comparison=compare_quantities(
                _quantity(before), _quantity(after), common_u_rel=common.get((before.name, before.band), 0.0)
            )
            if before.unit == after.unit
            else None,
        )
        for before, after in pairs
    ]


def _key(row: CoefficientRow) -> tuple[Any, ...]:
    # a position is part of sharpness's model, "slanted_edge:top-left"; elsewhere a new model is a change
    _, _, position = row.model.partition(":")
    return row.name, row.iso, row.f_number, row.band, row.channel, position


def _quantity(row: CoefficientRow) -> Quantity:
    return Quantity(value=row.value, standard_uncertainty=row.standard_uncertainty, unit=row.unit)


_ENGRAVED = ("kind", "make", "model", "serial")


class Condemned(Record):
    calibration: Calibration
    camera: Camera
    status: VersionStatus
    measurements: list[Touched]
    roads: list[tuple[RoadResult, Road]]


def find_versions(session: Session, organisation_id: str, cause: dict[str, str]) -> list[str]:
    """Return the ids of all versions made with the cause, drafts and revoked versions included, in order."""
    ((kind, value),) = cause.items()
    mine = select(Calibration.id).where(Calibration.organisation_id == organisation_id)
    match kind:
        case "meter_id":
            meter = session.get_one(tables.Meter, value)
            engraved = {name: getattr(meter, name) for name in _ENGRAVED}
            # in the campaigns with a reading of it: readings are never deleted
            had_it = select(tables.Reading.campaign_id).where(tables.Reading.meter_id == meter.id)
            mine = mine.where(Calibration.campaign_id.in_(had_it))
            return _by_meter(session, mine, lambda used: engraved.items() <= used.items())
        case "meter_certificate_number":
            return _by_meter(session, mine, lambda used: used.get("certificate", {}).get("number") == value)
        case "software":
            return sorted(session.scalars(mine.where(Calibration.software["stilb"].as_string() == value)))
        case _:
            # campaigns that name this recorder, or did before
            once = select(tables.AuditEntry.subject_id).where(
                tables.AuditEntry.subject_type == "campaign",
                tables.AuditEntry.after["recorder"].as_string() == value,
            )
            named = select(tables.Campaign.id).where(
                or_(tables.Campaign.recorder == value, tables.Campaign.id.in_(once))
            )
            return sorted(session.scalars(mine.where(Calibration.campaign_id.in_(named))))


def propose(session: Session, organisation_id: str, cause: dict[str, str], *, reason: str, by: str) -> Recall:
    ids = find_versions(session, organisation_id, cause)
    said = {"cause": cause, "reason": reason, "calibration_ids": ids, "created_by": by}
    return add(session, Recall(organisation_id=organisation_id, **said))


def confirm(session: Session, recall: Recall, *, by: str) -> None:
    """Revoke every version of a recall in this transaction. A confirmed recall is not changed."""
    session.refresh(recall, with_for_update=True)
    if recall.confirmed_at is not None:
        return
    found = find_versions(session, recall.organisation_id, recall.cause)
    if found != recall.calibration_ids:
        more, fewer = set(found) - set(recall.calibration_ids), set(recall.calibration_ids) - set(found)
        raise database.Conflict(
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
    both = select(Calibration, Camera).join(Camera, Camera.id == Calibration.camera_id)
    rows = both.where(Calibration.id.in_(ids)).order_by(Camera.id, Calibration.method, Calibration.version)
    return [
        Condemned(
            calibration=row[0],
            camera=row[1],
            status=status[row[0].id],
            measurements=list_touched(session, row[0], without=ids),
            roads=list_roads(session, row[0]),
        )
        for row in session.execute(rows)
    ]


def _in_locking_order(session: Session, ids: list[str]) -> list[Calibration]:
    """Return the versions in an order in which concurrent recalls lock the same slots."""

    def place(row: Calibration) -> tuple[str, ...]:
        return row.camera_id, row.method, json.dumps(row.configuration, sort_keys=True), row.id

    return sorted(by_id(session, Calibration, ids).values(), key=place)


def _by_meter(session: Session, mine: Select[Any], fits: Callable[[dict[str, Any]], bool]) -> list[str]:
    """Return the ids of versions with a meter, as they kept it, that fits."""
    rows = session.execute(mine.add_columns(Calibration.inputs["meters"]))
    return sorted(row[0] for row in rows if any(map(fits, row[1] or [])))
