"""Which version a frame is measured with: the one that is named, or the one in force when it was taken."""

from typing import Any

from sqlalchemy import ColumnElement, select, true
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, interface, shared
from radiometry.methods import get_method
from store.errors import Conflict
from store.frame_times import FrameTime, advise_zone, read_frame_time, read_zones, refuse_timeless
from store.publications import InForce, list_between, overlaps
from store.ready.publications import write_instant
from store.tables import Calibration, Campaign, FrameRow, Publication, Revocation


def choose_version(
    session: Session, frame: FrameRow, campaign: Campaign, named: Calibration | None
) -> tuple[Calibration, str, str]:
    """The version, whether it was named or found in force, and the sentence that says why."""
    if named is None:
        held, why = _find_in_force(session, frame, campaign)
        return held.calibration, "in_force", why
    if named.camera_id != campaign.camera_id:
        raise InputRejected(
            shared.WRONG_CAMERA,
            f"Frame {frame.filename} was taken by another camera than calibration {named.id} is for. "
            "Name a calibration of the frame's camera, or leave calibration_id out.",
        )
    if named.method != campaign.method:
        raise Conflict(
            interface.METHOD_MISMATCH,
            f"Calibration {named.id} is of {named.method}; measuring this frame needs {campaign.method}.",
        )
    if session.get(Revocation, named.id):
        raise Conflict(shared.CALIBRATION_REVOKED, "This version was revoked: measure with one that stands.")
    return named, "named", f"version {named.version} was named in the request"


def _find_own(
    session: Session, frame: FrameRow, campaign: Campaign, taken: FrameTime | None
) -> InForce | None:
    """Find the version of the frame's own campaign that is in force at a time that may be the frame's.

    A coefficient of one flight stays that flight's when another flight's was published for the same day.
    """
    held: ColumnElement[bool] = Publication.known_to.is_(None)
    if get_method(campaign.method).of_one_flight:
        others = select(Calibration.id).where(Calibration.campaign_id != campaign.id)
        held |= Publication.superseded_by.in_(others)
    rows = session.execute(
        select(Calibration, Publication)
        .join(Publication, Publication.calibration_id == Calibration.id)
        .outerjoin(Revocation, Revocation.calibration_id == Calibration.id)
        .where(Calibration.campaign_id == campaign.id, Calibration.camera_id == campaign.camera_id)
        .where(held, Revocation.calibration_id.is_(None))
        .where(overlaps(taken.earliest, taken.latest) if taken else true())
        .order_by(Publication.known_from.desc(), Publication.id)
    )
    found = (InForce(calibration=row[0], publication=row[1]) for row in rows)
    return next((each for each in found if _fits(each.calibration.configuration, frame)), None)


def _find_in_force(session: Session, frame: FrameRow, campaign: Campaign) -> tuple[InForce, str]:
    taken = read_frame_time(frame, read_zones(session, campaign))
    own = _find_own(session, frame, campaign, taken)
    if own is not None:
        when = f"the frame was taken at {taken.describe()}" if taken else "the frame states no usable time"
        return (
            own,
            f"{own.sentence()}, it is of the frame's own campaign and {when}: {own.publication.reason}",
        )
    if taken is None:
        stated = (frame.header or {}).get("taken_at")
        raise refuse_timeless(frame.filename, stated, wanted="calibration")
    found = [
        held
        for held in list_between(
            session,
            camera_id=campaign.camera_id,
            method=campaign.method,
            earliest=taken.earliest,
            latest=taken.latest,
        )
        if _fits(held.calibration.configuration, frame)
    ]
    whole = [held for held in found if held.holds(taken.earliest, taken.latest)]
    if len(whole) != 1:
        raise Conflict(
            interface.NO_CALIBRATION_IN_FORCE,
            f"Frame {frame.filename} was taken at {taken.describe()}, and "
            f"{_explain_none(campaign.method, taken, found, whole)}. Publish a version for that time"
            f"{advise_zone([taken]) if found else ''}, or name one with calibration_id.",
        )
    (held,) = whole
    return held, f"{held.sentence()}, the frame was taken at {taken.describe()}: {held.publication.reason}"


def _explain_none(method: str, taken: FrameTime, found: list[InForce], whole: list[InForce]) -> str:
    if whole:
        return "several, for different lenses, are in force"
    if not found:
        return f"no {method} calibration of its camera is in force"
    unknown = "since neither its file nor its campaign or organisation states a time zone"
    if taken.zone:
        unknown = "since its clock was changed in that night"
    earliest, latest = write_instant(taken.earliest), write_instant(taken.latest)
    return (
        f"that is some time from {earliest} to {latest}, {unknown}: "
        f"{found[0].sentence()}, not during all of it"
    )


def _fits(configuration: dict[str, Any], frame: FrameRow) -> bool:
    """Return True if a version holds for the frame's sunshine sensor, where it holds for one."""
    held = configuration.get("sunshine_sensor", {}).get("serial")
    said = ((frame.header or {}).get("multispectral") or {}).get("sunshine_serial")
    return held is None or said is None or held.casefold() == said.casefold()
