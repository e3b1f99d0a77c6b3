"""A database with many published versions and measurements, written as rows: no frame is decoded for it."""

import hashlib
import json
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from itertools import islice
from typing import Any

from sqlalchemy import insert, text
from sqlalchemy.orm import Session

from bench.subject import CAMERA
from store.database import Database
from store.ready.backfill import write_missing
from store.tables import (
    Base,
    Blob,
    Calibration,
    Camera,
    Campaign,
    CoefficientRow,
    FrameRow,
    Measurement,
    Organisation,
    Publication,
    Slot,
)

ISOS = (100.0, 200.0, 400.0, 800.0, 1600.0, 3200.0, 6400.0, 12800.0, 25600.0, 51200.0)
VERSIONS = 10
"""Versions of each camera."""
METHOD = "luminance"
_BEGIN = datetime(2020, 1, 1, tzinfo=UTC)
_PAGE = 20_000
Row = dict[str, Any]


def fill(database: Database, *, coefficients: int, measurements: int, first: int = 0) -> list[str]:
    """Add cameras with ten published versions of ten coefficients each; return the cameras' ids.

    The measurements are of the first of them. ``first`` numbers the first camera.
    """
    cameras = range(first, first + max(1, coefficients // (VERSIONS * len(ISOS))))
    with database.writing("bench") as session:
        organisation = session.query(Organisation).filter(Organisation.operator).one().id
        for table, make in _PARTS:
            _insert(session, table, (row for camera in cameras for row in make(organisation, camera)))
        _insert(
            session, Blob, ({"sha256": _sha(f"{first} {n}"), "size_bytes": 1} for n in range(measurements))
        )
        _insert(session, FrameRow, (_frame(first, number) for number in range(measurements)))
        rows = (_measurement(organisation, first, number) for number in range(measurements))
        _insert(session, Measurement, rows)
        write_missing(session)
        if not database.is_sqlite:
            # a service's own server does this by itself
            session.execute(text("ANALYZE"))
    return [f"cam_{camera}" for camera in cameras]


def _insert(session: Session, table: type[Base], rows: Iterator[Row]) -> None:
    while page := list(islice(rows, _PAGE)):
        session.execute(insert(table.__table__), page)


def _cameras(organisation: str, camera: int) -> Iterator[Row]:
    body = CAMERA.body
    named = {"make": body.make, "model": body.model, "serial": f"{camera:08}"}
    yield {"id": f"cam_{camera}", "organisation_id": organisation, **named}


def _campaigns(organisation: str, camera: int) -> Iterator[Row]:
    of = {"organisation_id": organisation, "camera_id": f"cam_{camera}", "method": METHOD}
    yield {"id": f"cmp_{camera}", **of}


def _slots(_organisation: str, camera: int) -> Iterator[Row]:
    yield {"id": camera + 1, "camera_id": f"cam_{camera}", "method": METHOD, "configuration": "{}"}


def _calibrations(organisation: str, camera: int) -> Iterator[Row]:
    nothing: dict[str, Row] = {name: {} for name in ("configuration", "parameters", "inputs", "software")}
    for version in range(1, VERSIONS + 1):
        yield {
            "id": f"cal_{camera}_{version}",
            "organisation_id": organisation,
            "camera_id": f"cam_{camera}",
            "campaign_id": f"cmp_{camera}",
            "method": METHOD,
            "version": version,
            "result": {"flags": []},
            "result_schema": 1,
            "content_sha256": _sha(f"{camera} {version}"),
            "created_by": "bench",
            "created_at": _begin(version),
            **nothing,
        }


def _publications(_organisation: str, camera: int) -> Iterator[Row]:
    for version in range(1, VERSIONS + 1):
        yield {
            "id": f"pub_{camera}_{version}",
            "slot_id": camera + 1,
            "calibration_id": f"cal_{camera}_{version}",
            "valid_from": _begin(version),
            "valid_to": None if version == VERSIONS else _begin(version + 1),
            "known_from": _begin(version) + timedelta(hours=1),
            "known_to": None,
            "reason": "annual calibration",
            "superseded_by": None,
        }


def _coefficients(_organisation: str, camera: int) -> Iterator[Row]:
    for version in range(1, VERSIONS + 1):
        for place, iso in enumerate(ISOS):
            yield {
                "calibration_id": f"cal_{camera}_{version}",
                "position": place,
                "name": "dark_signal_dn",
                "value": 64.0 + (7 * camera + 3 * version + place) / 977.0,
                "standard_uncertainty": 0.43 + place / 991.0,
                "unit": "DN",
                "iso": iso,
                "model": "mean",
                "flags": [],
            }


_PARTS: tuple[tuple[type[Base], Callable[[str, int], Iterator[Row]]], ...] = (
    (Camera, _cameras),
    (Campaign, _campaigns),
    (Slot, _slots),
    (Calibration, _calibrations),
    (CoefficientRow, _coefficients),
    (Publication, _publications),
)


def _frame(camera: int, number: int) -> Row:
    taken = _BEGIN + timedelta(minutes=number)
    place = {"latitude_deg": 47.0 + number / 1e6, "longitude_deg": 8.0 + number / 1e6, "altitude_m": 512.5}
    return {
        "id": f"frm_{camera}_{number:08}",
        "campaign_id": f"cmp_{camera}",
        "sha256": _sha(f"{camera} {number}"),
        "filename": f"DJI_{number:08}.DNG",
        "role": "field",
        "state": "extracted",
        "header": {"taken_at": taken.isoformat(), **place},
        "exposure": {"iso": 3200.0},
    }


def _measurement(organisation: str, camera: int, number: int) -> Row:
    value = 20.0 + number / 977.0
    return {
        "id": f"msr_{camera}_{number:08}",
        "organisation_id": organisation,
        "campaign_id": f"cmp_{camera}",
        "frame_id": f"frm_{camera}_{number:08}",
        "calibration_id": f"cal_{camera}_{1 + number % VERSIONS}",
        "method": METHOD,
        "parameters": {"region_origin": "campaign"},
        "result": {
            **{name: _quantity(value * factor) for name, factor in _FACTORS.items()},
            "illuminance_lx": None,
            "percentiles": [{"percent": p, "luminance": _quantity(value * p / 50)} for p in (5, 10, 90, 95)],
            "pixels": 48_000,
            "saturated_share": 0.0,
            "vignetting": "none",
            "channel": "G",
            "surface": None,
            "flags": [],
        },
        "result_schema": 1,
        "software": {},
        "content_sha256": _sha(f"measured {camera} {number}"),
        "created_by": "bench",
        "created_at": _BEGIN + timedelta(days=3000, seconds=number),
    }


_FACTORS = {"mean": 1.0, "smallest": 0.7, "largest": 1.3, "median": 0.99}


def _quantity(value: float) -> Row:
    return {"value": value, "standard_uncertainty": value * 0.0137, "unit": "cd/m2"}


def _begin(version: int) -> datetime:
    return _BEGIN + timedelta(days=200 * version)


def _sha(text: str) -> str:
    return hashlib.sha256(json.dumps(text).encode()).hexdigest()
