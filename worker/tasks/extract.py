"""A frame's metadata, refusal or warnings, its preview, and the statistics of its region."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Acceptance, Camera, Exposure, SuppliedExposure, accept_frame
from radiometry.frame.proof import Proof
from radiometry.frame.roi import Polygon, bounding_window
from radiometry.specification.application import FoundBy, FoundRegion
from store import blobs, jobs, tables
from store.blobs.proof import BlobDamaged
from store.codec import decode, decode_header, encode
from store.files import keep_blobs, keep_small_previews, reduce_preview
from store.queries import campaigns, frames, usage
from store.tables import Blob, Campaign, Extraction, FrameRow, Roi
from worker.context import Context, Outcome
from worker.decode.pool import DecoderCrashed

_CAPTURE = ("multispectral", "capture_id")
_ACTOR = "sweeper"
_Preview = tuple[blobs.StoredBlob, bytes]


@dataclass(frozen=True, kw_only=True)
class TakenRegion:
    """The region of a panel in this band; ``serial`` : as read in the other."""

    region: Polygon
    serial: str | None
    by: FoundBy = "other_band"

    def read_albedo(self, wavelength_nm: float | None) -> float | None:
        """None: what the code states is read in the other band."""


def list_siblings(
    session: Session, campaign: Campaign, frame_id: str, header: FrameHeader, *, found: bool
) -> Sequence[FrameRow]:
    """The other bands of a frame's capture: those in which the panel was found, or those without a region."""
    capture = header.multispectral.capture_id if header.multispectral else None
    spec = methods.get_method(campaign.method)
    if capture is None or not spec.finds_region:
        return []
    rows = session.scalars(
        select(FrameRow)
        .where(FrameRow.campaign_id == campaign.id, FrameRow.id != frame_id)
        .where(FrameRow.withdrawn_at.is_(None))
        .where(FrameRow.role.in_(spec.role_names), FrameRow.state.in_(("read", "extracted")))
        .where(FrameRow.header[_CAPTURE].as_string() == capture)
        .order_by(FrameRow.id)
    ).all()
    return [row for row in rows if (_has_found(row) if found else row.roi_id is None)]


def _has_found(row: FrameRow) -> bool:
    found = row.found or {}
    return row.roi_id is not None and found.get("roi_id") == row.roi_id and found.get("by") != "other_band"


def take_region(
    context: Context, campaign: Campaign, frame_id: str, frame: Frame, header: FrameHeader
) -> tuple[TakenRegion | None, int]:
    """Find a panel where other bands of the capture show it; and how many of those there were."""
    spec = methods.get_method(campaign.method)
    best: tuple[float, TakenRegion | None] = (0.0, None)
    with context.database.reading() as session:
        others = [
            (row.sha256, decode_header(row.header or {}), session.get_one(Roi, row.roi_id), row.found or {})
            for row in list_siblings(session, campaign, frame_id, header, found=True)
        ]
    for sha256, other_header, roi, found in others:
        try:
            with context.files.local(sha256) as file:
                window = (0, 0, other_header.height_px, other_header.width_px)
                other = context.decoders.read_window(file, window)
        except (BlobDamaged, DecoderCrashed, InputRejected):
            continue  # what is wrong with that file is said of it, not of this one
        region = Polygon.from_points(roi.points)
        taken = spec.take_region(frame, header=header, other=other, other_header=other_header, region=region)
        if taken is not None and taken[1] > best[0]:
            best = (taken[1], TakenRegion(region=taken[0], serial=found.get("serial")))
    return best[1], len(others)


