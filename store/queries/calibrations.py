"""Versions: how each stands, what was decided of it, and when it was and may be in force."""

from collections.abc import Mapping
from dataclasses import field, replace
from datetime import UTC, datetime, timedelta
from typing import Literal

from sqlalchemy import ColumnElement, Select, case, func, or_, select
from sqlalchemy.orm import Session

from radiometry.methods import get_method
from radiometry.records import Record, about
from store import tables
from store.queries import group_by
from store.queries.frame_times import find_time, read_zones
from store.tables import AuditEntry, Calibration, CoefficientRow, FrameRow, Publication, Revocation, Slot

VersionState = Literal["draft", "published", "superseded", "revoked"]


class VersionStatus(Record):
    state: VersionState
    valid_from: datetime | None = None
    valid_to: datetime | None = None
    superseded_by: str | None = None
    successor: int | None = None  # the number of the version that ``superseded_by`` is the id of
    revoked_reason: str | None = None


def read_version_statuses(session: Session, calibration_ids: list[str]) -> dict[str, VersionStatus]:
    ended = session.scalars(select(Revocation).where(Revocation.calibration_id.in_(calibration_ids)))
    revoked = {row.calibration_id: row for row in ended}
    mine = select(Publication).where(Publication.calibration_id.in_(calibration_ids))
    rows = session.scalars(mine.order_by(Publication.known_from, Publication.valid_from))
    published = group_by(rows, lambda row: row.calibration_id)
    statuses = {key: _find_status(published[key], revoked.get(key)) for key in calibration_ids}
    return _name_successors(session, statuses)


def _name_successors(session: Session, found: dict[str, VersionStatus]) -> dict[str, VersionStatus]:
    if not (ids := {status.superseded_by for status in found.values()} - {None}):
        return found
    rows = session.execute(select(Calibration.id, Calibration.version).where(Calibration.id.in_(ids)))
    numbers = {row[0]: row[1] for row in rows}
    return {
        key: replace(each, successor=numbers.get(each.superseded_by or "")) for key, each in found.items()
    }


def _find_status(rows: list[Publication], revocation: Revocation | None) -> VersionStatus:
    if revocation is not None:
        return VersionStatus(state="revoked", revoked_reason=revocation.reason)
    if not rows:
        return VersionStatus(state="draft")
    in_force = [row for row in rows if row.known_to is None]
    superseded_by = next((row.superseded_by for row in reversed(rows) if row.superseded_by), None)
    state: VersionState = "published" if any(row.superseded_by is None for row in in_force) else "superseded"
    if not in_force:
        return VersionStatus(state=state, superseded_by=superseded_by)
    ends = [row.valid_to for row in in_force]
    return VersionStatus(
        state=state,
        valid_from=min(row.valid_from for row in in_force),
        valid_to=max((end for end in ends if end), default=None) if all(ends) else None,
        superseded_by=superseded_by if state == "superseded" else None,
    )


_REVOKED = select(Revocation.calibration_id).where(Revocation.calibration_id == Calibration.id)
_PUBLISHED = select(Publication.id).where(Publication.calibration_id == Calibration.id)
_IN_FORCE = _PUBLISHED.where(Publication.known_to.is_(None), Publication.superseded_by.is_(None))
version_state: ColumnElement[str] = case(
    (_REVOKED.exists(), "revoked"),
    (~_PUBLISHED.exists(), "draft"),
    (_IN_FORCE.exists(), "published"),
    else_="superseded",
)
"""What has become of a version, as the database decides it."""


def history(camera_id: str, *, method: str | None, state: str | None) -> Select[Calibration]:
    """A camera's versions, by their state in the database, so that a page is a page."""
    rows = select(Calibration).where(Calibration.camera_id == camera_id)
    if method is not None:
        rows = rows.where(Calibration.method == method)
    return rows if state is None else rows.where(version_state == state)


def coefficients_of(session: Session, calibration_ids: list[str]) -> Mapping[str, list[CoefficientRow]]:
    mine = select(CoefficientRow).where(CoefficientRow.calibration_id.in_(calibration_ids))
    rows = session.scalars(mine.order_by(CoefficientRow.calibration_id, CoefficientRow.position))
    return group_by(rows, lambda row: row.calibration_id)


def next_version(session: Session, camera_id: str, method: str) -> int:
    """The number after the last; two that ask at once collide on the unique key, and one asks again."""
    mine = (Calibration.camera_id == camera_id) & (Calibration.method == method)
    return (session.scalar(select(func.max(Calibration.version)).where(mine)) or 0) + 1


class Act(Record):
    by: str
    publication: Publication


class Decision(Record):
    act: Literal["made", "published", "revoked"]
    calibration: Calibration
    at: datetime
    by: str = about("The id of the key.")
    reason: str | None = None
    valid_from: datetime | None = about("As it was published.", default=None)
    valid_to: datetime | None = None


