"""A frame measured with a version: its region, its figures, its map."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sqlalchemy.orm import Session

from radiometry.findings import shared
from radiometry.methods import get_method
from radiometry.specification.application import BandApplication, PictureApplication, SurfaceApplication
from store import blobs, codec, jobs
from store.measuring import plan, record
from store.tables import Calibration, FrameRow, Measurement
from worker.context import Context, Outcome
from worker.decode.pool import Readable
from worker.measuring import band, surface
from worker.measuring.task import Task


def measure(context: Context, claim: jobs.Claim) -> Outcome:
    """Measure as the plan says; what was measured before is computed again only where its map was lost."""
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, claim.subject_id)
        calibration = session.get_one(Calibration, claim.parameters["calibration_id"])
        found = record.find_measurement(session, frame, calibration, claim.parameters)
        lost = found is not None and record.has_lost_products(session, found)
    if found is not None and not lost:
        return Outcome(store=lambda _session: _links(found))
    with context.lend(frame.sha256) as file:
        measured, products = measure_frame(make_task(context, claim, frame, calibration, file))

    def store(session: Session) -> dict[str, Any]:
        made = record.write_measurement(
            session, frame, calibration, claim.parameters, measured, products, by=claim.created_by
        )
        return _links(made)

    return Outcome(store=store)


def measure_frame(task: Task) -> tuple[dict[str, Any], record.Products | None]:
    """Measure as the plan says; the result as it is stored, and the map where one was asked for."""
    if task.header.table is not None:
        raise shared.PIXELS_MISSING.refuse("This frame is a row of a table: it has no pixels to measure.")
    doubts = list(_find_doubts(task))
    match get_method(task.calibration.method).application:
        case SurfaceApplication() as application:
            measured, products = surface.measure_surface(task, application)
        case BandApplication() as application:
            measured, products = _measure_band(task, application)
        case PictureApplication() as application:
            measured, products = surface.undistort_picture(task, application)
        case _:
            raise AssertionError(f"the plan let a frame be measured by {task.calibration.method}")
    measured["flags"] = [*measured["flags"], *doubts]
    return measured, products


def _measure_band(task: Task, application: BandApplication) -> tuple[dict[str, Any], record.Products | None]:
    if "index" in task.parameters:
        return band.measure_index(task, application)
    measured, products = band.measure_band(task, application)
    return band.write_bands(task, application, measured) if task.wants_bands else (measured, products)


def _find_doubts(task: Task) -> Iterator[dict[str, Any]]:
    """Flag doubts about the frame, and about those that are measured with it, that the request allowed."""
    yield from _find_doubt(task, task.frame, task.file)
    for named in [*task.parameters.get("repeats", []), *plan.list_others(task.parameters)]:
        with task.lend(named["frame_id"]) as (row, file):
            yield from _find_doubt(task, row, file)


def _find_doubt(task: Task, row: FrameRow, file: Readable) -> Iterator[dict[str, Any]]:
    proof = plan.read_proof(row) or task.decoders.inspect(file)[1]
    plan.require_whole(row, proof, task.parameters.get("allow", []))
    if proof.wholeness.empty:
        doubt = proof.describe_doubt(codec.decode_header(row.header or {}))
        where, detail = f"frame {row.filename}", f"In frame {row.filename} {doubt}."
        yield codec.encode(shared.IMAGE_PART_EMPTY.at(where, detail))


def make_task(
    context: Context, claim: jobs.Claim, frame: FrameRow, calibration: Calibration, file: blobs.StoredFile
) -> Task:
    @contextmanager
    def lend(frame_id: str) -> Iterator[tuple[FrameRow, Readable]]:
        with context.database.reading() as session:
            row = session.get_one(FrameRow, frame_id)
        with context.files.local(row.sha256) as there:
            yield row, there

    return Task(
        decoders=context.decoders,
        blobs=context.blobs,
        lend=lend,
        frame=frame,
        file=file,
        calibration=calibration,
        parameters=claim.parameters,
        report=lambda share: context.leases.report(claim, min(share, 0.99)),
    )


def _links(row: Measurement) -> dict[str, Any]:
    return {"measurement_id": row.id, "measurement": f"/v1/measurements/{row.id}"}