def ask_siblings(
    session: Session, campaign: Campaign, frame: FrameRow, header: FrameHeader, *, considered: int
) -> None:
    """Have the bands that still lack a region read again, once this or another one shows where it is."""
    if campaign.roi_id is not None or frame.role not in methods.get_method(campaign.method).role_names:
        return
    # two bands that are stored at once must not miss one another
    session.refresh(campaign, with_for_update=True)
    waiting: Sequence[Any] = []
    if _has_found(frame):
        waiting = list_siblings(session, campaign, frame.id, header, found=False)
    elif frame.roi_id is None:
        later = len(list_siblings(session, campaign, frame.id, header, found=True)) > considered
        waiting = [frame] if later else []
    for each in waiting:
        jobs.enqueue_extraction(session, each, campaign.organisation_id, by=_ACTOR)
    if waiting:
        usage.add_jobs(session, len(waiting), organisation_id=campaign.organisation_id)


@dataclass(frozen=True, kw_only=True)
class _Subject:
    frame: FrameRow
    campaign: Campaign
    camera: Camera
    roi: Roi | None  # the region that holds; None where nobody has drawn one and none has been computed
    done: bool  # whether it has been computed
    has_preview: bool  # whether a preview is stored, and not known to be damaged
    equal: "_Extracted | None"  # what was computed of the same bytes in the same region for another campaign


@dataclass(frozen=True, kw_only=True)
class _Extracted:
    rows: list[dict[str, Any]]
    features: dict[str, Any] | None


@dataclass(frozen=True, kw_only=True)
class _Found:
    header: FrameHeader
    acceptance: Acceptance
    flags: tuple[str, ...]  # of the frame's acceptance, and what the method finds in its metadata
    preview: _Preview | None  # with its reduction; None where one is stored already
    proof: Proof
    extracted: _Extracted | None
    region_refused: InputRejected | None
    panel: FoundRegion | None  # its region counts where nobody has drawn one, its serial number always
    siblings: int  # bands of the capture that were asked where the panel is


def extract(context: Context, claim: jobs.Claim) -> Outcome:
    """Read a frame and compute what its region lacks; a refusal is stored with the frame and ends the job."""
    with context.database.reading() as session:
        subject = _load(session, claim.subject_id)
    try:
        with context.lend(subject.frame.sha256) as file:
            found = _read(context, claim, subject, file)
    except InputRejected as refusal:
        return _refuse(subject.frame.id, refusal)
    return Outcome(store=lambda session: _store(session, subject, found), rejection=found.region_refused)


def _load(session: Session, frame_id: str) -> _Subject:
    frame = session.get_one(FrameRow, frame_id)
    campaign = session.get_one(Campaign, frame.campaign_id)
    camera = session.get_one(tables.Camera, campaign.camera_id)
    extractor, roi = frames.extractor_of(campaign), frames.current_roi(session, frame, campaign)
    done = roi is not None and frames.find_extraction(session, frame, roi, extractor) is not None
    equal = frames.find_equal_extraction(session, frame, roi, extractor) if roi and not done else None
    preview = session.get(Blob, frame.preview_sha256) if frame.preview_sha256 else None
    return _Subject(
        frame=frame,
        campaign=campaign,
        camera=Camera(make=camera.make, model=camera.model, serial=camera.serial),
        roi=roi,
        done=done,
        has_preview=preview is not None and preview.damage is None,
        equal=_copy(session, equal) if equal else None,
    )


def _copy(session: Session, extraction: Extraction) -> _Extracted:
    statistics = frames.statistics_of(session, [extraction.id])[extraction.id]
    return _Extracted(rows=[asdict(row) for row in statistics], features=extraction.features)


