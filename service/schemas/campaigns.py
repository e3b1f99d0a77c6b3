"""Campaigns, their region and their readings."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, model_validator

from service.schemas.base import Answer, Form, FrameRole, Instant, LongText, Method, Number, Text
from store.judging import Readiness
from store.queries.campaigns import Counts
from store.tables import Campaign, Reading, Roi

Role = FrameRole
Coordinate = Annotated[Number, Field(ge=-1e6, le=1e6)]
Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
Reflectance = Annotated[Number, Field(gt=0, le=1)]


class CampaignDetails(Form):
    """What may be said when a campaign begins, and corrected later."""

    project_number: Text | None = None
    recorder: Text | None = None
    customer: Text | None = None
    place: Text | None = None
    conditions: Annotated[
        LongText | None, Field(description="What surrounded the work: temperature, light.")
    ] = None
    started_at: Instant | None = None
    comments: LongText | None = None
    surface_reflectance: Annotated[
        Reflectance | None,
        Field(description="rho of the taped surface: checks luminance against illuminance."),
    ] = None
    panel_id: Annotated[
        Text | None,
        Field(
            description="Of a reflectance campaign; left out: the panel that the files name, or the only one."
        ),
    ] = None
    target: Annotated[
        dict[str, Any] | None,
        Field(
            description="What is photographed, where the method must know: of geometry the board, of "
            "sharpness the edge or the star. Its fields stand on the method's page. A board may be described "
            "later. When it is changed, the campaign's frames are read anew.",
            examples=[{"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25.0}],
        ),
    ] = None


class NewCampaign(CampaignDetails):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "camera_id": "cam_1",
                    "method": "luminance",
                    "project_number": "P-17",
                    "recorder": "A. Meier",
                }
            ]
        }
    )

    camera_id: Text
    method: Method


class CampaignChange(CampaignDetails):
    model_config = ConfigDict(json_schema_extra={"examples": [{"recorder": "B. Schulz"}]})


class FrameCounts(Answer):
    received: int = Field(description="All frames of the campaign.")
    extracted: int
    refused: int


class CampaignAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "cmp_1",
                    "camera_id": "cam_1",
                    "method": "luminance",
                    "created_at": "2026-05-01T08:00:00Z",
                    "frames": {"received": 30, "extracted": 29, "refused": 1},
                    "readings": 12,
                    "missing": ["scene level-4 has no luminance reading"],
                    "advice": ["no dark frames at ISO 3200"],
                }
            ]
        }
    )

    id: str
    camera_id: str
    method: Method
    project_number: str | None = None
    recorder: str | None = None
    customer: str | None = None
    place: str | None = None
    conditions: str | None = None
    started_at: Instant | None = None
    comments: str | None = None
    surface_reflectance: float | None = None
    panel_id: str | None = None
    target: dict[str, Any] | None = None
    roi_id: str | None = Field(default=None, description="Of the region in use; none while nobody set one.")
    created_at: Instant
    frames: FrameCounts | None = None
    readings: int | None = None
    missing: list[str] | None = Field(default=None, description="What a fit still needs, by name.")
    advice: list[str] | None = Field(default=None, description="What would make a fit good, by name.")

    @classmethod
    def of(cls, row: Campaign) -> "CampaignAnswer":
        return cls.model_validate(
            {name: getattr(row, name) for name in cls.model_fields if hasattr(row, name)}
        )

    @classmethod
    def whole(cls, row: Campaign, counts: Counts, stock: Readiness) -> "CampaignAnswer":
        """With what has arrived and what has not."""
        return cls.of(row).model_copy(
            update={
                "frames": FrameCounts(
                    received=counts.received, extracted=counts.extracted, refused=counts.refused
                ),
                "readings": counts.readings,
                "missing": stock.missing,
                "advice": stock.advice,
            }
        )


class NamedRegion(Form):
    """One of several parts that are looked at each by itself: an edge, a star."""

    name: Text
    polygon: Annotated[list[Point], Field(min_length=3, max_length=1000)]


class NewRoi(Form):
    """A region: its points, ImageJ's own line, or several parts with their names."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"polygon": [[2200, 1600], [3100, 1600], [3100, 2300], [2200, 2300]]},
                {"imagej": "makePolygon(2200,1600,3100,1600,3100,2300,2200,2300);"},
            ],
            "oneOf": [{"required": ["polygon"]}, {"required": ["imagej"]}, {"required": ["regions"]}],
        }
    )

    polygon: Annotated[
        list[Point] | None,
        Field(min_length=3, max_length=1000, description="Corners [x, y] in pixels, x right, y down."),
    ] = None
    imagej: Annotated[LongText | None, Field(description="A makePolygon(...) call of an ImageJ macro.")] = (
        None
    )

    regions: Annotated[
        list[NamedRegion] | None, Field(min_length=1, max_length=100, description="For sharpness.")
    ] = None

    @model_validator(mode="after")
    def _one_of_them(self) -> "NewRoi":
        if sum(given is not None for given in (self.polygon, self.imagej, self.regions)) != 1:
            raise ValueError("give either polygon, imagej or regions")
        names = [part.name for part in self.regions or []]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"each region's name once; given more than once: {', '.join(twice)}")
        return self


