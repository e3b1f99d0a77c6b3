"""Everything that is recorded about a version and that its certificate has to say."""

import math
from collections import defaultdict
from collections.abc import Iterable
from datetime import datetime
from operator import attrgetter, itemgetter
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.fitting.curve import coverage_factor
from radiometry.frame.statistics import ChannelStatistics
from radiometry.methods import get_method
from radiometry.records import Record
from radiometry.specification.application import FoundBy
from store import tables
from store.codec import decode, drop_absent, encode
from store.queries import calibrations, organisations
from store.queries.campaigns import COLUMNS
from store.queries.checklist import ChecklistItem, RecordState, read_checklist, read_signature
from store.queries.frames import statistics_of
from store.tables import Json


class MeterAsUsed(Record):
    """A meter with the certificate that it had when the version was made, whatever it has now."""

    row: tables.Meter
    certificate: dict[str, Any]


class FrameAsUsed(Record):
    id: str
    size_bytes: int
    taken_at: str | None
    warnings: list[str]
    preview_sha256: str | None
    size_px: tuple[int, int] | None  # width and height; None of a frame that was never read
    statistics: list[ChannelStatistics]
    found_by: FoundBy | None  # how the region that was used was found; None: drawn, or the whole frame
    panel_serial: str | None  # of the panel that the frame shows, as its code states it


class CalibrationRecord(Record):
    """``readings``: of each reading in the version's inputs, the row it was; None where no row fits.

    ``coefficients``: in the version's order. ``frames``: by content hash. ``names``: of every key, the
    person's.
    """

    calibration: tables.Calibration
    camera: tables.Camera
    campaign: tables.Campaign
    organisation: tables.Organisation
    status: calibrations.VersionStatus
    revocation: tables.Revocation | None
    acts: list[calibrations.Act]
    coefficients: list[tables.CoefficientRow]
    readings: list[tables.Reading | None]
    meters: dict[str, MeterAsUsed]
    frames: dict[str, FrameAsUsed]
    checklist: list[ChecklistItem]
    signature: tables.ChecklistSignature | None
    flight: list[datetime]
    names: dict[str, str]
    fitted_by: organisations.Person | None


def read_calibration_record(
    session: Session, calibration: tables.Calibration, state: RecordState | None
) -> CalibrationRecord:
    """Collect it, as it stands now; what the version rests on, as it stood when it was made."""
    campaign = session.get_one(tables.Campaign, calibration.campaign_id)
    readings = _readings_used(session, calibration)
    slots = select(tables.Publication.slot_id).where(tables.Publication.calibration_id == calibration.id)
    acts = calibrations.list_publishings(session, slots)
    return CalibrationRecord(
        calibration=calibration,
        camera=session.get_one(tables.Camera, calibration.camera_id),
        campaign=campaign,
        organisation=session.get_one(tables.Organisation, calibration.organisation_id),
        status=calibrations.read_version_statuses(session, [calibration.id])[calibration.id],
        revocation=session.get(tables.Revocation, calibration.id),
        acts=[act for act in acts if act.publication.calibration_id == calibration.id],
        coefficients=calibrations.coefficients_of(session, [calibration.id])[calibration.id],
        readings=readings,
        meters=_meters_used(session, readings, calibration),
        frames=_frames_used(session, calibration),
        checklist=read_checklist(session, campaign, state),
        signature=read_signature(session, campaign),
        flight=calibrations.list_flight(session, calibration),
        names=organisations.name_people(session, calibration.organisation_id, unnamed=organisations.UNNAMED),
        fitted_by=organisations.Person.behind(session.get(tables.ApiKey, calibration.created_by)),
    )


def _readings_used(session: Session, calibration: tables.Calibration) -> list[tables.Reading | None]:
    """Find the row of each meter reading that went in, also where it was withdrawn later."""
    if get_method(calibration.method).reference != "meter":
        return []
    rows = session.execute(
        select(tables.Reading, tables.Meter)
        .outerjoin(tables.Meter, tables.Meter.id == tables.Reading.meter_id)
        .where(
            tables.Reading.campaign_id == calibration.campaign_id,
            tables.Reading.created_at <= calibration.created_at,
        )
        .order_by(tables.Reading.id.desc())
    )
    waiting: dict[tuple[Any, ...], list[tables.Reading]] = defaultdict(list)
    for reading, meter in rows:
        name = f"{meter.make} {meter.model} {meter.serial}" if meter else None
        waiting[reading.scene, reading.quantity, reading.value, name].append(reading)
    keys = map(itemgetter("scene", "quantity", "value", "meter"), calibration.inputs["readings"])
    return [waiting[key].pop() if waiting[key] else None for key in keys]


