"""When a frame was taken: by the offset in its file, else by its campaign's or organisation's time zone."""

import re
from collections.abc import Iterable
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from functools import cache
from typing import Any
from zoneinfo import ZoneInfo, available_timezones

from pydantic import TypeAdapter
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, shared
from radiometry.frame import FrameHeader, has_set_clock, writes_utc
from radiometry.records import Record
from store.codec import decode_header
from store.tables import Campaign, FrameRow, Organisation

# A time without an offset is somewhere between UTC+14 and UTC-12.
_EARLIEST, _LATEST = timedelta(hours=-14), timedelta(hours=12)
_OFFSET = re.compile(r"([+-])(\d\d):([0-5]\d)")
_INSTANT = TypeAdapter(datetime)


@cache
def _list_names() -> dict[str, str]:
    return {name.casefold(): name for name in available_timezones()}


def name_zone(text: str) -> str:
    """Return an IANA name as it is spelt, or an offset (-12:00 to +14:00); ValueError for anything else."""
    if offset := _OFFSET.fullmatch(text):
        shift = _read_offset(offset)
        if -_LATEST <= shift <= -_EARLIEST:
            return text
    elif text.casefold() in _list_names():
        return _list_names()[text.casefold()]
    raise ValueError("is no time zone: write an IANA name (Europe/Berlin) or an offset (+02:00)")


def _read_offset(match: re.Match[str]) -> timedelta:
    shift = timedelta(hours=int(match[2]), minutes=int(match[3]))
    return -shift if match[1] == "-" else shift


@cache
def _read_zone(name: str) -> tzinfo:
    offset = _OFFSET.fullmatch(name)
    return timezone(_read_offset(offset)) if offset else ZoneInfo(name)


class Zones(Record):
    """Time zones stated for the clock of a camera; absent where none is."""

    campaign: str | None = None
    organisation: str | None = None

    @property
    def stated(self) -> str | None:
        return self.campaign or self.organisation


class FrameTime(Record):
    """The instants at which a frame may have been taken: one, unless the offset of its clock is unknown."""

    stated: str
    earliest: datetime
    latest: datetime
    zone: str | None = None
    why: str = ""

    @property
    def is_known(self) -> bool:
        return self.earliest == self.latest

    def describe(self) -> str:
        """Return the time as the file states it, with the zone that was applied."""
        return f"{self.stated} ({self.zone}, {self.why})" if self.zone else self.stated


class FrameClocks:
    """Time zones of the campaigns of many frames, each read once."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._zones: dict[str, Zones] = {}

    def find(self, frame: FrameRow) -> FrameTime | None:
        """Return when a frame was taken; None if its file has no time, or its clock was never set."""
        if frame.campaign_id not in self._zones:
            campaign = self._session.get_one(Campaign, frame.campaign_id)
            self._zones[frame.campaign_id] = read_zones(self._session, campaign)
        return read_frame_time(frame, self._zones[frame.campaign_id])


def read_zones(session: Session, campaign: Campaign) -> Zones:
    organisation = session.get_one(Organisation, campaign.organisation_id)
    return Zones(campaign=campaign.time_zone, organisation=organisation.time_zone)


def read_frame_time(frame: FrameRow, zones: Zones) -> FrameTime | None:
    header: dict[str, Any] = frame.header or {}
    system = (header.get("multispectral") or {}).get("system")
    return find_time(header.get("taken_at"), zones, system=system)


def find_time(stated: str | None, zones: Zones, *, system: str | None = None) -> FrameTime | None:
    """Return when a frame was taken; None if its file has no time, or its clock was never set.

    First its offset counts, then the campaign's zone, UTC of a ``system`` that writes it, the organisation's.
    """
    if stated is None:
        return None
    at: datetime = _INSTANT.validate_python(stated)
    if not has_set_clock(at):
        return None
    if at.tzinfo is None and zones.campaign is None and writes_utc(system):
        at = at.replace(tzinfo=UTC)
    if at.tzinfo is not None:
        return FrameTime(stated=stated, earliest=at, latest=at)
    if zones.stated is None:
        at = at.replace(tzinfo=UTC)
        return FrameTime(stated=stated, earliest=at + _EARLIEST, latest=at + _LATEST)
    # an hour that a clock shows twice, or skips, in the night when it is changed
    zone = _read_zone(zones.stated)
    instants = [at.replace(tzinfo=zone, fold=fold).astimezone(UTC) for fold in (0, 1)]
    why = f"as its {'campaign' if zones.campaign else 'organisation'} states"
    return FrameTime(stated=stated, earliest=min(instants), latest=max(instants), zone=zones.stated, why=why)


def find_offset(header: FrameHeader | None, zones: Zones) -> str | None:
    """Return the offset of a clock that states none, in a stated zone; None if it may be one of two."""
    if header is None or zones.stated is None:
        return None
    system = header.multispectral.system if header.multispectral else None
    taken = find_time(header.taken_at, zones, system=system)
    if taken is None or taken.zone is None or not taken.is_known:
        return None
    return taken.earliest.astimezone(_read_zone(taken.zone)).isoformat()[-6:]


def read_header(frame: FrameRow, zone: str | None) -> FrameHeader:
    """Return a frame's header, with the offset of its clock in the zone that a measurement was made with."""
    header = decode_header(frame.header or {})
    return replace(header, clock_offset=find_offset(header, Zones(campaign=zone)))


def refuse_timeless(filename: str, stated: str | None, *, wanted: str) -> InputRejected:
    """Return the refusal of a frame without a time; ``wanted``: what to name instead of looking it up."""
    reason = f"Frame {filename} does not state when it was taken"
    if stated is not None:
        reason = f"The camera's clock was not set: frame {filename} states {stated}"
    return InputRejected(
        shared.FRAME_TIME_MISSING, f"{reason}, so no {wanted} can be looked up: name one with {wanted}_id."
    )


def advise_zone(times: Iterable[FrameTime]) -> str:
    """Return the advice to state a time zone, to go on a list of what to do; "" where none is missing."""
    needed = any(not taken.is_known and taken.zone is None for taken in times)
    return ", state the campaign's time_zone" if needed else ""
