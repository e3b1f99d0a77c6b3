"""A database with many published versions and measurements: no frame is decoded for it.

What look-ups and series read is made by the product's own functions.
"""

import hashlib
import json
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import text
from sqlalchemy.orm import Session

from bench.bulk import write_rows
from bench.subject import CAMERA
from store.database import Database
from store.ready.rows import make_measured, make_ready
from store.tables import (
    Base,
    Blob,
    Calibration,
    Camera,
    Campaign,
    CoefficientRow,
    FrameRow,
    IssuedCertificate,
    MeasuredRow,
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
Rows = Iterator[tuple[type[Base], Row]]


def fill(database: Database, *, coefficients: int, measurements: int, first: int = 0) -> list[str]:
    """Add cameras with ten published versions of ten coefficients each, until there are so many coefficients.

    The measurements are of the first of them. ``first`` numbers the first camera. Returns the cameras' ids.
    """
    cameras = range(first, coefficients // (VERSIONS * len(ISOS)))
    with database.writing("bench") as session:
        organisation = session.query(Organisation).filter(Organisation.operator).one().id
        _write(session, (row for camera in cameras for row in _make_camera(organisation, camera)))
        _write(session, _make_measurements(organisation, first, measurements))
        if not database.is_sqlite:
            # a service's own server does this by itself
            session.execute(text("ANALYZE"))
    return [f"cam_{camera}" for camera in cameras]


def _write(session: Session, rows: Rows) -> None:
    page: dict[type[Base], list[Row]] = {}
    for number, (table, row) in enumerate(rows, 1):
        page.setdefault(table, []).append(row)
        if number % _PAGE == 0:
            write_rows(session, page)
            # the tables keep their order, which is that of their foreign keys
            page = {each: [] for each in page}
    write_rows(session, page)


def _make_camera(organisation: str, camera: int) -> Rows:
    body = CAMERA.body
    named = {"make": body.make, "model": body.model, "serial": f"{camera:08}"}
    of = {"camera_id": f"cam_{camera}", "method": METHOD}
    yield Camera, {"id": f"cam_{camera}", "organisation_id": organisation, **named}
    yield Campaign, {"id": f"cmp_{camera}", "organisation_id": organisation, **of}
    yield Slot, {"id": camera + 1, "configuration": "{}", **of}
    document = _sha(f"certificate {camera}")
    yield Blob, {"sha256": document, "size_bytes": 1}
    for version in range(1, VERSIONS + 1):
        calibration = _calibration(organisation, camera, version)
        publication = _publication(camera, version)
        coefficients = [_coefficient(camera, version, place) for place in range(len(ISOS))]
        rows = [CoefficientRow(**each) for each in coefficients]
        made = make_ready(Publication(**publication), Calibration(**calibration), rows)
        yield Calibration, calibration
        yield Publication, publication
        # or the service would issue them, beside what is measured
        yield IssuedCertificate, _issue(publication, document)
        yield from ((CoefficientRow, each) for each in coefficients)
        yield from made.items()


def _calibration(organisation: str, camera: int, version: int) -> Row:
    nothing: dict[str, Row] = {name: {} for name in ("configuration", "parameters", "inputs", "software")}
    return {
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


def _publication(camera: int, version: int) -> Row:
    return {
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


def _issue(publication: Row, document: str) -> Row:
    return {
        "calibration_id": publication["calibration_id"],
        "amendment": 0,
        "number": publication["calibration_id"],
        "publication_id": publication["id"],
        "json_sha256": document,
        "pdf_sha256": document,
        "at_upgrade": False,
        "issued_at": publication["known_from"],
    }


def _coefficient(camera: int, version: int, place: int) -> Row:
    return {
        "calibration_id": f"cal_{camera}_{version}",
        "position": place,
        "name": "dark_signal_dn",
        "value": 64.0 + (7 * camera + 3 * version + place) / 977.0,
        "standard_uncertainty": 0.43 + place / 991.0,
        "unit": "DN",
        "iso": ISOS[place],
        "model": "mean",
        "flags": [],
    }


def _make_measurements(organisation: str, camera: int, count: int) -> Rows:
    body = next(Camera(**row) for table, row in _make_camera(organisation, camera) if table is Camera)
    versions = [Calibration(**_calibration(organisation, camera, 1 + each)) for each in range(VERSIONS)]
    for number in range(count):
        frame = _frame(camera, number)
        measurement = _measurement(organisation, camera, number)
        made = Measurement(**measurement), FrameRow(**frame), versions[number % VERSIONS], body
        yield Blob, {"sha256": frame["sha256"], "size_bytes": 1}
        yield FrameRow, frame
        yield Measurement, measurement
        yield MeasuredRow, make_measured(*made)


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
