"""Every version of a camera that was ever published and still stands, as repeats of one determination."""

from collections.abc import Mapping, Sequence

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from radiometry.fleet.determinations import Determination, Key, Source
from store.queries.calibrations import coefficients_of
from store.tables import Calibration, Camera, Campaign, CoefficientRow, FrameRow, Publication, Revocation


def list_determinations(
    session: Session, cameras: Sequence[Camera], method: str, lenses: Mapping[str, str]
) -> list[Determination]:
    """The coefficients of the cameras' published versions, not those revoked, by camera and version.

    A version is dated by its campaign, else by the earliest time for which it was published. Its lens is, in
    this order: the one said in ``lenses`` (by version), that of the campaign's first frame, the camera's own.
    """
    sources = list_sources(session, cameras, method, lenses)
    rows = coefficients_of(session, [source.version for source in sources])
    return [
        Determination(
            key=_key(row), value=row.value, standard_uncertainty=row.standard_uncertainty, source=source
        )
        for source in sources
        for row in rows[source.version]
    ]


def list_sources(
    session: Session, cameras: Sequence[Camera], method: str, lenses: Mapping[str, str]
) -> list[Source]:
    serials = {camera.id: camera.serial for camera in cameras}
    published = (
        select(Publication.calibration_id, func.min(Publication.valid_from).label("valid_from"))
        .group_by(Publication.calibration_id)
        .subquery()
    )
    rows = session.execute(
        select(
            Calibration.id,
            Calibration.camera_id,
            Calibration.campaign_id,
            Calibration.configuration,
            Campaign.started_at,
            published.c.valid_from,
        )
        .join(published, published.c.calibration_id == Calibration.id)
        .join(Campaign, Campaign.id == Calibration.campaign_id)
        .where(Calibration.camera_id.in_(serials), Calibration.method == method)
        .where(Calibration.id.not_in(select(Revocation.calibration_id)))
        .order_by(Calibration.camera_id, Calibration.version)
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
    first = (
        select(func.min(FrameRow.id))
        .where(FrameRow.campaign_id.in_(campaign_ids), FrameRow.state.in_(("read", "extracted")))
        .group_by(FrameRow.campaign_id)
    )
    rows = session.execute(select(FrameRow.campaign_id, FrameRow.header).where(FrameRow.id.in_(first)))
    headers = ((campaign_id, header or {}) for campaign_id, header in rows)
    return {
        campaign_id: header["lens_serial"] for campaign_id, header in headers if header.get("lens_serial")
    }


def _key(row: CoefficientRow) -> Key:
    return Key(
        name=row.name,
        unit=row.unit,
        model=row.model,
        iso=row.iso,
        f_number=row.f_number,
        band=row.band,
        channel=row.channel,
    )
