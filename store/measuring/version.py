"""Which version a frame is measured with, and which corrects a fit of another method."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from sqlalchemy import ColumnElement, select, true
from sqlalchemy.orm import Session

from radiometry.findings import interface, shared
from radiometry.fitting.evidence import Quantity
from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon
from radiometry.methods import METHODS, get_method
from radiometry.records import Record
from radiometry.specification.application import Correction, SurfaceApplication
from store.codec import decode, encode, read_applied
from store.database import Conflict
from store.publications import InForce, in_force, overlaps
from store.queries import by_id, frame_times
from store.queries.evidence import Evidence
from store.ready.rows import write_instant
from store.tables import Calibration, Campaign, FrameRow, Publication, Revocation, Roi, utc_now


def choose_version(
    session: Session, frame: FrameRow, campaign: Campaign, named: Calibration | None
) -> tuple[Calibration, str, str]:
    """The version, whether it was named or found in force, and the sentence that says why."""
    if named is None:
        held, why = _find_in_force(session, frame, campaign)
        return held.calibration, "in_force", why
    if named.camera_id != campaign.camera_id:
        raise shared.WRONG_CAMERA.reject(
            f"Frame {frame.filename} was taken by another camera than calibration {named.id} is for. "
            "Name a calibration of the frame's camera, or leave calibration_id out."
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
    session: Session, frame: FrameRow, campaign: Campaign, taken: frame_times.FrameTime | None
) -> InForce | None:
    """Find the version of the frame's own campaign that is in force at a time that may be the frame's."""
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
    taken = frame_times.read_frame_time(frame, frame_times.read_zones(session, campaign))
    if (own := _find_own(session, frame, campaign, taken)) is not None:
        when = f"the frame was taken at {taken.describe()}" if taken else "the frame states no usable time"
        said = f"{own.sentence()}, it is of the frame's own campaign and {when}"
        return own, f"{said}: {own.publication.reason}"
    if taken is None:
        stated = (frame.header or {}).get("taken_at")
        raise frame_times.refuse_timeless(frame.filename, stated, wanted="calibration")
    of = {"camera_id": campaign.camera_id, "method": campaign.method}
    then = in_force(session, **of, at=taken.earliest, until=taken.latest)
    found = [held for held in then if _fits(held.calibration.configuration, frame)]
    whole = [held for held in found if held.holds(taken.earliest, taken.latest)]
    if len(whole) != 1:
        raise Conflict(
            interface.NO_CALIBRATION_IN_FORCE,
            f"Frame {frame.filename} was taken at {taken.describe()}, and "
            f"{_explain_none(campaign.method, taken, found, whole)}. Publish a version for that time"
            f"{frame_times.advise_zone([taken]) if found else ''}, or name one with calibration_id.",
        )
    (held,) = whole
    return held, f"{held.sentence()}, the frame was taken at {taken.describe()}: {held.publication.reason}"


def _explain_none(
    method: str, taken: frame_times.FrameTime, found: list[InForce], whole: list[InForce]
) -> str:
    if whole:
        return "several, for different lenses, are in force"
    if not found:
        return f"no {method} calibration of its camera is in force"
    unknown = "since neither its file nor its campaign or organisation states a time zone"
    if taken.zone:
        unknown = "since its clock was changed in that night"
    between = f"from {write_instant(taken.earliest)} to {write_instant(taken.latest)}"
    return f"that is some time {between}, {unknown}: {found[0].sentence()}, not during all of it"


def _fits(configuration: dict[str, Any], frame: FrameRow) -> bool:
    """Return True if a version holds for the frame's sunshine sensor, where it holds for one."""
    held = configuration.get("sunshine_sensor", {}).get("serial")
    said = ((frame.header or {}).get("multispectral") or {}).get("sunshine_serial")
    return held is None or said is None or held.casefold() == said.casefold()


class _Light(Record, kw_only=False):
    """A light frame that a fit would use. ``row``: as the fit sees it; ``header``: as its file says."""

    row: Any
    header: FrameHeader
    roi: Roi

    def channels(self, application: SurfaceApplication, params: Any) -> tuple[str, ...]:  # noqa: ANN401
        return tuple(application.name_channels(self.header.cfa, channel=params.channel))


def choose_falloff(
    session: Session,
    campaign: Campaign,
    evidence: Evidence,
    params: Any,  # noqa: ANN401  the method's own
    named: Calibration | None,
) -> Calibration:
    """The version that is named, or else the one in force when the campaign's light frames were taken."""
    corrector, application = _find_corrector(campaign.method)
    lights = list(_list_lights(session, evidence, params))
    chosen = named or _find_corrector_in_force(session, campaign, corrector, lights)
    if chosen.camera_id != campaign.camera_id:
        raise shared.WRONG_CAMERA.reject(
            f"{corrector.capitalize()} {chosen.id} is of another camera than this campaign. "
            "Name a version of its own."
        )
    if chosen.method != corrector:
        message = f"Calibration {chosen.id} is of {chosen.method}: name one of {corrector}."
        raise Conflict(interface.METHOD_MISMATCH, message)
    _refuse_revoked(session, chosen)
    for light in lights:
        lens = _read_correction(corrector).lens(
            coefficients=read_applied(chosen), f_number=light.row.exposure.f_number
        )
        lens.require(
            channels=light.channels(application, params),
            height_px=light.header.height_px,
            width_px=light.header.width_px,
        )
    return chosen


