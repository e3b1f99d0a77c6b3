"""A frame's metadata, refusal or warnings, its preview, and the statistics of its region."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.acceptance import Acceptance, Camera, SuppliedExposure, accept_frame
from radiometry.errors import Code, InputRejected
from radiometry.frame import FrameHeader
from radiometry.roi import Polygon, bounding_window
from store import tables
from store.codec import decode_header, decode_statistics, encode, encode_statistics
from store.jobs import Claim
from store.queries.frames import add_extraction, current_roi, find_equal_statistics, find_extraction
from store.software import EXTRACTOR
from store.tables import Blob, Campaign, FrameRow, Roi
from worker.context import Context
from worker.decode.pool import DecoderCrashed
from worker.decode.refusals import Refusal
from worker.tasks.outcome import Outcome


@dataclass(frozen=True, kw_only=True)
class _Subject:
    frame: FrameRow
    method: methods.Method
    camera: Camera
    roi: Roi | None
    """The region to be computed; None where there is none, or where it has been computed."""
    equal_rows: list[dict[str, Any]] | None
    """Statistics of the same bytes in the same region, computed for another campaign."""


@dataclass(frozen=True, kw_only=True)
class _Found:
    header: FrameHeader
    acceptance: Acceptance
    preview: Blob | None
    rows: list[dict[str, Any]] | None
    region_refused: InputRejected | None


def extract(context: Context, claim: Claim) -> Outcome:
    """Read a frame and compute what its region lacks; a refusal is stored with the frame and ends the job."""
    with context.database.reading() as session:
        subject = _load(session, claim.subject_id)
    try:
        with context.blobs.local_path(subject.frame.sha256) as path:
            found = _read(context, claim, subject, path)
    except InputRejected as refusal:
        return _refuse(subject.frame.id, refusal)
    except DecoderCrashed as crash:
        return _refuse(subject.frame.id, InputRejected(Refusal.DECODER_CRASHED, crash.message))
    return Outcome(store=lambda session: _store(session, subject, found), rejection=found.region_refused)


def _load(session: Session, frame_id: str) -> _Subject:
    frame = session.get_one(FrameRow, frame_id)
    campaign = session.get_one(Campaign, frame.campaign_id)
    camera = session.get_one(tables.Camera, campaign.camera_id)
    roi = current_roi(session, frame, campaign)
    if roi is not None and find_extraction(session, frame, roi, EXTRACTOR) is not None:
        roi = None
    equal = find_equal_statistics(session, frame, roi, EXTRACTOR) if roi is not None else None
    return _Subject(
        frame=frame,
        method=campaign.method,
        camera=Camera(make=camera.make, model=camera.model, serial=camera.serial),
        roi=roi,
        equal_rows=[encode_statistics(decode_statistics(row)) for row in equal] if equal else None,
    )


def _read(context: Context, claim: Claim, subject: _Subject, path: Path) -> _Found:
    frame = subject.frame
    header = decode_header(frame.header) if frame.header else context.decoders.read_header(path)
    acceptance = accept_frame(
        header, role=frame.role, supplied=SuppliedExposure(**frame.supplied), camera=subject.camera
    )
    rows, region_refused = subject.equal_rows, None
    if subject.roi is not None and rows is None:
        try:
            rows = _measure(context, subject.method, header, subject.roi, path)
        except InputRejected as refusal:
            # the region is wrong for this frame, not the frame for its campaign
            if refusal.code not in (Code.ROI_OUTSIDE_FRAME, Code.ROI_EMPTY):
                raise
            region_refused = refusal
    context.leases.report(claim, 0.5)
    preview = None if frame.preview_sha256 else _store_preview(context, path)
    return _Found(
        header=header, acceptance=acceptance, preview=preview, rows=rows, region_refused=region_refused
    )


def _measure(
    context: Context, method: methods.Method, header: FrameHeader, roi: Roi, path: Path
) -> list[dict[str, Any]]:
    polygon = Polygon.from_points(roi.points)
    window = bounding_window(polygon, height_px=header.height_px, width_px=header.width_px)
    pixels = context.decoders.read_window(path, (window.row0, window.col0, window.height, window.width))
    return [encode_statistics(row) for row in methods.extract(method, pixels, polygon)]


def _store_preview(context: Context, path: Path) -> Blob:
    with context.blobs.writer() as writer:
        writer.write(context.decoders.render_preview(path))
        stored = writer.commit()
    return Blob(sha256=stored.sha256, size_bytes=stored.size_bytes)


def _store(session: Session, subject: _Subject, found: _Found) -> dict[str, Any]:
    frame = session.get_one(FrameRow, subject.frame.id)
    campaign = session.get_one(Campaign, frame.campaign_id)
    if found.preview is not None:
        session.merge(found.preview)
        session.flush()
        frame.preview_sha256 = found.preview.sha256
    frame.header = encode(found.header)
    _store_acceptance(frame, found)
    roi = subject.roi
    if roi is not None and found.rows is not None and not find_extraction(session, frame, roi, EXTRACTOR):
        add_extraction(session, frame, roi, EXTRACTOR, found.rows)
    now = current_roi(session, frame, campaign)
    done = now is not None and find_extraction(session, frame, now, EXTRACTOR) is not None
    frame.state = "extracted" if done else "read"
    return {"frame_id": frame.id}


def _store_acceptance(frame: FrameRow, found: _Found) -> None:
    # together: the row may be written before the rest is known, and must be whole then
    frame.state, frame.refusal_code, frame.refusal_detail = "read", None, None
    frame.warnings = list(found.acceptance.flags)
    if found.region_refused is not None:
        frame.warnings.append(str(found.region_refused.code))
    exposure = found.acceptance.exposure
    frame.exposure = encode(exposure) if exposure else None
    frame.exposure_time_s = exposure.exposure_time_s if exposure else None
    frame.f_number = exposure.f_number if exposure else None
    frame.iso = exposure.iso if exposure else None


def _refuse(frame_id: str, refusal: InputRejected) -> Outcome:
    def store(session: Session) -> dict[str, Any]:
        frame = session.get_one(FrameRow, frame_id)
        frame.state = "refused"
        frame.refusal_code = str(refusal.code)
        frame.refusal_detail = refusal.message
        frame.exposure = None
        return {"frame_id": frame_id}

    return Outcome(store=store, rejection=refusal)
