"""Measurements: what is asked for."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from radiometry.luminance.surface import MAX_CELLS_A_SIDE
from radiometry.reflectance.indices import Index
from service.schemas.base import Answer, Form, Number, Text
from service.schemas.campaigns import NewRoi, Point, Reflectance
from service.schemas.jobs import JobAnswer

Side = Annotated[int, Field(ge=1, le=MAX_CELLS_A_SIDE, strict=True)]
_CORNERS: list[Any] = [[2200, 1600], [3100, 1620], [3160, 2300], [2140, 2290]]


class NewGrid(Form):
    """Equal cells of a rectangular surface, by the image of its corners."""

    corners: Annotated[
        list[Point],
        Field(
            min_length=4,
            max_length=4,
            description="[x, y] in pixels of the surface's corners: top-left, top-right, bottom-right, "
            "bottom-left.",
        ),
    ]
    rows: Side
    columns: Side


class MeasurementOptions(Form):
    """How to measure; what is left out is taken from the frame, its campaign and what is in force."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"reflectance": 0.08, "products": ["map"]}]})

    calibration_id: Annotated[
        Text | None, Field(description="Else the version in force when the frame was taken.")
    ] = None
    roi: Annotated[NewRoi | None, Field(description="Else the frame's region, else the campaign's.")] = None
    grid: NewGrid | None = None
    reflectance: Annotated[
        Reflectance | None, Field(description="rho of the surface: gives E = pi L / rho.")
    ] = None
    incidence_angle_deg: Annotated[
        Number | None,
        Field(ge=0, le=60, description="Of reflectance: between the surface's normal and the light."),
    ] = None
    index: Annotated[
        Index | None,
        Field(description="Of reflectance: of this frame's capture; its other band must be there."),
    ] = None
    products: Annotated[list[Literal["map"]] | None, Field(max_length=1)] = None
    allow: Annotated[
        list[Literal["image_part_empty"]] | None,
        Field(
            max_length=1,
            description="Flags of a frame that else forbid to measure it; the measurement then carries them.",
        ),
    ] = None


class NewMeasurement(MeasurementOptions):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "frame_id": "frm_1",
                    "grid": {"corners": _CORNERS, "rows": 3, "columns": 5},
                    "products": ["map"],
                }
            ]
        }
    )

    frame_id: Text


class NotMeasured(Answer):
    """A frame that cannot be measured, and why."""

    frame_id: str
    filename: str
    code: str
    detail: str


class CampaignMeasurementsAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "jobs": [JobAnswer.model_json_schema()["examples"][0] | {"kind": "measure"}],
                    "not_measured": [
                        {
                            "frame_id": "frm_2",
                            "filename": "DJI_0101.DNG",
                            "code": "iso_not_calibrated",
                            "detail": "The frame was taken at ISO 100; this calibration holds ISO 3200.",
                        }
                    ],
                }
            ]
        }
    )

    jobs: list[JobAnswer]
    not_measured: list[NotMeasured]
