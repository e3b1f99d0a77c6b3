"""Which version a frame is measured with: the one that is named, or the one in force when it was taken."""

from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, interface, shared
from store.errors import Conflict
from store.publications import InForce, in_force
from store.queries.frames import read_time
from store.tables import Calibration, Campaign, FrameRow, Revocation


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


def _find_in_force(session: Session, frame: FrameRow, campaign: Campaign) -> tuple[InForce, str]:
    earliest, latest = read_time(frame)
    found = in_force(session, camera_id=campaign.camera_id, method=campaign.method, at=earliest)
    found = [held for held in found if _fits(held.calibration.configuration, frame)]
    whole = [held for held in found if _holds_until(held, latest)]
    taken = (frame.header or {})["taken_at"]
    if len(whole) != 1:
        reason = f"no {campaign.method} calibration of its camera is in force"
        if len(whole) > 1:
            reason = "several, for different lenses, are in force"
        elif found or earliest != latest:
            reason = "none is in force at every time that this may be, since the file names no time zone"
        raise Conflict(
            interface.NO_CALIBRATION_IN_FORCE,
            f"Frame {frame.filename} was taken at {taken}, and {reason}. Publish a version for that time, or "
            "name one with calibration_id.",
        )
    (held,) = whole
    return held, f"{held.sentence()}, the frame was taken at {taken}: {held.publication.reason}"


def _fits(configuration: dict[str, Any], frame: FrameRow) -> bool:
    """Return True if a version holds for the frame's sunshine sensor, where it holds for one."""
    held = configuration.get("sunshine_sensor", {}).get("serial")
    said = ((frame.header or {}).get("multispectral") or {}).get("sunshine_serial")
    return held is None or said is None or held.casefold() == said.casefold()


def _holds_until(held: InForce, latest: datetime) -> bool:
    return held.publication.valid_to is None or held.publication.valid_to > latest