def _read(context: Context, claim: jobs.Claim, subject: _Subject, file: blobs.StoredFile) -> _Found:
    frame, room = subject.frame, methods.get_method(subject.campaign.method)
    header = decode_header(frame.header) if frame.header else None
    if header is None or (header.container == "tiff" and header.cfa == "grey"):
        # of a band more is read now than when its frame was first read, which may be years ago
        header = context.decoders.read_header(file)
    if header.table is not None and room.features is not None:
        message = f"{room.label} needs the pixels of a frame, and this is a row of a table."
        raise shared.PIXELS_MISSING.refuse(message)
    acceptance = accept_frame(
        header,
        role=frame.role,
        supplied=SuppliedExposure(**frame.supplied),
        camera=subject.camera,
        manual_exposure=room.manual_exposure,
    )
    flags = acceptance.flags
    if frame.role in room.role_names | room.applied_role_names:
        found = room.check_frame(header, exposure=acceptance.exposure)
        flags = (*flags, *(raised.flag for raised in found))
    preview, proof = _inspect(context, subject, file)
    context.leases.report(claim, 0.5)
    left_out = shared.FRAME_LEFT_OUT in flags
    extracted, region_refused = subject.equal, None
    panel, siblings = (None, 0) if left_out else _find_panel(context, subject, header, file)
    drawn = subject.roi is not None or (panel is not None and panel.region is not None)
    wanted = frames.is_told(subject.campaign) and (
        drawn or (room.whole_frame and frame.role in room.role_names)
    )
    if wanted and not left_out and not subject.done and extracted is None:
        try:
            regions = _regions(subject.roi, panel, header)
            extracted = _measure(context, subject, regions, header, acceptance.exposure, file)
        except InputRejected as refusal:
            # the region is wrong for this frame, not the frame for its campaign; the whole frame is no region
            if not drawn or refusal.code not in (shared.ROI_OUTSIDE_FRAME, shared.ROI_EMPTY):
                raise
            region_refused = refusal
    return _Found(
        header=header,
        acceptance=acceptance,
        flags=flags,
        preview=preview,
        proof=proof,
        extracted=extracted,
        region_refused=region_refused,
        panel=panel,
        siblings=siblings,
    )


def _find_panel(
    context: Context, subject: _Subject, header: FrameHeader, file: blobs.StoredFile
) -> tuple[FoundRegion | None, int]:
    """Find it in the frame, else where other bands of the capture show it; return how many those are too."""
    frame, campaign = subject.frame, subject.campaign
    room = methods.get_method(campaign.method)
    known = subject.roi is not None and bool(frame.found)
    if known or not room.finds_region or frame.role not in room.role_names:
        return None, 0
    whole = context.decoders.read_window(file, (0, 0, header.height_px, header.width_px))
    found = room.find_region(whole, header=header)
    if subject.roi is not None or (found is not None and found.region is not None):
        return found, 0
    taken, siblings = take_region(context, campaign, frame.id, whole, header)
    return taken or found, siblings


def _measure(
    context: Context,
    subject: _Subject,
    regions: list[Region],
    header: FrameHeader,
    exposure: Exposure | None,
    file: blobs.StoredFile,
) -> _Extracted:
    room = methods.get_method(subject.campaign.method)
    around = Polygon.from_points(subject.roi.points) if subject.roi else regions[0].polygon
    window = bounding_window(around, height_px=header.height_px, width_px=header.width_px)
    pixels = context.decoders.read_window(file, (window.row0, window.col0, window.height, window.width))
    target = subject.campaign.target
    extracted = room.extract(
        pixels,
        regions,
        header=header,
        exposure=exposure,
        target=decode(room.target, target) if room.target and target else None,
    )
    return _Extracted(
        rows=[asdict(row) for row in extracted.statistics],
        features=encode(extracted.features) if extracted.features is not None else None,
    )


def _regions(roi: Roi | None, panel: FoundRegion | None, header: FrameHeader) -> list[Region]:
    if roi is None:
        shown = panel.region if panel is not None else None
        return [Region(name="", polygon=shown or frames.whole_frame(header.width_px, header.height_px))]
    parts = roi.parts or [{"name": "", "points": roi.points}]
    return [Region(name=part["name"], polygon=Polygon.from_points(part["points"])) for part in parts]


def _inspect(context: Context, subject: _Subject, file: blobs.StoredFile) -> tuple[_Preview | None, Proof]:
    """Read all of the frame once: what is found then holds for every later reading of a part."""
    if subject.has_preview and subject.frame.proof:
        return None, decode(Proof, subject.frame.proof)
    preview, proof = context.decoders.inspect(file)
    return (context.blobs.keep([preview]), reduce_preview(preview)), proof


