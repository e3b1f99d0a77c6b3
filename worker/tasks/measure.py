"""A frame measured with a version: its region, its figures, its map."""

from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from radiometry.errors import InputRejected
from store.codec import decode_header
from store.jobs import Claim
from store.measuring.record import Products, find_measurement, write_measurement
from store.tables import Calibration, FrameRow, Measurement
from worker.context import Context
from worker.decode.pool import DecoderCrashed
from worker.decode.refusals import Refusal
from worker.measuring import geometry, luminance, reflectance
from worker.measuring.task import Task
from worker.tasks.outcome import Outcome


def measure(context: Context, claim: Claim) -> Outcome:
    """Measure as the plan says; what was measured before is not computed again."""
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, claim.subject_id)
        calibration = session.get_one(Calibration, claim.parameters["calibration_id"])
        found = find_measurement(session, frame, calibration, claim.parameters)
    if found is not None:
        return Outcome(store=lambda _session: _links(found))
    try:
        with context.blobs.local_path(frame.sha256) as path:
            measured, products = _measure(_make_task(context, claim, frame, calibration, path))
    except DecoderCrashed as crash:
        raise InputRejected(Refusal.DECODER_CRASHED, crash.message) from crash

    def store(session: Session) -> dict[str, Any]:
        return _links(
            write_measurement(
                session, frame, calibration, claim.parameters, measured, products, by=claim.created_by
            )
        )

    return Outcome(store=store)


def _make_task(context: Context, claim: Claim, frame: FrameRow, calibration: Calibration, path: Path) -> Task:
    return Task(
        context=context,
        frame=frame,
        header=decode_header(frame.header or {}),
        path=path,
        calibration=calibration,
        parameters=claim.parameters,
        report=lambda share: context.leases.report(claim, min(share, 0.99)),
    )


def _measure(task: Task) -> tuple[dict[str, Any], Products | None]:
    match task.calibration.method:
        case "luminance":
            return luminance.measure(task)
        case "reflectance":
            return reflectance.measure(task)
        case "geometry":
            return geometry.measure(task)
        case method:
            raise AssertionError(f"the plan let a frame be measured by {method}")


def _links(row: Measurement) -> dict[str, Any]:
    return {"measurement_id": row.id, "measurement": f"/v1/measurements/{row.id}"}
