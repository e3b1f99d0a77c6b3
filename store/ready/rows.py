"""Ready rows: a publication with its answer, and a measurement as a row of a series."""

import csv
import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, Final

from pydantic_core import to_json
from sqlalchemy import insert, select, update
from sqlalchemy.orm import Session

from radiometry.fitting.curve import coverage_factor
from radiometry.methods import get_method
from radiometry.specification.application import SurfaceApplication
from store import tables
from store.codec import read_applied
from store.queries import by_id
from store.queries.calibration_record import state_coefficients
from store.queries.calibrations import coefficients_of
from store.queries.frame_times import Zones, read_frame_time
from store.tables import Calibration, Camera, FrameRow, MeasuredRow, Measurement, Publication, ReadyRow

Value = str | float | int | None

_PLAIN: Final = re.compile(r"(?:[\w%°(][\w%°(). :/*+-]*)?")
"""Texts that every reader takes as they are: CSV and JSON, and a spreadsheet for no formula."""


def write_record(values: Iterable[Value]) -> str:
    """Write a CSV record without its line end; an absent value is an empty cell."""
    return ",".join(map(_write, values))


def is_plain(records: str) -> bool:
    """Return True if no cell is quoted: each comma ends one, and each text is one that all readers take."""
    return '"' not in records


def split_records(records: Sequence[str]) -> list[Sequence[str]]:
    joined = ",".join(records)
    if not is_plain(joined):
        return list(zip(*csv.reader(records), strict=True))
    # one list of all cells: a list for each record would be collected as garbage time and again
    cells, width = joined.split(","), records[0].count(",") + 1
    return [cells[place::width] for place in range(width)]


def read_records(lines: str) -> list[str]:
    """Return the records of a text that has one a line; a quoted cell may have lines of its own."""
    if is_plain(lines):
        return lines.split("\n") if lines else []
    records: list[str] = []
    for line in lines.split("\n"):
        if records and records[-1].count('"') % 2:
            records[-1] += f"\n{line}"
        else:
            records.append(line)
    return records


def _write(value: Value) -> str:
    if value is None:
        return ""
    if not isinstance(value, str):
        # repr gives a float its shortest exact form
        return repr(value)
    return value if _PLAIN.fullmatch(value) else '"' + value.replace('"', '""') + '"'


_ITEM = (
    *("name", "value", "standard_uncertainty", "unit", "iso", "f_number", "band", "channel", "model"),
    "flags",
)


_COVERAGE = ("effective_dof", "coverage_factor", "expanded_uncertainty")
_PUBLISHED = ("slot_id", "valid_from", "valid_to", "known_from", "known_to")
_CALIBRATED = ("organisation_id", "camera_id", "campaign_id", "method", "version")


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
    versions, coefficients = by_id(session, Calibration, ids), coefficients_of(session, ids)
    made = [
        make_ready(row, versions[row.calibration_id], coefficients[row.calibration_id])
        for row in publications
    ]
    for table in (ReadyRow, tables.ReadyAnswer, tables.ReadyCells):
        session.execute(insert(table), [each[table] for each in made])


def make_ready(
    publication: Publication, calibration: Calibration, coefficients: list[tables.CoefficientRow]
) -> dict[type[tables.Base], dict[str, Any]]:
    """Return the columns of a publication's ready row, of its answer and of its cells, by table."""
    ready = {
        **{name: getattr(publication, name) for name in _PUBLISHED},
        **{name: getattr(calibration, name) for name in _CALIBRATED},
        "publication_id": publication.id,
        "calibration_id": calibration.id,
        "computed_at": calibration.created_at,
        "coefficients": len(coefficients),
    }
    figures = [{name: getattr(row, name) for name in _ITEM} for row in coefficients]
    stated = state_coefficients(calibration.method, calibration.result, figures)
    records = _write_records(publication, calibration, stated)
    return {
        ReadyRow: ready,
        tables.ReadyAnswer: _write_answer(publication, calibration, stated),
        tables.ReadyCells: {"publication_id": publication.id, "cells": records},
    }


def close_ready(session: Session, publication: Publication) -> None:
    """End the knowledge of a ready row with that of its publication."""
    closing = update(ReadyRow).where(ReadyRow.publication_id == publication.id)
    session.execute(closing.values(known_to=publication.known_to))


def _write_answer(
    publication: Publication, calibration: Calibration, stated: list[dict[str, Any]]
) -> dict[str, Any]:
    why = (
        f"{describe_validity(calibration.version, publication)}, known since "
        f"{show_instant(publication.known_from)}: {publication.reason}"
    )
    more = {
        "calibration_id": calibration.id,
        "version": calibration.version,
        "valid_from": write_instant(publication.valid_from),
        **({"valid_to": write_instant(publication.valid_to)} if publication.valid_to else {}),
        "why": why,
    }
    items = [each | more for each in stated]
    content = to_json(items)
    foreseen = _foresee(calibration, stated)
    general = {key_of(item) for item in items if "f_number" not in item}
    return {
        "publication_id": publication.id,
        "etag": hashlib.sha256(content + (foreseen or "").encode()).hexdigest()[:32],
        "whole": not any("f_number" in item and key_of(item) in general for item in items),
        "foreseen": foreseen,
        "items": content,
    }


