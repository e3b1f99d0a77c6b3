"""When, where and with which meters a campaign was done, as far as the record knows."""

from collections.abc import Iterable
from datetime import date

from service.schemas.certificates import DaysFrom, UsedMeter, Work
from store.queries.calibration_record import CalibrationRecord


def describe_work(record: CalibrationRecord) -> Work:
    """The campaign's own words, and the days on which it was done."""
    campaign = record.campaign
    days, days_from = _days(record)
    return Work.restate(
        campaign,
        campaign_id=campaign.id,
        first_day=min(days, default=None),
        last_day=max(days, default=None),
        days_from=days_from if days else None,
    )


def describe_meters(record: CalibrationRecord) -> list[UsedMeter]:
    """Each meter with its certificate of then and the days on which it was read."""
    campaign_days, _ = _days(record)
    meters = []
    for meter in record.meters.values():
        readings = [reading for reading in record.readings if reading and reading.meter_id == meter.row.id]
        days = [reading.taken_at.date() for reading in readings if reading.taken_at] or campaign_days
        meters.append(
            UsedMeter.restate(
                meter.row,
                certificate=meter.certificate or None,
                readings=len(readings),
                first_day=min(days, default=None),
                last_day=max(days, default=None),
            )
        )
    return meters


def _days(record: CalibrationRecord) -> tuple[list[date], DaysFrom]:
    """The days of the readings; else the day the campaign began; else those of the frames' own clock."""
    taken = [reading.taken_at.date() for reading in record.readings if reading and reading.taken_at]
    if taken:
        return taken, "readings"
    if record.campaign.started_at:
        return [record.campaign.started_at.date()], "campaign"
    headers = [frame.row.header or {} for frame in record.frames.values()]
    return list(_read_days(header.get("taken_at") for header in headers)), "frames"


def _read_days(stamps: Iterable[str | None]) -> Iterable[date]:
    for stamp in stamps:
        try:
            yield date.fromisoformat((stamp or "")[:10])
        except ValueError:
            continue  # a camera whose clock was never set