def list_publishings(session: Session, slot_ids: Select[int]) -> list[Act]:
    """List what was published in these slots, oldest first.

    Of rows of one instant only the last is what somebody published: the others are rests of older ones.
    """
    rows = session.execute(
        select(Publication, AuditEntry)
        .join(AuditEntry, AuditEntry.subject_id == Publication.id)
        .where(AuditEntry.action == "publication.create", Publication.slot_id.in_(slot_ids))
        .order_by(AuditEntry.seq)
    )
    last = {(row[0].known_from, row[0].slot_id): Act(by=row[1].actor, publication=row[0]) for row in rows}
    return [act for _, act in sorted(last.items())]


def list_decisions(session: Session, camera_id: str) -> list[Decision]:
    """Everything that was decided of a camera's versions, newest first."""
    rows = session.scalars(select(Calibration).where(Calibration.camera_id == camera_id)).all()
    versions = {row.id: row for row in rows}
    found = [Decision(act="made", calibration=row, at=row.created_at, by=row.created_by) for row in rows]
    for act in list_publishings(session, select(Slot.id).where(Slot.camera_id == camera_id)):
        row = act.publication
        said = {name: getattr(row, name) for name in ("reason", "valid_from", "valid_to")}
        version = versions[row.calibration_id]
        found.append(Decision(act="published", calibration=version, at=row.known_from, by=act.by, **said))
    for end in session.scalars(select(Revocation).where(Revocation.calibration_id.in_(versions))):
        said = {"at": end.revoked_at, "by": end.revoked_by, "reason": end.reason}
        found.append(Decision(act="revoked", calibration=versions[end.calibration_id], **said))
    return sorted(found, key=lambda each: (each.at, each.calibration.id), reverse=True)


class Lifetime(Record):
    calibration: Calibration
    coefficients: list[CoefficientRow]
    in_force: list[Publication] = field(default_factory=list)
    revoked_from: list[Publication] = field(default_factory=list)
    published: list[Act] = field(default_factory=list)
    revocation: Revocation | None = None


def list_lifetimes(session: Session, camera_id: str, method: str, known_at: datetime) -> list[Lifetime]:
    """List every version that had been published by ``known_at``, newest first."""
    slots = select(Slot.id).where(Slot.camera_id == camera_id, Slot.method == method)
    known = [act for act in list_publishings(session, slots) if act.publication.known_from <= known_at]
    acts = group_by(known, lambda act: act.publication.calibration_id)
    of_slots = select(Publication).where(Publication.slot_id.in_(slots), Publication.known_from <= known_at)
    found = session.scalars(of_slots.order_by(Publication.valid_from))
    rows = group_by(found, lambda row: row.calibration_id)
    ended = select(Revocation).where(Revocation.calibration_id.in_(acts), Revocation.revoked_at <= known_at)
    revoked = {row.calibration_id: row for row in session.scalars(ended)}
    versions = session.scalars(select(Calibration).where(Calibration.id.in_(acts)))
    coefficients = coefficients_of(session, list(acts))
    return [
        Lifetime(
            calibration=version,
            coefficients=coefficients[version.id],
            in_force=[row for row in rows[version.id] if row.known_to is None or row.known_to > known_at],
            revoked_from=[
                row
                for row in rows[version.id]
                if version.id in revoked and row.known_to == revoked[version.id].revoked_at
            ],
            published=acts[version.id],
            revocation=revoked.get(version.id),
        )
        for version in sorted(versions, key=lambda each: -each.version)
    ]


_SYSTEM = FrameRow.header["multispectral"]["system"].as_string()


def list_flight(session: Session, calibration: Calibration) -> list[datetime]:
    """Return the times of frames measured with it, or to be in its campaign; none if no plot shows them."""
    spec = get_method(calibration.method)
    if not spec.of_one_flight:
        return []
    measured = select(tables.Measurement.frame_id).where(tables.Measurement.calibration_id == calibration.id)
    to_measure = FrameRow.role.in_(spec.applied_role_names) & FrameRow.standing(calibration.campaign_id)
    wanted = or_(FrameRow.id.in_(measured), to_measure) & FrameRow.header.is_not(None)
    stated = session.scalars(select(FrameRow.header["taken_at"].as_string()).where(wanted).distinct())
    times = (datetime.fromisoformat(each) for each in stated if each is not None)
    return sorted(at if at.tzinfo else at.replace(tzinfo=UTC) for at in times)


def suggest_validity(session: Session, calibration: Calibration) -> tuple[datetime, datetime | None]:
    """Return when a version may be in force: of one flight until its frames' last day ends, in UTC."""
    campaign = session.get_one(tables.Campaign, calibration.campaign_id)
    zones = read_zones(session, campaign)
    read = FrameRow.standing(campaign.id) & FrameRow.header.is_not(None)
    rows = select(FrameRow.header["taken_at"].as_string(), _SYSTEM).where(read)
    stated = session.execute(rows.distinct())
    if not (times := [taken for at, system in stated if (taken := find_time(at, zones, system=system))]):
        return campaign.started_at or calibration.created_at, None
    start = _begin_day(min(taken.earliest for taken in times))
    if get_method(calibration.method).of_one_flight:
        return start, _begin_day(max(taken.latest for taken in times)) + timedelta(days=1)
    return campaign.started_at or start, None


def _begin_day(at: datetime) -> datetime:
    return at.astimezone(UTC).replace(hour=0, minute=0, second=0, microsecond=0)