def _write_records(publication: Publication, calibration: Calibration, stated: list[dict[str, Any]]) -> str:
    """Write the rows of a series of coefficients, a line each, without the camera and its names."""
    ended = write_instant(publication.valid_to) if publication.valid_to else None
    tail = (
        *(write_instant(publication.valid_from), ended),
        *(calibration.campaign_id, write_instant(calibration.created_at)),
    )
    return "\n".join(
        write_record(
            (
                *(calibration.method, calibration.version, calibration.id, row["name"]),
                *(float(row["value"]), float(row["standard_uncertainty"]), row["unit"]),
                *(float(row[name]) if name in row else None for name in ("iso", "f_number")),
                *(row.get("band"), row.get("channel"), row["model"], " ".join(row["flags"]), *tail),
                *(row.get(name) for name in _COVERAGE),
            )
        )
        for row in stated
    )


def key_of(item: dict[str, Any]) -> tuple[object, ...]:
    """Return what a coefficient is of, apart from its f-number."""
    return tuple(item.get(name) for name in ("name", "iso", "band", "channel", "model"))


def _foresee(calibration: Calibration, stated: list[dict[str, Any]]) -> str | None:
    """Return the uncertainty of each general headline coefficient at an uncalibrated f-number."""
    spec = get_method(calibration.method)
    general = [
        (place, row)
        for place, row in enumerate(stated)
        if "f_number" not in row and row["name"] == spec.coefficients[0].name
    ]
    if not general or not isinstance(spec.application, SurfaceApplication):
        return None
    applied = read_applied(calibration)
    found: dict[int, dict[str, float]] = {}
    for place, row in general:
        u = spec.application.foresee(applied, iso=row["iso"])
        found[place] = {"standard_uncertainty": u}
        if "effective_dof" in row:
            # what an f-number adds is not estimated (JCGM 100, G.4.1)
            dof = row["effective_dof"] * (u / row["standard_uncertainty"]) ** 4
            k = coverage_factor(dof)
            found[place] |= {"effective_dof": dof, "coverage_factor": k, "expanded_uncertainty": k * u}
    return json.dumps(found)


_PIXELS = ("mean", "min", "max", "median")
_RATIOS = ("l_av_cd_m2", "l_min_cd_m2", "l_max_cd_m2", "u_o", "average_to_min", "max_to_min")
_PLACE = ("taken_at", "latitude_deg", "longitude_deg", "altitude_m")
_SHARES = ("below_zero_share", "above_one_share")
_LIGHT = ("i_ss", "i_ss_oriented", "i_ss_basis")
_PERCENTS = (5, 10, 90, 95)
_BODY = ("make", "model_name", "serial")
_OF_ROW = ("id", "frame_id", "calibration_id", "campaign_id", "method")


def _with_u(*names: str) -> Iterator[str]:
    return (f"{name}{suffix}" for name in names for suffix in ("", "_standard_uncertainty"))


_NAMES = {
    **{figure: f"{figure}_cd_m2" for figure in _PIXELS},
    "illuminance": "illuminance_lx",
    **{figure: figure for figure in _RATIOS},
    "grid_illuminance": "grid_illuminance_lx",
}
_COLUMNS_OF: Final[dict[str, dict[str, str]]] = {
    "cd_m2": _NAMES,
    "reflectance": {figure: f"{figure}_reflectance" for figure in _PIXELS},
    "index_value": {"mean": "index_value"},
}
"""Columns of the figures of a measurement, by what its summary names them after."""
COLUMNS = (
    *("id", "frame_id", "filename", *_PLACE),
    *("calibration_id", "calibration_version", "calibration_state", "region_origin", "pixels", "frames"),
    *_with_u(*_NAMES.values()),
    *(f"p{percent}_cd_m2" for percent in _PERCENTS),
    *_with_u(*(f"{figure}_reflectance" for figure in _PIXELS)),
    *(f"p{percent}_reflectance" for percent in _PERCENTS),
    *("index", *_with_u("index_value"), *_SHARES, "saturated_share", "vignetting", "signal"),
    *("flags", "created_at", "camera_id", *_BODY, "campaign_id", "method"),
    *_LIGHT,
    *_COVERAGE,
)
KINDS: dict[str, type] = dict.fromkeys(
    (
        *("id", "frame_id", "filename", "taken_at", "calibration_id", "calibration_state", "region_origin"),
        *("index", "i_ss_basis", "vignetting", "signal", "flags", "created_at"),
        *("camera_id", *_BODY, "campaign_id", "method"),
    ),
    str,
) | dict.fromkeys(("calibration_version", "pixels", "frames"), int)
"""Types of the columns that are not numbers with a fraction."""
STATE, FLAGS = COLUMNS.index("calibration_state"), COLUMNS.index("flags")
"""Columns that decisions change: the state is empty in a stored row, and the flags lack those of it."""
BODY = slice(COLUMNS.index(_BODY[0]), COLUMNS.index(_BODY[-1]) + 1)
"""Columns of the camera's names, which may be corrected: a stored row has them as they were."""


