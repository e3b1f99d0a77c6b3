"""A frame measured with a version: its region, its grid, its map."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from radiometry import measurement
from radiometry.errors import InputRejected
from radiometry.frame import FrameHeader
from radiometry.luminance.maps import find_map_scale
from radiometry.measured import Measured
from store.codec import decode_exposure, decode_header
from store.jobs import Claim
from store.measuring import (
    Products,
    find_measurement,
    read_coefficients,
    read_regions,
    read_request,
    write_measurement,
)
from store.software import CODE_VERSION, MEASURER
from store.tables import Blob, Calibration, FrameRow, Measurement
from worker.context import Context
from worker.decode.pool import DecoderCrashed
from worker.decode.refusals import Refusal
from worker.maps.making import Subject, make_map
from worker.maps.tiff import MapFacts
from worker.tasks.outcome import Outcome

_COPY_BYTES = 1 << 20


@dataclass(frozen=True, kw_only=True)
class _Task:
    frame: FrameRow
    header: FrameHeader
    calibration: Calibration
    parameters: dict[str, Any]


def measure(context: Context, claim: Claim) -> Outcome:
    """Measure as the plan says; what was measured before is not computed again."""
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, claim.subject_id)
        calibration = session.get_one(Calibration, claim.parameters["calibration_id"])
        found = find_measurement(session, frame, calibration, claim.parameters)
    if found is not None:
        return Outcome(store=lambda _session: _links(found))
    task = _Task(
        frame=frame,
        header=decode_header(frame.header or {}),
        calibration=calibration,
        parameters=claim.parameters,
    )
    try:
        with context.blobs.local_path(frame.sha256) as path:
            measured = _measure(context, task, path)
            context.leases.report(claim, 0.2)
            products = _map(context, task, path) if "map" in task.parameters["products"] else None
    except DecoderCrashed as crash:
        raise InputRejected(Refusal.DECODER_CRASHED, crash.message) from crash

    def store(session: Session) -> dict[str, Any]:
        return _links(
            write_measurement(
                session, frame, calibration, claim.parameters, measured, products, by=claim.created_by
            )
        )

    return Outcome(store=store)


def _links(row: Measurement) -> dict[str, Any]:
    return {"measurement_id": row.id, "measurement": f"/v1/measurements/{row.id}"}


def _measure(context: Context, task: _Task, path: Path) -> Measured:
    request, header = read_request(task.parameters), task.header
    window = measurement.find_window(request, height_px=header.height_px, width_px=header.width_px)
    pixels = context.decoders.read_window(path, (window.row0, window.col0, window.height, window.width))
    return measurement.measure(
        pixels,
        request,
        exposure=decode_exposure(task.frame.exposure or {}),
        coefficients=read_coefficients(task.calibration),
        calibrated=read_regions(task.calibration),
        rendered=header.rendered,
    )


def _map(context: Context, task: _Task, path: Path) -> Products:
    exposure = decode_exposure(task.frame.exposure or {})
    scale = find_map_scale(read_coefficients(task.calibration), exposure)
    version = task.calibration.version
    facts = MapFacts(
        header=task.header,
        exposure=exposure,
        software=f"stilb {CODE_VERSION}",
        description=_describe(task, scale.channel),
    )
    with tempfile.TemporaryDirectory(prefix="stilb-map-") as folder:
        target = Path(folder) / "map.tif"
        picture = make_map(
            context.decoders,
            Subject(path=path, header=task.header, scale=scale),
            facts,
            target,
            caption=f"{task.frame.filename}, calibration version {version}",
        )
        return Products(tif=_keep_file(context, target), png=_keep(context, picture))


def _describe(task: _Task, channel: str) -> dict[str, Any]:
    """What ImageDescription says, so that a map that has left its place still names what it is."""
    calibration, exposure = task.calibration, task.frame.exposure or {}
    return {
        "quantity": "luminance",
        "unit": "cd/m2",
        "saturated": "NaN",
        "signal": channel,
        "vignetting": "none",
        "calibration": {
            "id": calibration.id,
            "version": calibration.version,
            "content_sha256": calibration.content_sha256,
        },
        "frame": {"id": task.frame.id, "sha256": task.frame.sha256, "filename": task.frame.filename},
        "exposure": {name: exposure[name] for name in ("exposure_time_s", "f_number", "iso")},
        "software": {"stilb": CODE_VERSION, "measurer": MEASURER},
    }


def _keep_file(context: Context, path: Path) -> Blob:
    with context.blobs.writer() as writer, path.open("rb") as file:
        while piece := file.read(_COPY_BYTES):
            writer.write(piece)
        stored = writer.commit()
    return Blob(sha256=stored.sha256, size_bytes=stored.size_bytes)


def _keep(context: Context, content: bytes) -> Blob:
    with context.blobs.writer() as writer:
        writer.write(content)
        stored = writer.commit()
    return Blob(sha256=stored.sha256, size_bytes=stored.size_bytes)