def _meters_used(
    session: Session, readings: list[tables.Reading | None], calibration: tables.Calibration
) -> dict[str, MeterAsUsed]:
    ids = {reading.meter_id for reading in readings if reading and reading.meter_id}
    meters = session.scalars(select(tables.Meter).where(tables.Meter.id.in_(ids)).order_by(tables.Meter.id))
    names = ("kind", "make", "model", "serial")
    of_row, of_used = attrgetter(*names), itemgetter(*names)
    certificates = {
        of_used(used): used.get("certificate", {}) for used in calibration.inputs.get("meters", [])
    }
    return {meter.id: MeterAsUsed(row=meter, certificate=certificates[of_row(meter)]) for meter in meters}


def _frames_used(session: Session, calibration: tables.Calibration) -> dict[str, FrameAsUsed]:
    used = {frame["sha256"]: frame["roi_sha256"] for frame in calibration.inputs["frames"]}
    named = ("id", "found", "preview_sha256", "taken_at", "width_px", "height_px")
    rows = session.execute(
        select(
            *(COLUMNS[name].label(name) for name in named),
            *(tables.FrameRow.sha256, tables.FrameRow.warnings, tables.Blob.size_bytes),
            tables.Extraction.id.label("extraction_id"),
            *(tables.Roi.id.label("roi_id"), tables.Roi.sha256.label("roi_sha256")),
        )
        .join(tables.Blob, tables.Blob.sha256 == tables.FrameRow.sha256)
        .join(tables.Extraction, tables.Extraction.frame_id == tables.FrameRow.id)
        .join(tables.Roi, tables.Roi.id == tables.Extraction.roi_id)
        .where(tables.FrameRow.campaign_id == calibration.campaign_id)
        .where(tables.Extraction.extractor == calibration.inputs["extractor"])
    )
    mine = [row for row in rows if used.get(row.sha256) == row.roi_sha256]
    statistics = statistics_of(session, [row.extraction_id for row in mine])
    return {
        row.sha256: FrameAsUsed(
            id=row.id,
            size_bytes=row.size_bytes,
            taken_at=row.taken_at,
            warnings=row.warnings,
            preview_sha256=row.preview_sha256,
            size_px=(row.width_px, row.height_px) if row.width_px else None,
            statistics=statistics[row.extraction_id],
            found_by=found.get("by", "code") if found.get("roi_id") == row.roi_id else None,
            panel_serial=found.get("serial"),
        )
        for row in mine
        for found in (row.found or {},)
    }


_COVERAGE_FACTOR = 2.0  # of a figure whose method states none: about 95 % of a normal distribution

_IDENTITY = ("name", "iso", "f_number", "band", "channel", "model")


def state_coefficients(method: str, result: Json, figures: Iterable[Json]) -> list[Json]:
    """The figures of a version with expanded uncertainty; one that is relative only has none."""
    spec = get_method(method)
    listed = spec.list_coefficients(decode(spec.result, result))
    known = {tuple(getattr(each, name) for name in _IDENTITY): each for each in listed}
    rows = []
    for figure in figures:
        value = known.get(tuple(figure.get(name) for name in _IDENTITY))
        dof = value.effective_dof if value else None
        factor = value.coverage_factor if value else None
        if factor is None:
            factor = _COVERAGE_FACTOR if dof is None else coverage_factor(dof)
        stated = {
            "expanded_uncertainty": factor * figure["standard_uncertainty"],
            "coverage_factor": factor,
            "effective_dof": dof if dof is None or math.isfinite(dof) else None,
        }
        scope = spec.find_scope(figure["name"], figure["flags"])
        own = {name: each for name, each in figure.items() if name not in stated}
        rows.append(
            drop_absent({**own, **({} if scope == "relative_only" else stated), "uncertainty_scope": scope})
        )
    return rows


def state_budgets(method: str, result: Json) -> list[Json]:
    spec = get_method(method)
    return [
        {**budget.holds_for, "lines": [drop_absent(encode(line)) for line in budget.lines]}
        for budget in spec.list_budgets(decode(spec.result, result))
    ]