def make_measured(
    row: Measurement, frame: FrameRow, calibration: Calibration, camera: Camera
) -> dict[str, Any]:
    spec = get_method(row.method)
    taken = read_frame_time(frame, Zones(campaign=row.parameters.get("time_zone")))
    named = row.parameters.get(spec.corrected_by) if spec.corrected_by else None
    cells = _describe(row, frame, calibration, camera)
    return {
        **{name: getattr(row, name) for name in ("organisation_id", "campaign_id", "calibration_id")},
        "measurement_id": row.id,
        "camera_id": camera.id,
        "corrector_id": named["calibration_id"] if named else None,
        "taken_from": taken.earliest if taken else row.created_at,
        "taken_to": taken.latest if taken else None,
        "created_at": row.created_at,
        "cells": write_record(_take(name, cells.get(name)) for name in COLUMNS),
    }


def _describe(row: Measurement, frame: FrameRow, calibration: Calibration, camera: Camera) -> dict[str, Any]:
    result, header = row.result, frame.header or {}
    summary = get_method(row.method).summarise(result)
    reflected = summary.figures.get("reflected", {})
    raised = [*result["flags"], *list_passed(calibration, frame)]
    cells: dict[str, Any] = {
        **{name: getattr(row, name) for name in _OF_ROW},
        **{name: header.get(name) for name in _PLACE},
        "filename": frame.filename,
        "calibration_version": calibration.version,
        "region_origin": row.parameters["region_origin"],
        "pixels": result.get("pixels"),
        "frames": 1 + len(row.parameters.get("repeats", ())),
        "saturated_share": result.get("saturated_share"),
        "flags": " ".join(dict.fromkeys(each["flag"] for each in raised)),
        "created_at": write_instant(row.created_at),
        "camera_id": camera.id,
        "make": camera.make,
        "model_name": camera.model,
        "serial": camera.serial,
        "vignetting": summary.vignetting,
        # stored rows have no column for a radiance
        "signal": f"radiance {summary.signal}" if "radiance" in summary.figures else summary.signal,
        "index": summary.figures.get("index", {}).get("name"),
        "expanded_uncertainty": summary.figures.get("expanded_uncertainty_cd_m2"),
    }
    cells |= {name: summary.figures[name] for name in _COVERAGE if name in summary.figures}
    for figure, column in _COLUMNS_OF.get(summary.column or "", {}).items():
        if (quantity := summary.figures.get(figure)) is not None:
            cells[column] = quantity["value"]
            cells[f"{column}_standard_uncertainty"] = quantity["standard_uncertainty"]
    for entry in result.get("percentiles", ()):
        for quantity in (each for name, each in entry.items() if name != "percent" and each):
            cells[f"p{entry['percent']}_{summary.column}"] = quantity["value"]
    return cells | {name: reflected.get(name) for name in (*_SHARES, *_LIGHT)}


def list_passed(calibration: Calibration, frame: FrameRow) -> list[dict[str, Any]]:
    iso = (frame.exposure or {}).get("iso")
    places = {"", *([f"iso {iso:g}"] if iso else [])}
    passed_on = get_method(calibration.method).passed_on
    return [
        raised
        for raised in calibration.result["flags"]
        if raised["where"] in places and raised["flag"] in passed_on
    ]


def _take(name: str, value: Any) -> Value:  # noqa: ANN401  of the column's kind
    kind: type[str | int | float] = KINDS.get(name, float)
    return None if value is None else kind(value)


def read_row(cells: Mapping[str, str]) -> dict[str, Any]:
    """Return the cells of a row with their types; empty ones are left out."""
    return {name: KINDS.get(name, float)(text) for name, text in cells.items() if text or name == "flags"}


_PAGE = 500


def write_missing(session: Session) -> None:
    """Write the rows that are missing, a page at a time; they are derived, so that none is lost."""
    both = select(Publication).outerjoin(ReadyRow, ReadyRow.publication_id == Publication.id)
    unready = both.where(ReadyRow.publication_id.is_(None)).order_by(Publication.id).limit(_PAGE)
    last = ""
    while rows := list(session.scalars(unready.where(Publication.id > last))):
        last = rows[-1].id
        write_ready(session, rows)
        session.expunge_all()
    unmeasured = (
        select(Measurement, FrameRow, Calibration, Camera)
        .join(FrameRow, FrameRow.id == Measurement.frame_id)
        .join(Calibration, Calibration.id == Measurement.calibration_id)
        .join(Camera, Camera.id == Calibration.camera_id)
        .outerjoin(MeasuredRow, MeasuredRow.measurement_id == Measurement.id)
        .where(MeasuredRow.measurement_id.is_(None))
        .order_by(Measurement.id)
        .limit(_PAGE)
    )
    last = ""
    while found := session.execute(unmeasured.where(Measurement.id > last)).all():
        last = found[-1][0].id
        session.execute(insert(MeasuredRow), [make_measured(*row) for row in found])
        session.expunge_all()
