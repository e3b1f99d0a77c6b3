"""A version in the forms that other programs read."""

import base64
import io
import json
from collections.abc import Sequence
from typing import Annotated

import numpy as np
import tifffile
from fastapi import APIRouter, Query, Request, Response
from numpy.typing import NDArray
from pydantic import Field
from sqlalchemy.orm import Session

from radiometry.geometry import method as geometry
from radiometry.vignetting import method as vignetting
from service.auth import Caller, Reader
from service.context import UsesContext
from service.immutable import immutable_headers, not_modified
from service.lookup import Id, owned
from service.problems import HttpCode, Problem
from service.routes import UNCHANGED, problems, sends_file
from service.schemas.base import Form, PositiveText, Text
from service.schemas.exports import CameraFile, DngVignetteAnswer
from store.codec import decode
from store.tables import Calibration, Camera

router = APIRouter(prefix="/v1/calibrations/{calibration_id}/exports", tags=["calibrations"])

EXPORTS: dict[str, tuple[str, ...]] = {
    "vignetting": ("lensfun.xml", "dng.json", "correction.tif", "residuals.tif"),
    "geometry": ("opencv.yaml", "ros.yaml", "camera.json"),
}


class LensfunQuery(Form):
    """What Lensfun asks for and neither the files nor the camera's registration say."""

    focal_length_mm: PositiveText
    mount: Annotated[Text, Field(description="Of a fixed lens a name of its own, in lower case.")]
    widest_f_number: Annotated[PositiveText | None, Field(description="Of the lens, as in its name.")] = None


@router.get("/lensfun.xml", response_class=Response, responses=sends_file("application/xml"))
def get_lensfun_xml(
    calibration_id: Id,
    request: Request,
    query: Annotated[LensfunQuery, Query()],
    caller: Reader,
    context: UsesContext,
) -> Response:
    """The falloff as an entry of Lensfun's database. The pixel pitch must be registered with the camera."""
    with context.database.reading() as session:
        calibration = _owned(session, calibration_id, caller, "vignetting")
        camera = session.get_one(Camera, calibration.camera_id)
    coefficients = _read_falloff(calibration)
    if camera.pixel_pitch_um is None:
        detail = "Lensfun needs the sensor's size: register the camera again, with its pixel_pitch_um."
        raise Problem(422, HttpCode.VALIDATION_FAILED, detail)
    pitch_mm = camera.pixel_pitch_um / 1000.0
    names = vignetting.LensfunNames(
        camera_make=camera.make,
        camera_model=camera.model,
        lens_make=camera.lens_make or camera.make,
        lens_model=camera.lens_model or f"{camera.model} lens",
        mount=query.mount,
        focal_length_mm=query.focal_length_mm,
        sensor_width_mm=coefficients[0].width_px * pitch_mm,
        sensor_height_mm=coefficients[0].height_px * pitch_mm,
        widest_f_number=query.widest_f_number,
    )
    channels = vignetting.select_channels(coefficients, signal="green")
    text = vignetting.export_lensfun(coefficients, channels=channels, names=names)
    return _send(request, calibration, text, "application/xml")


@router.get("/dng.json", response_model=DngVignetteAnswer, responses={**UNCHANGED, **problems(404)})
def get_dng_vignette(
    calibration_id: Id,
    request: Request,
    f_number: Annotated[PositiveText, Query()],
    caller: Reader,
    context: UsesContext,
) -> Response:
    """The parameters of DNG's FixVignetteRadial at one f-number, and the opcode as OpcodeList3 holds it."""
    with context.database.reading() as session:
        calibration = _owned(session, calibration_id, caller, "vignetting")
    coefficients = _read_falloff(calibration)
    channels = vignetting.select_channels(coefficients, signal="green")
    found = vignetting.export_dng(coefficients, channels=channels, f_number=f_number)
    answer = DngVignetteAnswer(
        f_number=f_number,
        k=list(found.k),
        centre_x_share=found.centre_x,
        centre_y_share=found.centre_y,
        largest_error_rel=found.largest_error_rel,
        opcode_list_base64=base64.b64encode(found.opcode_list).decode(),
    )
    tag = f"{calibration.content_sha256}-dng-{f_number!r}"
    return not_modified(request, tag) or answer.respond(immutable_headers(tag))


@router.get("/correction.tif", response_class=Response, responses=sends_file("image/tiff"))
def get_correction_map(
    calibration_id: Id,
    request: Request,
    f_number: Annotated[PositiveText, Query()],
    caller: Reader,
    context: UsesContext,
) -> Response:
    """1 / V of every pixel, float32: multiply what lies above dark by it, each pixel by its own channel's."""
    with context.database.reading() as session:
        calibration = _owned(session, calibration_id, caller, "vignetting")
    tag = f"{calibration.content_sha256}-correction-{f_number!r}"
    unchanged = not_modified(request, tag)
    if unchanged is not None:
        return unchanged
    gains = vignetting.compute_correction(
        _read_falloff(calibration), cfa=calibration.result["cfa"], f_number=f_number
    )
    return _send_tiff(gains, tag)


