"""A version in the forms that other programs read, as its method states them."""

import io
from collections.abc import Callable
from typing import Annotated, Any

from fastapi import Query, Request, Response
from pydantic import ConfigDict, Field, RootModel, create_model

from radiometry.findings import interface
from radiometry.methods import METHODS, get_method
from radiometry.specification.exports import Export, ExportOption, ExportSubject, Picture
from service.http import answers, auth, lookup, operations
from service.http.context import UsesContext
from service.http.models import Answer, Form, PositiveText, Quantity, Text
from service.http.problems import Problem
from store.fits import read_result
from store.tables import Calibration, Camera


class CameraFile(Answer):
    """A camera's geometry with its uncertainties."""

    model_config = ConfigDict(extra="allow")

    camera_name: str
    model: str
    convention: str
    image_width_px: int
    image_height_px: int
    parameters: dict[str, Quantity]


class OdmCameras(RootModel[dict[str, dict[str, float | str]]]):
    """Cameras by their name in OpenDroneMap: OpenSfM's model brown, lengths over the larger side."""


router = operations.Router(prefix="/v1/calibrations/{calibration_id}/exports", tags=["calibrations"])

_ANSWERS = {"get_camera_json": CameraFile, "get_odm_cameras": OdmCameras}


def _add(method: str, export: Export) -> None:
    """Add the route of an export; its name is that of the operation."""

    def send(
        calibration_id: lookup.Id,
        request: Request,
        query: Any,  # noqa: ANN401  a form of the export's options
        caller: auth.Reader,
        context: UsesContext,
    ) -> Response:
        with context.database.reading() as session:
            calibration = lookup.owned(session, Calibration, calibration_id, caller)
            camera = session.get_one(Camera, calibration.camera_id)
        _require(calibration, camera, method, export)
        tag = f"{calibration.content_sha256}-{export.filename}-{request.url.query}"
        unchanged = answers.not_modified(request, tag)
        if unchanged is not None:
            return unchanged
        subject = ExportSubject(
            calibration_id=calibration.id,
            make=camera.make,
            model=camera.model,
            serial=camera.serial,
            lens_make=camera.lens_make,
            lens_model=camera.lens_model,
            pixel_pitch_um=camera.pixel_pitch_um,
        )
        written = export.write(read_result(calibration), subject, query.model_dump())
        content = _write_tiff(written) if isinstance(written, Picture) else written
        return Response(content, headers=answers.immutable_headers(tag), media_type=export.media_type)

    answer = _ANSWERS.get(export.operation)
    form = create_model(
        export.operation, __base__=Form, **{option.name: _describe(option) for option in export.options}
    )
    send.__annotations__["query"] = Annotated[form, Query()]
    send.__name__, send.__doc__ = export.operation, export.description
    stated: dict[str, Any] = (
        {"response_model": answer, "responses": {**answers.UNCHANGED, **answers.problems(404)}}
        if answer
        else {"response_class": Response, "responses": answers.sends_file(export.media_type)}
    )
    add: Callable[..., Any] = router.get(f"/{export.filename}", **stated)
    add(send)


def _describe(option: ExportOption) -> Any:  # noqa: ANN401  a type with its default
    kind: Any = PositiveText if option.kind == "number" else Text
    held: Any = kind if option.required else kind | None
    described = Annotated[held, Field(description=option.description)] if option.description else held
    return (described, ...) if option.required else (described, None)


def _require(calibration: Calibration, camera: Camera, method: str, export: Export) -> None:
    if calibration.method != method:
        known = ", ".join(each.filename for each in get_method(calibration.method).exports)
        which = f"its exports are {known}" if known else "it has none"
        raise Problem(interface.NOT_FOUND, f"A version of {calibration.method} has no such export: {which}.")
    if export.needs_pixel_pitch and camera.pixel_pitch_um is None:
        detail = (
            f"{export.label} needs the sensor's size: register the camera again, with its pixel_pitch_um."
        )
        raise Problem(interface.VALIDATION_FAILED, detail)


def _write_tiff(picture: Picture) -> bytes:
    import tifffile

    out = io.BytesIO()
    photometric = "rgb" if picture.samples.ndim == 3 else "minisblack"
    tifffile.imwrite(
        out, picture.samples, photometric=photometric, metadata=None, description=picture.description
    )
    return out.getvalue()


for _spec in METHODS:
    for _export in _spec.exports:
        _add(_spec.name, _export)
