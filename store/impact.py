"""Effect of a decision about a version: on coefficients, and on the measurements that were made with it."""

import json
from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.fitting.comparison import Comparison, compare_quantities
from radiometry.fitting.evidence import Quantity
from radiometry.methods import get_method
from radiometry.records import Record
from store.measuring.comparison import Reference, compare_meters, compare_panels
from store.measuring.version import list_corrected
from store.publications import InForce, list_held
from store.queries.calibrations import coefficients_of
from store.queries.frame_times import FrameClocks, FrameTime
from store.tables import (
    Calibration,
    CoefficientRow,
    FrameRow,
    Measurement,
    Slot,
)


class Touched(Record):
    """A measurement made with a version, and the version that would take its place."""

    measurement: Measurement
    frame: FrameRow
    successor: Calibration | None


class CoefficientChange(Record):
    """A coefficient of two versions. ``comparison`` : None where their units differ."""

    old: CoefficientRow
    new: CoefficientRow
    comparison: Comparison | None


class Impact(Record):
    """A version against the one in force.

    ``flags_gained``, ``flags_lost`` : (flag, where)
    """

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
    """Compare a version with the one in force: what publishing it changes."""
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
        measurements=[
            Touched(measurement=measurement, frame=frame, successor=calibration)
            for measurement, frame in _measured_with(session, old)
        ],
    )


def list_touched(session: Session, calibration: Calibration) -> list[Touched]:
    """Return the measurements made with a version, each with what is in force in its place."""
    others = [held for held in _list_open(session, calibration) if held.calibration.id != calibration.id]
    clocks = FrameClocks(session)
    return [
        Touched(measurement=measurement, frame=frame, successor=_find_successor(clocks.find(frame), others))
        for measurement, frame in _measured_with(session, calibration)
    ]


def _find_successor(taken: FrameTime | None, others: Sequence[InForce]) -> Calibration | None:
    if taken is None:
        return None
    held_then = (held.calibration for held in others if held.holds(taken.earliest, taken.latest))
    return next(held_then, None)


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
        Slot.camera_id == calibration.camera_id,
        Slot.method == calibration.method,
        Slot.configuration == json.dumps(calibration.configuration, sort_keys=True),
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
