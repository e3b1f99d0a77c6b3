"""The ready row and answer of a publication."""

import hashlib
import json
from datetime import UTC, datetime
from typing import Any

from pydantic_core import to_json
from sqlalchemy import insert, select, update
from sqlalchemy.orm import Session

from radiometry.methods import get_method
from radiometry.specification.application import SurfaceApplication
from store.applied import read_applied
from store.ready.records import write_record
from store.tables import (
    Base,
    Calibration,
    CoefficientRow,
    Publication,
    ReadyAnswer,
    ReadyCells,
    ReadyRow,
)

_PLAIN = ("name", "value", "standard_uncertainty", "unit", "iso", "f_number", "band", "channel", "model")


def show_instant(instant: datetime) -> str:
    """Format an instant for a sentence, to the second."""
    return write_instant(instant.replace(microsecond=0))


def write_instant(instant: datetime) -> str:
    """Format an instant in UTC as RFC 3339 does."""
    return instant.astimezone(UTC).isoformat().replace("+00:00", "Z")


def describe_validity(version: int, publication: Publication) -> str:
    """Return which version is in force and for how long, as the beginning of a sentence."""
    end = f"to {show_instant(publication.valid_to)}" if publication.valid_to else "on"
    return f"version {version} is in force from {show_instant(publication.valid_from)} {end}"


def write_ready(session: Session, publications: list[Publication]) -> None:
    """Write the ready rows of publications, which the session has flushed."""
    ids = list({row.calibration_id for row in publications})
    versions = {row.id: row for row in session.scalars(select(Calibration).where(Calibration.id.in_(ids)))}
    coefficients: dict[str, list[CoefficientRow]] = {each: [] for each in ids}
    owned = select(CoefficientRow).where(CoefficientRow.calibration_id.in_(ids))
    for each in session.scalars(owned.order_by(CoefficientRow.position)):
        coefficients[each.calibration_id].append(each)
    made = [
        make_ready(row, versions[row.calibration_id], coefficients[row.calibration_id])
        for row in publications
    ]
    for table in (ReadyRow, ReadyAnswer, ReadyCells):
        session.execute(insert(table), [each[table] for each in made])


def make_ready(
    publication: Publication,
    calibration: Calibration,
    coefficients: list[CoefficientRow],
) -> dict[type[Base], dict[str, Any]]:
    """Return the columns of a publication's ready row, of its answer and of its cells, by table."""
    ready = {
        "publication_id": publication.id,
        "slot_id": publication.slot_id,
        "organisation_id": calibration.organisation_id,
        "camera_id": calibration.camera_id,
        "campaign_id": calibration.campaign_id,
        "method": calibration.method,
        "calibration_id": calibration.id,
        "version": calibration.version,
        "computed_at": calibration.created_at,
        "valid_from": publication.valid_from,
        "valid_to": publication.valid_to,
        "known_from": publication.known_from,
        "known_to": publication.known_to,
        "coefficients": len(coefficients),
    }
    records = _write_records(publication, calibration, coefficients)
    return {
        ReadyRow: ready,
        ReadyAnswer: _write_answer(publication, calibration, coefficients),
        ReadyCells: {"publication_id": publication.id, "cells": records},
    }


def close_ready(session: Session, publication: Publication) -> None:
    """End the knowledge of a ready row with that of its publication."""
    closing = update(ReadyRow).where(ReadyRow.publication_id == publication.id)
    session.execute(closing.values(known_to=publication.known_to))


def _write_answer(
    publication: Publication, calibration: Calibration, coefficients: list[CoefficientRow]
) -> dict[str, Any]:
    why = (
        f"{describe_validity(calibration.version, publication)}, known since "
        f"{show_instant(publication.known_from)}: {publication.reason}"
    )
    more = {
        "calibration_id": calibration.id,
        "version": calibration.version,
        "valid_from": write_instant(publication.valid_from),
        "valid_to": write_instant(publication.valid_to) if publication.valid_to else None,
        "why": why,
    }
    spec = get_method(calibration.method)
    items: list[dict[str, Any]] = []
    for row in coefficients:
        scope = spec.find_scope(row.name, row.flags)
        item = {name: getattr(row, name) for name in _PLAIN}
        item |= {"flags": row.flags, "uncertainty_scope": scope, **more}
        items.append({name: value for name, value in item.items() if value is not None})
    content = to_json(items)
    foreseen = _foresee(calibration, coefficients)
    general = {key_of(item) for item in items if "f_number" not in item}
    return {
        "publication_id": publication.id,
        "etag": hashlib.sha256(content + (foreseen or "").encode()).hexdigest()[:32],
        "whole": not any("f_number" in item and key_of(item) in general for item in items),
        "foreseen": foreseen,
        "items": content,
    }


def _write_records(
    publication: Publication, calibration: Calibration, coefficients: list[CoefficientRow]
) -> str:
    """Write the rows of a series of coefficients, a line each, without the camera and its names."""
    ended = write_instant(publication.valid_to) if publication.valid_to else None
    tail = (
        *(write_instant(publication.valid_from), ended),
        *(calibration.campaign_id, write_instant(calibration.created_at)),
    )
    return "\n".join(
        write_record(
            (
                *(calibration.method, calibration.version, calibration.id, row.name, float(row.value)),
                *(float(row.standard_uncertainty), row.unit, *map(_as_float, (row.iso, row.f_number))),
                *(row.band, row.channel, row.model, " ".join(row.flags), *tail),
            )
        )
        for row in coefficients
    )


def _as_float(value: float | None) -> float | None:
    return None if value is None else float(value)


def key_of(item: dict[str, Any]) -> tuple[object, ...]:
    """Return what a coefficient is of, apart from its f-number."""
    return tuple(item.get(name) for name in ("name", "iso", "band", "channel", "model"))


def _foresee(calibration: Calibration, coefficients: list[CoefficientRow]) -> str | None:
    """Return the standard uncertainty of each general headline coefficient at an uncalibrated f-number."""
    spec = get_method(calibration.method)
    general = [
        (place, row)
        for place, row in enumerate(coefficients)
        if row.f_number is None and row.name == spec.coefficients[0].name
    ]
    if not general or not isinstance(spec.application, SurfaceApplication):
        return None
    applied = read_applied(calibration)
    return json.dumps({place: spec.application.foresee(applied, iso=row.iso) for place, row in general})
