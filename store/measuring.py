"""From a frame and a request to a plan for the worker, and from its result to a measurement."""

import hashlib
import json
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from importlib.metadata import version as package_version
from typing import Any

from pydantic import TypeAdapter
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.errors import Code, InputRejected
from radiometry.luminance.application import choose_coefficient
from radiometry.luminance.maps import find_map_scale
from radiometry.luminance.results import Coefficient
from radiometry.measured import Measured
from radiometry.measurement import Request, find_window
from radiometry.roi import Polygon
from radiometry.surface import Grid, outline
from store.codec import decode_exposure, encode
from store.columns import new_id, utc_now
from store.errors import Conflict
from store.publications import InForce, in_force
from store.queries.frames import current_roi
from store.software import CODE_VERSION, MEASURER
from store.tables import Blob, Calibration, Campaign, FrameRow, Measurement, Revocation

METHOD = "luminance"
RESULT_SCHEMA = 1

_COEFFICIENTS = TypeAdapter(tuple[Coefficient, ...])
_GRID = TypeAdapter(Grid)
# A time without an offset is somewhere between UTC+14 and UTC-12.
_EARLIEST, _LATEST = timedelta(hours=-14), timedelta(hours=12)


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What a request says; None where it leaves the choice to what is recorded."""

    polygon: Polygon | None = None
    grid: Grid | None = None
    reflectance: float | None = None
    products: tuple[str, ...] = field(default=())


@dataclass(frozen=True, kw_only=True)
class Products:
    """The map's two blobs."""

    tif: Blob
    png: Blob


def plan_measurement(
    session: Session, frame: FrameRow, asked: Asked, named: Calibration | None
) -> dict[str, Any]:
    """The parameters of the job that measures: what is decided here cannot change while it waits.

    Raises InputRejected or Conflict, saying what to do, for whatever can be known before the pixels are read.
    """
    campaign = session.get_one(Campaign, frame.campaign_id)
    _require_read(frame)
    calibration, chosen, why = _choose(session, frame, campaign, named)
    polygon, origin = _find_region(session, frame, campaign, asked)
    coefficients, exposure = read_coefficients(calibration), decode_exposure(frame.exposure or {})
    choose_coefficient(coefficients, iso=exposure.iso)
    if "map" in asked.products:
        find_map_scale(coefficients, exposure)
    header = frame.header or {}
    request = Request(polygon=polygon, grid=asked.grid, reflectance=asked.reflectance)
    find_window(request, height_px=header["height_px"], width_px=header["width_px"])
    return {
        "calibration_id": calibration.id,
        "calibration_chosen": chosen,
        "why": why,
        "polygon": [list(point) for point in polygon.points],
        "region_origin": origin,
        "products": list(asked.products),
        **({"grid": encode(asked.grid)} if asked.grid else {}),
        **({"reflectance": asked.reflectance} if asked.reflectance is not None else {}),
    }


def read_request(parameters: dict[str, Any]) -> Request:
    """A plan's request, as the science wants it."""
    grid = parameters.get("grid")
    return Request(
        polygon=Polygon.from_points(parameters["polygon"]),
        grid=_GRID.validate_python(grid) if grid else None,
        reflectance=parameters.get("reflectance"),
    )


def read_coefficients(calibration: Calibration) -> tuple[Coefficient, ...]:
    fits = calibration.result["iso_fits"]
    return _COEFFICIENTS.validate_python([iso_fit["coefficient"] for iso_fit in fits])


def read_regions(calibration: Calibration) -> tuple[Polygon, ...]:
    """The regions that the version was calibrated in."""
    return tuple(Polygon.from_points(points) for points in calibration.inputs["rois"].values())


def find_measurement(
    session: Session, frame: FrameRow, calibration: Calibration, parameters: dict[str, Any]
) -> Measurement | None:
    """The measurement with this content, if it was made before."""
    return session.scalar(
        select(Measurement).where(
            Measurement.frame_id == frame.id,
            Measurement.content_sha256 == hash_content(frame, calibration, parameters),
        )
    )


def hash_content(frame: FrameRow, calibration: Calibration, parameters: dict[str, Any]) -> str:
    """Over the frame's bytes and exposure, the version, what was asked for and the code that answers."""
    asked = {name: value for name, value in parameters.items() if name != "why"}
    content = [frame.sha256, frame.exposure, calibration.content_sha256, asked, MEASURER]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def write_measurement(
    session: Session,
    frame: FrameRow,
    calibration: Calibration,
    parameters: dict[str, Any],
    measured: Measured,
    products: Products | None,
    *,
    by: str,
) -> Measurement:
    """Write it once; the same content again is the measurement that exists."""
    found = find_measurement(session, frame, calibration, parameters)
    if found is not None:
        return found
    for blob in (products.tif, products.png) if products else ():
        if session.get(Blob, blob.sha256) is None:
            session.add(Blob(sha256=blob.sha256, size_bytes=blob.size_bytes))
    session.flush()
    campaign = session.get_one(Campaign, frame.campaign_id)
    measurement = Measurement(
        id=new_id("msr"),
        organisation_id=campaign.organisation_id,
        campaign_id=campaign.id,
        frame_id=frame.id,
        calibration_id=calibration.id,
        method=calibration.method,
        parameters={name: value for name, value in parameters.items() if name != "why"},
        result=encode(measured) | {"why": parameters["why"]},
        result_schema=RESULT_SCHEMA,
        software=_software(),
        content_sha256=hash_content(frame, calibration, parameters),
        map_tif_sha256=products.tif.sha256 if products else None,
        map_png_sha256=products.png.sha256 if products else None,
        created_by=by,
    )
    session.add(measurement)
    session.flush()
    return measurement


