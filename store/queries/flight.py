"""When the frames were taken that a version is applied to."""

from datetime import UTC, datetime

from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from radiometry.methods import get_method
from store.tables import Calibration, FrameRow, Measurement


def list_flight(session: Session, calibration: Calibration) -> list[datetime]:
    """Return the times of frames measured with it, or to be in its campaign; none if no plot shows them."""
    spec = get_method(calibration.method)
    if not spec.draws_flight:
        return []
    measured = select(Measurement.frame_id).where(Measurement.calibration_id == calibration.id)
    to_measure = (FrameRow.campaign_id == calibration.campaign_id) & FrameRow.role.in_(
        spec.applied_role_names
    )
    to_measure &= FrameRow.withdrawn_at.is_(None)
    stated = session.scalars(
        select(FrameRow.header["taken_at"].as_string())
        .where(or_(FrameRow.id.in_(measured), to_measure), FrameRow.header.is_not(None))
        .distinct()
    )
    times = (datetime.fromisoformat(each) for each in stated if each is not None)
    return sorted(at if at.tzinfo else at.replace(tzinfo=UTC) for at in times)