def _store(session: Session, subject: _Subject, found: _Found) -> dict[str, Any]:
    # locked: a region that a person draws meanwhile is seen here, or comes after this
    frame = session.get_one(FrameRow, subject.frame.id, with_for_update=True)
    campaign = session.get_one(Campaign, frame.campaign_id)
    if found.preview is not None:
        blob, small = found.preview
        keep_blobs(session, [blob])
        keep_small_previews(session, {blob.sha256: small})
        frame.preview_sha256 = blob.sha256
    frame.header, frame.proof = encode(found.header), encode(found.proof)
    _store_acceptance(frame, found)
    roi = subject.roi
    if found.panel is not None:
        roi = _keep_panel(session, frame, campaign, found.panel) or roi
    ask_siblings(session, campaign, frame, found.header, considered=found.siblings)
    if found.extracted is not None and (roi is not None or found.panel is None or found.panel.region is None):
        _store_extraction(session, subject, frame, roi, found.extracted)
    now = frames.current_roi(session, frame, campaign)
    # what the campaign is told to look for may have changed meanwhile: then another job is on its way
    extractor = frames.extractor_of(campaign)
    extraction = frames.find_extraction(session, frame, now, extractor) if now is not None else None
    frame.state = "read" if extraction is None else "extracted"
    if extraction is not None and extraction.features is not None:
        room = methods.get_method(campaign.method)
        raised = room.check_features(decode(room.features, extraction.features))
        frame.warnings = [*frame.warnings, *(each.flag for each in raised)]
    return {"frame_id": frame.id}


def _keep_panel(session: Session, frame: FrameRow, campaign: Campaign, panel: FoundRegion) -> Roi | None:
    """Keep its serial, and its region unless somebody has drawn one, or changed the role, meanwhile."""
    if frame.role not in methods.get_method(campaign.method).role_names:
        return None
    albedo = panel.read_albedo(((frame.header or {}).get("multispectral") or {}).get("wavelength_nm"))
    frame.found = {"serial": panel.serial, "by": panel.by, **({"albedo": albedo} if albedo else {})}
    if panel.region is None or frames.current_roi(session, frame, campaign) is not None:
        return None
    drawing = campaigns.Drawing(polygon=panel.region, corners=panel.region.points)
    roi = campaigns.find_or_add_roi(session, campaign.organisation_id, drawing)
    frame.roi_id, frame.found = roi.id, {**frame.found, "roi_id": roi.id}
    return roi


def _store_extraction(
    session: Session, subject: _Subject, frame: FrameRow, roi: Roi | None, extracted: _Extracted
) -> None:
    extractor = frames.extractor_of(subject.campaign)
    if roi is None:
        whole = frames.whole_frame_of(frame)
        drawing = campaigns.Drawing(polygon=whole, corners=whole.points)
        roi = campaigns.find_or_add_roi(session, subject.campaign.organisation_id, drawing)
    if frames.find_extraction(session, frame, roi, extractor) is None:
        frames.add_extraction(
            session, frame, roi, extractor, rows=extracted.rows, features=extracted.features
        )


def _store_acceptance(frame: FrameRow, found: _Found) -> None:
    # together: the row may be written before the rest is known, and must be whole then
    frame.state, frame.refusal_code, frame.refusal_detail = "read", None, None
    frame.warnings = list(found.flags)
    if found.proof.wholeness.empty:
        frame.warnings.append(shared.IMAGE_PART_EMPTY)
    if found.proof.highest_dn > max(found.header.white_level_dn):
        frame.warnings.append(str(shared.SAMPLES_ABOVE_WHITE.code))
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
        frame.state, frame.exposure = "refused", None
        frame.refusal_code, frame.refusal_detail = str(refusal.code), refusal.message
        return {"frame_id": frame_id}

    return Outcome(store=store, rejection=refusal)
