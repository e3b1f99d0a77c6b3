"""A frame measured with a version: its region, its figures, its map."""

from typing import Any

from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, files, shared
from radiometry.methods import get_method
from radiometry.specification.application import BandApplication, PictureApplication, SurfaceApplication
from store.blobs import StoredFile
from store.codec import decode_header, encode
from store.jobs import Claim
from store.measuring.plan import read_proof, require_whole
from store.measuring.record import Products, find_measurement, has_lost_products, write_measurement
from store.tables import Calibration, FrameRow, Measurement
from worker.context import Context
from worker.decode.pool import DecoderCrashed
from worker.measuring import band, picture, surface
from worker.measuring.task import Task
from worker.tasks.outcome import Outcome


def measure(context: Context, claim: Claim) -> Outcome:
    """Measure as the plan says; what was measured before is computed again only where its map was lost."""
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, claim.subject_id)
        calibration = session.get_one(Calibration, claim.parameters["calibration_id"])
        found = find_measurement(session, frame, calibration, claim.parameters)
        lost = found is not None and has_lost_products(session, found)
    if found is not None and not lost:
        return Outcome(store=lambda _session: _links(found))
    try:
        with context.files.local(frame.sha256) as file, context.decoders.hold(file):
            doubts = _find_doubts(context, claim, frame, file)
            measured, products = _measure(_make_task(context, claim, frame, calibration, file))
            measured["flags"] = [*measured["flags"], *doubts]
    except DecoderCrashed as crash:
        # as in extract: only a whole file is blamed
        context.files.prove(frame.sha256)
        raise InputRejected(files.DECODER_CRASHED, crash.message) from crash

    def store(session: Session) -> dict[str, Any]:
        return _links(
            write_measurement(
                session, frame, calibration, claim.parameters, measured, products, by=claim.created_by
            )
        )

    return Outcome(store=store)


def _find_doubts(context: Context, claim: Claim, frame: FrameRow, file: StoredFile) -> list[dict[str, Any]]:
    """What is doubted in the frame, and in those that are measured with it, and was asked for all the same.

    A frame that was read before there were proofs is read as a whole here.

    Raises InputRejected(incomplete_image | image_part_empty)
    """
    allowed = claim.parameters.get("allow", [])
    proof = read_proof(frame) or context.decoders.inspect(file)[1]
    require_whole(frame, proof, allowed)
    proofs = [(frame, proof)]
    for named in [*claim.parameters.get("repeats", []), *filter(None, [claim.parameters.get("other")])]:
        with context.database.reading() as session:
            other = session.get_one(FrameRow, named["frame_id"])
        with context.files.local(other.sha256) as there:
            proof = read_proof(other) or context.decoders.inspect(there)[1]
        require_whole(other, proof, allowed)
        proofs.append((other, proof))
    return [
        encode(
            shared.IMAGE_PART_EMPTY.at(
                f"frame {each.filename}",
                f"In frame {each.filename} {found.describe_doubt(decode_header(each.header or {}))}.",
            )
        )
        for each, found in proofs
        if found.wholeness.empty
    ]


def _make_task(
    context: Context, claim: Claim, frame: FrameRow, calibration: Calibration, file: StoredFile
) -> Task:
    return Task(
        context=context,
        frame=frame,
        header=decode_header(frame.header or {}),
        file=file,
        calibration=calibration,
        parameters=claim.parameters,
        report=lambda share: context.leases.report(claim, min(share, 0.99)),
    )


def _measure(task: Task) -> tuple[dict[str, Any], Products | None]:
    match get_method(task.calibration.method).application:
        case SurfaceApplication() as application:
            return surface.measure(task, application)
        case BandApplication() as application:
            return band.measure(task, application)
        case PictureApplication() as application:
            return picture.measure(task, application)
    raise AssertionError(f"the plan let a frame be measured by {task.calibration.method}")


def _links(row: Measurement) -> dict[str, Any]:
    return {"measurement_id": row.id, "measurement": f"/v1/measurements/{row.id}"}
