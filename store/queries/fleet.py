"""Versions as repeats of one determination, and what orients the cameras of a rig."""

from collections.abc import Mapping, Sequence
from dataclasses import fields

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from radiometry.fitting.evidence import FrameEvidence
from radiometry.fleet.determinations import Determination, Key, LeftOut, Source, keep_repeats
from radiometry.fleet.drift import RigVersion
from radiometry.methods import METHODS, get_method
from radiometry.specification.exports import RigMember
from store import fits, tables
from store.codec import decode, decode_header
from store.queries.calibrations import coefficients_of


def list_determinations(
    session: Session, cameras: Sequence[tables.Camera], method: str, lenses: Mapping[str, str]
) -> list[Determination]:
    """The coefficients of the cameras' published versions, not those revoked, by camera and version.

    ``lenses``: by version, before that of the campaign's first frame and the camera's own.
    """
    sources = list_sources(session, cameras, method, lenses)
    rows = coefficients_of(session, [source.version for source in sources])
    return [
        Determination(
            key=Key(**{each.name: getattr(row, each.name) for each in fields(Key)}),
            value=row.value,
            standard_uncertainty=row.standard_uncertainty,
            source=source,
        )
        for source in sources
        for row in rows[source.version]
    ]


def list_sources(
    session: Session, cameras: Sequence[tables.Camera], method: str, lenses: Mapping[str, str]
) -> list[Source]:
    serials = {camera.id: camera.serial for camera in cameras}
    version, first = tables.Publication.calibration_id, func.min(tables.Publication.valid_from)
    published = select(version, first.label("valid_from")).group_by(version).subquery()
    made = tables.Calibration
    columns = (made.id, made.camera_id, made.campaign_id, made.configuration, tables.Campaign.started_at)
    rows = session.execute(
        select(*columns, published.c.valid_from)
        .join(published, published.c.calibration_id == made.id)
        .join(tables.Campaign, tables.Campaign.id == made.campaign_id)
        .where(made.camera_id.in_(serials), made.method == method)
        .where(made.id.not_in(select(tables.Revocation.calibration_id)))
        .order_by(made.camera_id, made.version)
    ).all()
    written = _read_lenses(session, {row.campaign_id for row in rows})
    return [
        Source(
            version=row.id,
            camera=serials[row.camera_id],
            lens=lenses.get(row.id)
            or written.get(row.campaign_id)
            or row.configuration.get("lens", {}).get("serial"),
            campaign=row.campaign_id,
            at=row.started_at or row.valid_from,
        )
        for row in rows
    ]


def _read_lenses(session: Session, campaign_ids: set[str]) -> dict[str, str]:
    """The lens's serial number as each campaign's first frame states it; a lens stays on for a campaign."""
    frame = tables.FrameRow
    read = frame.campaign_id.in_(campaign_ids) & frame.state.in_(("read", "extracted"))
    first = select(func.min(frame.id)).where(read).group_by(frame.campaign_id)
    rows = session.execute(select(frame.campaign_id, frame.header).where(frame.id.in_(first)))
    headers = ((campaign_id, header or {}) for campaign_id, header in rows)
    return {key: header["lens_serial"] for key, header in headers if header.get("lens_serial")}


METHOD, SPEC = next((each.name, each.rig) for each in METHODS if each.rig)


def list_cameras(session: Session, rig: tables.Rig) -> list[tables.Camera]:
    """The cameras of a rig, the reference first."""
    return [session.get_one(tables.Camera, camera_id) for camera_id in rig.camera_ids]


def list_versions(session: Session, camera: tables.Camera) -> tuple[list[RigVersion], tuple[LeftOut, ...]]:
    """The published versions of a camera that its rig's orientation can follow from, one per campaign."""
    kept, left_out = keep_repeats(list_sources(session, [camera], METHOD, {}))
    found = []
    for source in kept:
        member = read_member(session, session.get_one(tables.Calibration, source.version), camera)
        found.append(RigVersion(version=source.version, at=source.at, member=member))
    return found, left_out


def read_member(session: Session, calibration: tables.Calibration, camera: tables.Camera) -> RigMember:
    """A version with its frames; their scenes are as they are now, so that a wrong one can be corrected."""
    spec = get_method(calibration.method)
    names = {each["sha256"]: (each["frame"], each["roi_sha256"]) for each in calibration.inputs["frames"]}
    rows = session.execute(
        select(tables.FrameRow, tables.Extraction.features, tables.Roi.sha256)
        .join(tables.Extraction, tables.Extraction.frame_id == tables.FrameRow.id)
        .join(tables.Roi, tables.Roi.id == tables.Extraction.roi_id)
        .where(tables.FrameRow.campaign_id == calibration.campaign_id)
        .where(tables.Extraction.extractor == calibration.inputs["extractor"])
        .order_by(tables.FrameRow.id, tables.Extraction.id)
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
        fitted=fits.read_result(calibration),
        params=decode(spec.params, calibration.parameters),
        rows=tuple(frames[name] for name in sorted(frames)),
    )