@router.get("/residuals.tif", response_class=Response, responses=sends_file("image/tiff"))
def get_residual_map(
    calibration_id: Id,
    request: Request,
    f_number: Annotated[PositiveText, Query()],
    channel: Annotated[Text, Query()],
    caller: Reader,
    context: UsesContext,
) -> Response:
    """What the curve leaves of the flats, (light - fitted) / fitted, float32: a pixel for each block.

    NaN where a block did not count. The description says how many pixels of the frame a block is wide.
    """
    with context.database.reading() as session:
        calibration = _owned(session, calibration_id, caller, "vignetting")
    tag = f"{calibration.content_sha256}-residuals-{f_number!r}-{channel}"
    unchanged = not_modified(request, tag)
    if unchanged is not None:
        return unchanged
    fit, residuals = vignetting.read_residuals(
        _read_fit(calibration).channel_fits, f_number=f_number, channel=channel
    )
    said = {
        "quantity": "(light - fitted) / fitted",
        "unit": "1",
        "f_number": f_number,
        "channel": channel,
        "block_px": fit.block_px,
        "residual_rms_rel": fit.residual_rms_rel,
        "calibration_id": calibration.id,
    }
    return _send_tiff(residuals, tag, json.dumps(said))


@router.get("/opencv.yaml", response_class=Response, responses=sends_file("application/yaml"))
def get_opencv_yaml(calibration_id: Id, request: Request, caller: Reader, context: UsesContext) -> Response:
    """The camera as OpenCV's FileStorage reads it."""
    with context.database.reading() as session:
        calibration = _owned(session, calibration_id, caller, "geometry")
    return _send(request, calibration, geometry.export_opencv(_read_camera(calibration)), "application/yaml")


@router.get("/ros.yaml", response_class=Response, responses=sends_file("application/yaml"))
def get_ros_yaml(calibration_id: Id, request: Request, caller: Reader, context: UsesContext) -> Response:
    """The camera as ROS's camera_info reads it."""
    with context.database.reading() as session:
        calibration = _owned(session, calibration_id, caller, "geometry")
        name = _name(session, calibration)
    text = geometry.export_ros(_read_camera(calibration), camera_name=name)
    return _send(request, calibration, text, "application/yaml")


@router.get("/camera.json", response_model=CameraFile, responses={**UNCHANGED, **problems(404)})
def get_camera_json(calibration_id: Id, request: Request, caller: Reader, context: UsesContext) -> Response:
    """The camera with its uncertainties and their covariance."""
    with context.database.reading() as session:
        calibration = _owned(session, calibration_id, caller, "geometry")
        name = _name(session, calibration)
    text = geometry.export_json(_read_camera(calibration), camera_name=name)
    return _send(request, calibration, text, "application/json")


def _owned(session: Session, calibration_id: str, caller: Caller, method: str) -> Calibration:
    calibration = owned(session, Calibration, calibration_id, caller)
    if calibration.method != method:
        known = EXPORTS.get(calibration.method, ())
        which = f"its exports are {', '.join(known)}" if known else "it has none"
        raise Problem(404, HttpCode.NOT_FOUND, f"A {calibration.method} version has no export {which}.")
    return calibration


def _read_fit(calibration: Calibration) -> vignetting.Fit:
    fit: vignetting.Fit = decode(vignetting.Fit, _without_ids(calibration))
    return fit


def _read_falloff(calibration: Calibration) -> Sequence[vignetting.Coefficient]:
    return _read_fit(calibration).coefficients


def _read_camera(calibration: Calibration) -> geometry.Fit:
    fit: geometry.Fit = decode(geometry.Fit, _without_ids(calibration))
    return fit


def _without_ids(calibration: Calibration) -> dict[str, object]:
    """The fit as the science gave it: the store adds each point's frame by id."""
    points = [
        {name: value for name, value in point.items() if name != "frame_id"}
        for point in calibration.result["points"]
    ]
    return {**calibration.result, "points": points}


def _name(session: Session, calibration: Calibration) -> str:
    camera = session.get_one(Camera, calibration.camera_id)
    return f"{camera.make} {camera.model} {camera.serial}"


def _send_tiff(samples: NDArray[np.float32], tag: str, description: str | None = None) -> Response:
    out = io.BytesIO()
    photometric = "rgb" if samples.ndim == 3 else "minisblack"
    tifffile.imwrite(out, samples, photometric=photometric, metadata=None, description=description)
    return Response(out.getvalue(), headers=immutable_headers(tag), media_type="image/tiff")


def _send(request: Request, calibration: Calibration, text: str, media_type: str) -> Response:
    tag = f"{calibration.content_sha256}-{request.url.path.rpartition('/')[2]}-{request.url.query}"
    return not_modified(request, tag) or Response(text, headers=immutable_headers(tag), media_type=media_type)
