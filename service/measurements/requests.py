"""Measurements and regions as requests state them."""

import json
from typing import Annotated, Literal

from fastapi import Depends
from pydantic import ConfigDict, Field, JsonValue, ValidationError, create_model

from radiometry.fitting.evidence import Region
from radiometry.frame.grid import MAX_CELLS_A_SIDE, Grid
from radiometry.frame.multispectral import MOST_LETTERS, NAMED_INDICES
from radiometry.frame.roi import Polygon, parse_imagej
from radiometry.methods import METHODS
from radiometry.road.lanes import LaneGrid, lay_lanes
from service.calibrations.methods import make_fields
from service.campaigns.schemas import NewRoi, Point, Reflectance
from service.http.models import WHOLE, Answer, Form, Number, Text, maybe, told
from service.http.problems import invalid, located, wrong
from service.jobs.routes import JobAnswer
from store.queries.campaigns import Drawing

MOST_AVERAGED = 32

Side = Annotated[int, Field(ge=1, le=MAX_CELLS_A_SIDE, strict=True), WHOLE]

_CELLS: list[JsonValue] = ["rows", "columns"]
_LANES: list[JsonValue] = ["lanes", "lane_width_m", "spacing_m"]


class NewGrid(Form):
    """Equal cells of a rectangular surface by the image of its corners, or lanes divided as by EN 13201-3."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [
                {"required": there, "not": {"anyOf": [{"required": [name]} for name in absent]}}
                for there, absent in ((_CELLS, _LANES), (_LANES, _CELLS))
            ]
        }
    )

    corners: list[Point] = told(
        "[x, y] in pixels of the surface's corners: top-left, top-right, bottom-right, "
        "bottom-left; of lanes the first two along them, the field beginning at the first.",
        min_length=4,
        max_length=4,
    )
    rows: Side | None = maybe("Of cells, from the top edge to the bottom edge.")
    columns: Side | None = maybe("Of cells, from the left edge to the right edge.")
    lanes: Annotated[int, Field(ge=1, le=16, strict=True), WHOLE] | None = maybe(
        "In place of rows and columns: three rows a lane, ten columns or more."
    )
    lane_width_m: Annotated[Number, Field(ge=1, le=20)] | None = maybe("Of each lane, on the road.")
    spacing_m: Annotated[Number, Field(ge=5, le=150)] | None = maybe(
        "Of the luminaires: the length of the field."
    )
    length_m: Annotated[Number, Field(ge=1, le=300)] | None = maybe(
        "Of the rectangle along the lanes, where it is not the spacing."
    )
    corner_u_px: Annotated[Number, Field(gt=0, le=100)] = told(
        "Standard uncertainty of each coordinate of a corner.", default=2.0
    )

    def check(self) -> None:
        cells, lanes = (self.rows, self.columns), (self.lanes, self.lane_width_m, self.spacing_m)
        told = [each is not None for each in (*cells, *lanes)]
        if told not in ([True] * 2 + [False] * 3, [False] * 2 + [True] * 3):
            raise ValueError("give either rows and columns, or lanes, lane_width_m and spacing_m")


CONDITIONS = {each.name: each for spec in METHODS for each in spec.conditions}
"""Surroundings of a measurement."""


class MeasurementOptions(create_model("Conditions", __base__=Form, **make_fields(CONDITIONS.values()))):  # type: ignore[misc]
    """How to measure; what is left out is taken from the frame, its campaign and what is in force."""

    calibration_id: Text | None = maybe("Else the version in force when the frame was taken.")
    roi: NewRoi | None = maybe("Else the outline of `grid`, else the frame's region, else the campaign's.")
    grid: NewGrid | None = maybe("Cells of the surface, each with its own value.")
    reflectance: Reflectance | None = maybe(
        "Of the surface, for the illuminance E = pi L / reflectance; asphalt has about 0.08."
    )
    incidence_angle_deg: Number | None = maybe(
        "Of reflectance: between the surface's normal and the light; else that of the fit.", ge=0, le=60
    )
    index: Text | None = maybe(
        f"Of reflectance, of this frame's capture, whose other bands must be there: "
        f"{', '.join(f'`{name}`' for name in NAMED_INDICES)}, or a formula of band names, numbers, "
        "`+ - * / **` and parentheses, such as `(nir - red) / (nir + red)`.",
        max_length=MOST_LETTERS,
    )
    quantity: Literal["reflectance", "radiance"] | None = maybe(
        "Of a band: its reflectance, or its radiance in W/(m2 sr nm) by the file's own "
        "calibration, which only cameras of MicaSense state."
    )
    products: list[Literal["map", "bands"]] | None = maybe(
        "`map`: every pixel in `map.tif`. `bands`, of reflectance: in it all bands of the capture, aligned "
        "on this frame's pixels; with `index` the index, its standard uncertainty and its bands.",
        max_length=1,
    )
    allow: list[Literal["image_part_empty"]] | None = maybe(
        "Flags of a frame that else forbid to measure it; the measurement then carries them.", max_length=1
    )


class NewMeasurement(MeasurementOptions, one_of="frame_id frame_ids"):  # type: ignore[call-arg]
    """A frame, or several of one scene that are averaged."""

    frame_id: Text | None = None
    frame_ids: list[Text] | None = maybe(
        "Frames of one scene with the same settings, averaged pixel by pixel: their noise "
        "averages, errors that they share do not.",
        min_length=2,
        max_length=MOST_AVERAGED,
    )

    def list_frames(self) -> list[str]:
        """Return the ids in the order in which the same frames are always measured."""
        return sorted(self.frame_ids) if self.frame_ids else [self.frame_id or ""]


class NotMeasured(Answer):
    """A frame that cannot be measured, and why."""

    frame_id: str
    filename: str
    code: str
    detail: str


class CampaignMeasurementsAnswer(Answer):
    jobs: list[JobAnswer]
    not_measured: list[NotMeasured]


def read_region(text: str) -> NewRoi:
    try:
        if text.lstrip().startswith("["):
            return NewRoi.model_validate({"polygon": json.loads(text)})
        return NewRoi(imagej=text)
    except ValidationError as error:
        raise invalid(located(error, "query", "roi")) from error
    except (ValueError, RecursionError) as error:
        raise wrong("query.roi", "must be [[x,y],...] or makePolygon(...)") from error


def read_roi(body: NewRoi) -> Drawing:
    """Return the region as it is stored, with its corners in the order in which they were given."""
    if body.regions is not None:
        return Drawing.of_parts(
            [Region(name=part.name, polygon=Polygon.from_points(part.polygon)) for part in body.regions]
        )
    if body.polygon is not None:
        return Drawing(polygon=Polygon.from_points(body.polygon), corners=body.polygon)
    polygon = parse_imagej(body.imagej or "")
    return Drawing(polygon=polygon, corners=polygon.points)


NewDrawing = Annotated[Drawing, Depends(read_roi)]
"""The region of a body, read before the rows that it changes are locked."""


def read_grid(asked: NewGrid) -> tuple[Grid, LaneGrid | None]:
    """Return the cells of a grid, and its geometry where it is one of lanes."""
    corners = tuple((corner[0], corner[1]) for corner in asked.corners)
    if asked.lanes and asked.lane_width_m and asked.spacing_m:
        lanes = LaneGrid(
            corners=corners,
            lanes=asked.lanes,
            lane_width_m=asked.lane_width_m,
            spacing_m=asked.spacing_m,
            length_m=asked.length_m or asked.spacing_m,
            corner_u_px=asked.corner_u_px,
        )
        return lay_lanes(lanes), lanes
    rows, columns = asked.rows or 0, asked.columns or 0
    return Grid(corners=corners, rows=rows, columns=columns, corner_u_px=asked.corner_u_px), None