def _software() -> dict[str, Any]:
    packages = ("numpy", "rawpy", "imagecodecs", "tifffile", "pillow")
    return {"stilb": CODE_VERSION, "measurer": MEASURER} | {name: package_version(name) for name in packages}


def _require_read(frame: FrameRow) -> None:
    if frame.state == "refused":
        raise InputRejected(
            Code.FRAME_NOT_READ, f"Frame {frame.filename} was refused: {frame.refusal_detail}"
        )
    if frame.header is None:
        raise InputRejected(
            Code.FRAME_NOT_READ,
            f"Frame {frame.filename} has not been read yet: wait for its job and ask again.",
        )
    if frame.exposure is None:
        raise InputRejected(
            Code.EXPOSURE_MISSING,
            f"Frame {frame.filename} states no exposure: type its exposure_time_s, f_number and iso in.",
        )


def _find_region(session: Session, frame: FrameRow, campaign: Campaign, asked: Asked) -> tuple[Polygon, str]:
    """The request's own region, else the frame's or the campaign's, else the grid's outline."""
    if asked.polygon is not None:
        return asked.polygon, "request"
    roi = current_roi(session, frame, campaign)
    if roi is not None:
        return Polygon.from_points(roi.points), "frame" if frame.roi_id else "campaign"
    if asked.grid is not None:
        return outline(asked.grid), "grid"
    raise InputRejected(
        Code.REGION_MISSING,
        f"Neither the request nor frame {frame.filename} nor its campaign has a region: send roi or set one.",
    )


def _choose(
    session: Session, frame: FrameRow, campaign: Campaign, named: Calibration | None
) -> tuple[Calibration, str, str]:
    """The version, whether it was named or found in force, and the sentence that says why."""
    if named is None:
        held, why = _find_in_force(session, frame, campaign)
        return held.calibration, "in_force", why
    if named.camera_id != campaign.camera_id:
        raise InputRejected(
            Code.WRONG_CAMERA,
            f"Frame {frame.filename} was taken by another camera than calibration {named.id} is for. "
            "Name a calibration of the frame's camera, or leave calibration_id out.",
        )
    if named.method != METHOD:
        raise Conflict(
            "method_mismatch", f"Calibration {named.id} is of {named.method}; measuring needs {METHOD}."
        )
    if session.get(Revocation, named.id):
        raise Conflict("calibration_revoked", "This version was revoked: measure with one that stands.")
    return named, "named", f"version {named.version} was named in the request"


def _find_in_force(session: Session, frame: FrameRow, campaign: Campaign) -> tuple[InForce, str]:
    earliest, latest = read_time(frame)
    found = in_force(session, camera_id=campaign.camera_id, method=METHOD, at=earliest, known_at=utc_now())
    whole = [held for held in found if _holds_until(held, latest)]
    taken = (frame.header or {})["taken_at"]
    if len(whole) != 1:
        reason = "no luminance calibration of its camera is in force"
        if len(whole) > 1:
            reason = "several, for different lenses, are in force"
        elif found or earliest != latest:
            reason = "none is in force at every time that this may be, since the file names no time zone"
        raise Conflict(
            "no_calibration_in_force",
            f"Frame {frame.filename} was taken at {taken}, and {reason}. Publish a version for that time, or "
            "name one with calibration_id.",
        )
    publication = whole[0].publication
    end = f"to {_stamp(publication.valid_to)}" if publication.valid_to else "on"
    return whole[0], (
        f"version {whole[0].calibration.version} is in force from {_stamp(publication.valid_from)} {end}, "
        f"the frame was taken at {taken}: {publication.reason}"
    )


def _holds_until(held: InForce, latest: datetime) -> bool:
    return held.publication.valid_to is None or held.publication.valid_to > latest


def read_time(frame: FrameRow) -> tuple[datetime, datetime]:
    """The earliest and the latest instant that the frame's time may mean."""
    taken = (frame.header or {}).get("taken_at")
    if taken is None:
        raise InputRejected(
            Code.FRAME_TIME_MISSING,
            f"Frame {frame.filename} does not say when it was taken, so no calibration can be looked up: "
            "name one with calibration_id.",
        )
    instant: datetime = TypeAdapter(datetime).validate_python(taken)
    if instant.tzinfo is not None:
        return instant, instant
    instant = instant.replace(tzinfo=UTC)
    return instant + _EARLIEST, instant + _LATEST


def _stamp(instant: datetime) -> str:
    return instant.isoformat(timespec="seconds").replace("+00:00", "Z")