class RegionAnswer(Answer):
    name: str
    polygon: list[Point]


class RoiAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "roi_1",
                    "polygon": [[2200, 1600], [3100, 1600], [3100, 2300], [2200, 2300]],
                    "sha256": "0" * 64,
                    "created_at": "2026-05-01T08:00:00Z",
                }
            ]
        }
    )

    id: str
    polygon: list[Point]
    regions: list[RegionAnswer] | None = Field(
        default=None, description="Of a region in parts; `polygon` is then the rectangle around them."
    )
    sha256: str
    created_at: Instant

    @classmethod
    def of(cls, row: Roi) -> "RoiAnswer":
        parts = [RegionAnswer(name=part["name"], polygon=part["points"]) for part in row.parts or []]
        return cls(
            id=row.id,
            polygon=row.points,
            regions=parts or None,
            sha256=row.sha256,
            created_at=row.created_at,
        )


MOST_READINGS = 10_000


class NewReading(Form):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"scene": "level-1", "quantity": "luminance", "value": 54.4, "unit": "cd/m2"}]
        }
    )

    scene: Text
    quantity: Literal["luminance", "illuminance"]
    value: Annotated[Number, Field(gt=0, lt=1e9)]
    unit: Literal["cd/m2", "fL", "lx", "fc"]
    meter_id: Text | None = None
    taken_at: Instant | None = None

    @model_validator(mode="after")
    def _unit_fits(self) -> "NewReading":
        fitting = ("cd/m2", "fL") if self.quantity == "luminance" else ("lx", "fc")
        if self.unit not in fitting:
            raise ValueError(f"{self.unit} is no unit of {self.quantity}: use {' or '.join(fitting)}")
        return self


_READING: dict[str, Any] = {
    "id": "rdg_1",
    "scene": "level-1",
    "quantity": "luminance",
    "value": 54.4,
    "unit": "cd/m2",
    "entered_value": 54.4,
    "entered_unit": "cd/m2",
    "created_at": "2026-05-01T08:00:00Z",
}


class ReadingAnswer(Answer):
    model_config = ConfigDict(json_schema_extra={"examples": [_READING]})

    id: str
    scene: str
    quantity: str
    value: float = Field(description="In SI: cd/m2 or lx.")
    unit: str
    entered_value: float
    entered_unit: str
    meter_id: str | None = None
    taken_at: Instant | None = None
    created_at: Instant
    withdrawn_at: Instant | None = None

    @classmethod
    def of(cls, row: Reading) -> "ReadingAnswer":
        fields: dict[str, Any] = {name: getattr(row, name) for name in cls.model_fields if hasattr(row, name)}
        return cls(unit="cd/m2" if row.quantity == "luminance" else "lx", **fields)


class ReadingsAnswer(Answer):
    model_config = ConfigDict(json_schema_extra={"examples": [{"items": [_READING]}]})

    items: list[ReadingAnswer]