def correct(session: Session, campaign: Campaign, evidence: Evidence, params: Any) -> Evidence:  # noqa: ANN401
    """The evidence with V of each light frame's region, where the parameters name a version."""
    named = get_method(campaign.method).corrected_by
    content_sha256 = getattr(params, named) if named else None
    if named is None or content_sha256 is None:
        return evidence
    corrector, application = _find_corrector(campaign.method)
    version = _find(session, campaign.camera_id, corrector, content_sha256)
    coefficients = read_applied(version)
    shares: dict[str, Quantity] = {}
    known: dict[tuple[str, float, tuple[str, ...]], Quantity] = {}
    for light in _list_lights(session, evidence, params):
        key = light.roi.id, light.row.exposure.f_number, light.channels(application, params)
        if key not in known:
            known[key] = _read_correction(corrector).average_over_polygon(
                coefficients, Polygon.from_points(light.roi.points), channels=key[2], f_number=key[1]
            )
        shares[light.row.frame] = known[key]
    source = {"content_sha256": version.content_sha256, "coefficients": [encode(c) for c in coefficients]}
    return replace(
        evidence,
        frames=[replace(row, lens_share=shares.get(row.frame)) for row in evidence.frames],
        references={**evidence.references, corrector: [source]},
    )


def find_falloff(session: Session, calibration: Calibration) -> Calibration | None:
    """The vignetting version that a luminance version needs; None: it was made without."""
    corrector = get_method(calibration.method).corrected_by
    content_sha256 = calibration.parameters.get(corrector) if corrector else None
    if corrector is None or content_sha256 is None:
        return None
    found = _find(session, calibration.camera_id, corrector, content_sha256)
    _refuse_revoked(session, found)
    return found


def read_lens(calibration: Calibration, exposure: Exposure) -> Any:  # noqa: ANN401  the method's own
    """The lens at a frame's f-number, by what went into a luminance version; None: it was made without."""
    corrector = get_method(calibration.method).corrected_by
    sources = calibration.inputs.get(corrector, []) if corrector else []
    if corrector is None or not sources:
        return None
    coefficients = decode(get_method(corrector).applied_type, sources[0]["coefficients"])
    return _read_correction(corrector).lens(coefficients=coefficients, f_number=exposure.f_number)


def list_corrected(session: Session, version: Calibration) -> list[str]:
    """Return the ids of the versions that were corrected with this one, if its method corrects others."""
    if not (corrected := [spec.name for spec in METHODS if spec.corrected_by == version.method]):
        return []
    mine = (Calibration.camera_id == version.camera_id) & Calibration.method.in_(corrected)
    rows = select(Calibration.id, Calibration.parameters).where(mine).order_by(Calibration.version)
    return [row[0] for row in session.execute(rows) if row[1].get(version.method) == version.content_sha256]


def _find_corrector(method: str) -> tuple[str, SurfaceApplication]:
    """Return the name of the method that corrects this one, and how this one is applied."""
    spec = get_method(method)
    if spec.corrected_by is None or not isinstance(spec.application, SurfaceApplication):
        raise TypeError(f"{method} is corrected by no other method")
    return spec.corrected_by, spec.application


def _read_correction(corrector: str) -> Correction:
    if (correction := get_method(corrector).correction) is None:
        raise TypeError(f"{corrector} corrects no other method")
    return correction


def _find(session: Session, camera_id: str, method: str, content_sha256: str) -> Calibration:
    """The camera's version with this content: of several, which then say the same, the first."""
    wanted = {"camera_id": camera_id, "method": method, "content_sha256": content_sha256}
    return next(iter(session.scalars(select(Calibration).filter_by(**wanted).order_by(Calibration.version))))


def _refuse_revoked(session: Session, version: Calibration) -> None:
    if session.get(Revocation, version.id):
        raise Conflict(
            shared.CALIBRATION_REVOKED,
            f"Version {version.version} of {version.method} was revoked: fit with one that stands, and "
            "measure with that fit.",
        )


def _list_lights(session: Session, evidence: Evidence, params: Any) -> Iterator[_Light]:  # noqa: ANN401
    rows = {row.frame: row for row in evidence.frames if row.role == "light" and row.statistics}
    out = {exclusion.frame for exclusion in params.exclude}
    rois = by_id(session, Roi, set(evidence.rois.values()))
    for name in (evidence.names[frame_id] for frame_id in sorted(evidence.names)):
        if name in rows and name not in out:
            yield _Light(rows[name], evidence.headers[name], rois[evidence.rois[name]])


def _find_corrector_in_force(
    session: Session, campaign: Campaign, corrector: str, lights: list[_Light]
) -> Calibration:
    zones, times = frame_times.read_zones(session, campaign), []
    for light in lights:
        if (taken := frame_times.find_time(light.header.taken_at, zones)) is None:
            raise frame_times.refuse_timeless(light.row.frame, light.header.taken_at, wanted=corrector)
        times.append(taken)
    earliest = min((taken.earliest for taken in times), default=utc_now())
    latest = max((taken.latest for taken in times), default=earliest)
    held = [
        found.calibration
        for found in in_force(session, camera_id=campaign.camera_id, method=corrector, at=earliest)
        if found.publication.valid_to is None or found.publication.valid_to > latest
    ]
    if len(held) != 1:
        reason = "several, for different lenses, are" if held else "no one version is"
        raise Conflict(
            interface.NO_CALIBRATION_IN_FORCE,
            f"Of this camera's {corrector} {reason} in force for all times at which the light frames may "
            f"have been taken. Publish a version for that time{frame_times.advise_zone(times)}, or name "
            f"one with {corrector}_id.",
        )
    return held[0]
