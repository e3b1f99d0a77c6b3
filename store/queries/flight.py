"""When the frames were taken that a version was fitted from, or is applied to."""

from datetime import UTC, datetime, timedelta

from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from radiometry.methods import get_method
from store.frame_times import find_time, read_zones
from store.tables import Calibration, Campaign, FrameRow, Measurement

_SYSTEM = FrameRow.header["multispectral"]["system"].as_string()


def list_flight(session: Session, calibration: Calibration) -> list[datetime]:
    """Return the times of frames measured with it, or to be in its campaign; none if no plot shows them."""
    spec = get_method(calibration.method)
    if not spec.of_one_flight:
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


def suggest_validity(session: Session, calibration: Calibration) -> tuple[datetime, datetime | None]:
    """Return when a version may be in force, so that what was taken with its campaign is measured with it.

    A version of one flight ends with the last day of its frames, in UTC; any other is in force until it is
    replaced.
    """
    campaign = session.get_one(Campaign, calibration.campaign_id)
    zones = read_zones(session, campaign)
    stated = session.execute(
        select(FrameRow.header["taken_at"].as_string(), _SYSTEM)
        .where(FrameRow.campaign_id == campaign.id, FrameRow.header.is_not(None))
        .where(FrameRow.withdrawn_at.is_(None))
        .distinct()
    )
    times = [taken for at, system in stated if (taken := find_time(at, zones, system=system))]
    if not times:
        return campaign.started_at or calibration.created_at, None
    start = _begin_day(min(taken.earliest for taken in times))
    if get_method(calibration.method).of_one_flight:
        return start, _begin_day(max(taken.latest for taken in times)) + timedelta(days=1)
    return campaign.started_at or start, None


def _begin_day(at: datetime) -> datetime:
    return at.astimezone(UTC).replace(hour=0, minute=0, second=0, microsecond=0)
