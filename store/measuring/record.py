"""A measurement as it is kept, and a version's coefficients as the science wants them."""

import hashlib
import json
from functools import cache
from importlib.metadata import version as package_version
from typing import Any

from sqlalchemy import insert, select
from sqlalchemy.orm import Session

from radiometry.frame.roi import Polygon
from radiometry.records import Record
from store import files, software
from store.blobs import StoredBlob
from store.queries import add
from store.ready.rows import make_measured
from store.tables import Blob, Calibration, Camera, Campaign, FrameRow, MeasuredRow, Measurement, new_id

RESULT_SCHEMA = 1


class Products(Record):
    tif: StoredBlob
    png: StoredBlob


def read_regions(calibration: Calibration) -> tuple[Polygon, ...]:
    return tuple(Polygon.from_points(points) for points in calibration.inputs["rois"].values())


def find_measurement(
    session: Session, frame: FrameRow, calibration: Calibration, parameters: dict[str, Any]
) -> Measurement | None:
    content = hash_content(frame, calibration, parameters)
    return session.scalar(select(Measurement).filter_by(frame_id=frame.id, content_sha256=content))


def hash_content(frame: FrameRow, calibration: Calibration, parameters: dict[str, Any]) -> str:
    """Over the frame's bytes and exposure, the version, what was asked for and the code that answers."""
    asked = {name: value for name, value in parameters.items() if name != "why"}
    content = [frame.sha256, frame.exposure, calibration.content_sha256, asked, software.MEASURER]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def has_lost_products(session: Session, measurement: Measurement) -> bool:
    names = (measurement.map_tif_sha256, measurement.map_png_sha256)
    blobs = [session.get_one(Blob, name) for name in names if name is not None]
    return any(blob.damage is not None for blob in blobs)


def write_measurement(
    session: Session,
    frame: FrameRow,
    calibration: Calibration,
    parameters: dict[str, Any],
    measured: dict[str, Any],
    products: Products | None,
    *,
    by: str,
) -> Measurement:
    """Write it once; the same content again is the measurement that exists."""
    if products:
        files.keep_blobs(session, [products.tif, products.png])
    if (found := find_measurement(session, frame, calibration, parameters)) is not None:
        return found
    campaign = session.get_one(Campaign, frame.campaign_id)
    measurement = Measurement(
        id=new_id("msr"),
        organisation_id=campaign.organisation_id,
        campaign_id=campaign.id,
        frame_id=frame.id,
        calibration_id=calibration.id,
        method=calibration.method,
        parameters={name: value for name, value in parameters.items() if name != "why"},
        result=measured | {"why": parameters["why"]},
        result_schema=RESULT_SCHEMA,
        software=describe_software(),
        content_sha256=hash_content(frame, calibration, parameters),
        map_tif_sha256=products.tif.sha256 if products else None,
        map_png_sha256=products.png.sha256 if products else None,
        created_by=by,
    )
    add(session, measurement)
    camera = session.get_one(Camera, calibration.camera_id)
    session.execute(insert(MeasuredRow), [make_measured(measurement, frame, calibration, camera)])
    return measurement


@cache
def describe_software() -> dict[str, Any]:
    packages = ("numpy", "rawpy", "imagecodecs", "isal", "tifffile", "pillow")
    return {"stilb": software.read_version(), "measurer": software.MEASURER} | {
        name: package_version(name) for name in packages
    }
