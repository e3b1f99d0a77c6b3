"""The vignetting version that a luminance fit is corrected with, and that its measurements then need."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from pydantic import TypeAdapter
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import Quantity
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon
from radiometry.luminance import method as luminance
from radiometry.luminance.lens import name_channels
from radiometry.vignetting import method as vignetting
from store.codec import encode
from store.columns import utc_now
from store.errors import Conflict
from store.publications import in_force
from store.queries.evidence import Evidence
from store.queries.frames import read_time
from store.tables import Calibration, Campaign, FrameRow, Revocation, Roi

METHOD = "vignetting"

_COEFFICIENTS = TypeAdapter(tuple[vignetting.Coefficient, ...])


@dataclass(frozen=True)
class _Light:
    """A light frame that a fit would use. ``row``: as the fit sees it; ``frame``: as it is kept."""

    row: luminance.FrameRow
    frame: FrameRow
    roi: Roi

    def channels(self, params: luminance.Params) -> tuple[str, ...]:
        return name_channels((self.frame.header or {})["cfa"], channel=params.channel)


def choose_falloff(
    session: Session,
    campaign: Campaign,
    evidence: Evidence,
    params: luminance.Params,
    named: Calibration | None,
) -> Calibration:
    """The version that is named, or else the one in force when the campaign's light frames were taken.

    Raises InputRejected or Conflict, saying what to do, for a version that cannot correct these frames.
    """
    lights = list(_list_lights(session, evidence, params))
    chosen = named or _find_in_force(session, campaign, lights)
    if chosen.camera_id != campaign.camera_id:
        raise InputRejected(
            shared.WRONG_CAMERA,
            f"Vignetting {chosen.id} is of another camera than this campaign. Name a version of its own.",
        )
    if chosen.method != METHOD:
        raise Conflict(
            "method_mismatch", f"Calibration {chosen.id} is of {chosen.method}: name one of vignetting."
        )
    _refuse_revoked(session, chosen)
    for light in lights:
        header = light.frame.header or {}
        vignetting.Lens(coefficients=_read_fitted(chosen), f_number=light.row.exposure.f_number).require(
            channels=light.channels(params), height_px=header["height_px"], width_px=header["width_px"]
        )
    return chosen


def correct(session: Session, campaign: Campaign, evidence: Evidence, params: Any) -> Evidence:  # noqa: ANN401
    """The evidence with V of each light frame's region, where the parameters name a version."""
    if campaign.method != "luminance" or params.vignetting is None:
        return evidence
    version = _find(session, campaign.camera_id, params.vignetting)
    coefficients = _read_fitted(version)
    shares: dict[str, Quantity] = {}
    known: dict[tuple[str, float, tuple[str, ...]], Quantity] = {}
    for light in _list_lights(session, evidence, params):
        key = light.roi.id, light.row.exposure.f_number, light.channels(params)
        if key not in known:
            known[key] = vignetting.average_over_polygon(
                coefficients, Polygon.from_points(light.roi.points), channels=key[2], f_number=key[1]
            )
        shares[light.row.frame] = known[key]
    source = {"content_sha256": version.content_sha256, "coefficients": [encode(c) for c in coefficients]}
    return replace(
        evidence,
        frames=[replace(row, lens_share=shares.get(row.frame)) for row in evidence.frames],
        references={**evidence.references, METHOD: [source]},
    )


def find_falloff(session: Session, calibration: Calibration) -> Calibration | None:
    """The vignetting version that a luminance version needs; None: it was made without.

    Raises Conflict(calibration_revoked)
    """
    content_sha256 = calibration.parameters.get(METHOD)
    if content_sha256 is None:
        return None
    found = _find(session, calibration.camera_id, content_sha256)
    _refuse_revoked(session, found)
    return found


def read_lens(calibration: Calibration, exposure: Exposure) -> vignetting.Lens | None:
    """The lens at a frame's f-number, by what went into a luminance version; None: it was made without."""
    sources = calibration.inputs.get(METHOD, [])
    if not sources:
        return None
    coefficients = _COEFFICIENTS.validate_python(sources[0]["coefficients"])
    return vignetting.Lens(coefficients=coefficients, f_number=exposure.f_number)


def list_corrected(session: Session, version: Calibration) -> list[str]:
    """The luminance versions that need a vignetting version, by their ids; none of another method."""
    if version.method != METHOD:
        return []
    rows = session.execute(
        select(Calibration.id, Calibration.parameters)
        .where(Calibration.camera_id == version.camera_id, Calibration.method == "luminance")
        .order_by(Calibration.version)
    )
    return [row[0] for row in rows if row[1].get(METHOD) == version.content_sha256]


def _read_fitted(version: Calibration) -> tuple[vignetting.Coefficient, ...]:
    return _COEFFICIENTS.validate_python([fit["coefficient"] for fit in version.result["channel_fits"]])


def _find(session: Session, camera_id: str, content_sha256: str) -> Calibration:
    """The camera's version with this content: of several, which then say the same, the first."""
    rows = session.scalars(
        select(Calibration)
        .where(Calibration.camera_id == camera_id, Calibration.method == METHOD)
        .where(Calibration.content_sha256 == content_sha256)
        .order_by(Calibration.version)
    )
    return next(iter(rows))


def _refuse_revoked(session: Session, version: Calibration) -> None:
    if session.get(Revocation, version.id):
        raise Conflict(
            "calibration_revoked",
            f"Version {version.version} of vignetting was revoked: fit luminance with one that stands, and "
            "measure with that fit.",
        )


def _list_lights(session: Session, evidence: Evidence, params: luminance.Params) -> Iterator[_Light]:
    rows = {row.frame: row for row in evidence.frames if row.role == "light" and row.statistics}
    out = {exclusion.frame for exclusion in params.exclude}
    rois = {
        roi.id: roi for roi in session.scalars(select(Roi).where(Roi.id.in_(set(evidence.rois.values()))))
    }
    frames = session.scalars(select(FrameRow).where(FrameRow.id.in_(evidence.names)).order_by(FrameRow.id))
    for frame in frames:
        name = evidence.names[frame.id]
        if name in rows and name not in out:
            yield _Light(rows[name], frame, rois[evidence.rois[name]])


def _find_in_force(session: Session, campaign: Campaign, lights: list[_Light]) -> Calibration:
    timeless = [light.row.frame for light in lights if (light.frame.header or {}).get("taken_at") is None]
    if timeless:
        raise InputRejected(
            shared.FRAME_TIME_MISSING,
            f"Frame {timeless[0]} does not say when it was taken, so that no vignetting can be looked up: "
            "name one with vignetting_id.",
        )
    times = [read_time(light.frame) for light in lights]
    earliest = min((first for first, _ in times), default=utc_now())
    latest = max((last for _, last in times), default=earliest)
    held = [
        found.calibration
        for found in in_force(session, camera_id=campaign.camera_id, method=METHOD, at=earliest)
        if found.publication.valid_to is None or found.publication.valid_to > latest
    ]
    if len(held) != 1:
        reason = "several, for different lenses, are" if held else "no one version is"
        raise Conflict(
            "no_calibration_in_force",
            f"Of this camera's vignetting {reason} in force for all times at which the light frames may have "
            "been taken. Publish a version for that time, or name one with vignetting_id.",
        )
    return held[0]
