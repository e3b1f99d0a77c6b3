"""Rigs, and what orients them: versions of each camera with the frames that they were made from."""

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.fitting.evidence import FrameEvidence
from radiometry.fleet.determinations import LeftOut, keep_repeats
from radiometry.fleet.drift import RigVersion
from radiometry.methods import METHODS, get_method
from radiometry.specification.exports import RigMember
from store.codec import decode, decode_header
from store.fits import read_result
from store.queries.fleet import list_sources
from store.tables import Calibration, Camera, Extraction, FrameRow, Rig, Roi

METHOD, SPEC = next((each.name, each.rig) for each in METHODS if each.rig)


def find_or_add_rig(
    session: Session, organisation_id: str, *, name: str, camera_ids: Sequence[str]
) -> tuple[Rig, bool]:
    """The rig of this name, and whether it is new; its cameras never change."""
    found = session.scalar(select(Rig).where(Rig.organisation_id == organisation_id, Rig.name == name))
    if found is not None:
        return found, False
    rig = Rig(organisation_id=organisation_id, name=name, camera_ids=list(camera_ids))
    session.add(rig)
    session.flush()
    return rig, True


def list_cameras(session: Session, rig: Rig) -> list[Camera]:
    """The cameras of a rig, the reference first."""
    return [session.get_one(Camera, camera_id) for camera_id in rig.camera_ids]


def list_versions(session: Session, camera: Camera) -> tuple[list[RigVersion], tuple[LeftOut, ...]]:
    """The published versions of a camera that its rig's orientation can follow from, one per campaign."""
    kept, left_out = keep_repeats(list_sources(session, [camera], METHOD, {}))
    found = [
        RigVersion(
            version=source.version,
            at=source.at,
            member=read_member(session, session.get_one(Calibration, source.version), camera),
        )
        for source in kept
    ]
    return found, left_out


def read_member(session: Session, calibration: Calibration, camera: Camera) -> RigMember:
    """A version with its frames; their scenes are as they are now, so that a wrong one can be corrected."""
    spec = get_method(calibration.method)
    names = {each["sha256"]: (each["frame"], each["roi_sha256"]) for each in calibration.inputs["frames"]}
    rows = session.execute(
        select(FrameRow, Extraction.features, Roi.sha256)
        .join(Extraction, Extraction.frame_id == FrameRow.id)
        .join(Roi, Roi.id == Extraction.roi_id)
        .where(FrameRow.campaign_id == calibration.campaign_id)
        .where(Extraction.extractor == calibration.inputs["extractor"])
        .order_by(FrameRow.id, Extraction.id)
    )
    frames = {
        names[row.sha256][0]: FrameEvidence(
            frame=names[row.sha256][0],
            role=row.role,
            scene=row.scene,
            header=decode_header(row.header or {}),
            exposure=None,
            statistics=None,
            features=decode(spec.features, features) if features else None,
        )
        for row, features, roi_sha256 in rows
        if row.sha256 in names and names[row.sha256][1] == roi_sha256
    }
    return RigMember(
        serial=camera.serial,
        fitted=read_result(calibration),
        params=decode(spec.params, calibration.parameters),
        rows=tuple(frames[name] for name in sorted(frames)),
    )
