"""Campaigns, their region and their readings."""

from typing import Annotated, Any, Literal

import pydantic
from pydantic import BeforeValidator, ConfigDict, FailFast, Field, create_model

from radiometry.methods import METHODS
from service.calibrations.methods import make_fields
from service.equipment.schemas import Lens, PanelOffered
from service.http import models
from service.http.models import Answer, Form, Instant, Text, maybe, told
from store.queries.campaigns import Counts
from store.tables import Campaign, Reading, Roi, campaign

Role = models.FrameRole
Coordinate = Annotated[models.Number, Field(ge=-1e6, le=1e6)]
Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
Reflectance = Annotated[models.Number, Field(gt=0, le=1)]


STATED = {each.name: each for spec in METHODS for each in spec.parameters if each.given_by == "campaign"}
"""What a campaign states for the fit of its method."""


class CampaignDetails(create_model("Stated", __base__=Form, **make_fields(STATED.values()))):  # type: ignore[misc]
    """Details of a campaign: stated when it begins, or corrected later."""

    kind: campaign.CampaignKind | None = maybe(
        "`calibration` unless stated. `measurement`: a night of measurements, whose frames are all field "
        "frames; no fit uses them. A campaign with other frames, or with versions, cannot become one."
    )
    project_number: Text | None = maybe(
        "Number or name under which the work is found again; the campaign and its certificates carry it."
    )
    recorder: Text | None = maybe("Who took the frames and the readings; on the certificate.")
    customer: Text | None = maybe("For whom the camera is calibrated; on the certificate.")
    place: Text | None = maybe("Where the frames were taken; on the certificate.")
    conditions: models.LongText | None = maybe(
        "What surrounded the work: temperature, lamp, daylight; on the certificate."
    )
    started_at: Instant | None = maybe(
        "Beginning of the work in UTC; on the certificate. Campaigns are ordered by it."
    )
    ended_at: Instant | None = maybe("End of the work in UTC, not before its beginning; on the certificate.")
    time_zone: models.TimeZone | None = maybe(
        "Of the camera's clock, for files that state no offset: an IANA name or an offset. Left "
        "out: UTC for the files of Parrot and MicaSense cameras, else the organisation's."
    )
    lens: Lens | None = maybe(
        "The lens on the camera, where it is not the one registered with it. Fits from now on "
        "are valid for this lens."
    )
    comments: models.LongText | None = maybe("Free text; on the certificate. It changes no result.")
    panel_id: Text | None = maybe(
        "Of a reflectance campaign; left out: the panel that the files name, or the only one."
    )
    panel_serial: Text | None = maybe(
        "In place of `panel_id`: the registered panel of this serial number, or the one that "
        "`panel_offered` names, which is then registered with the reflectances that its files state."
    )
    target: dict[str, Any] | None = maybe(
        "What is photographed, where the method must know: of geometry the board, of "
        "sharpness the edge or the star. Its fields stand on the method's page. A board may be described "
        "later. When it is changed, the campaign's frames are read again.",
        examples=[{"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25.0}],
    )


class NewCampaign(CampaignDetails):
    camera_id: Text = told("The camera that took the frames: frames of another one are refused.")
    method: models.Method = told("What is calibrated; it cannot be changed later.")


_TAKES_AWAY = BeforeValidator(lambda value: None if value == "" else value)


def _or_empty(schema: dict[str, Any]) -> None:
    schema["anyOf"].append({"type": "string", "maxLength": 0})


class CampaignChange(CampaignDetails):
    """Corrections; what is left out stays, and a text of "" is taken away."""

    project_number: models.Clearable | None = None
    recorder: models.Clearable | None = None
    customer: models.Clearable | None = None
    place: models.Clearable | None = None
    conditions: models.ClearableLong | None = None
    comments: models.ClearableLong | None = None
    time_zone: models.ClearableZone | None = None
    ended_at: Annotated[
        Instant | None, _TAKES_AWAY, told("The end of the work in UTC.", json_schema_extra=_or_empty)
    ] = None
    lens: Annotated[
        Lens | None,
        _TAKES_AWAY,
        told(
            'The lens on the camera; "" for the one that is registered with it.', json_schema_extra=_or_empty
        ),
    ] = None
    camera_id: Text | None = maybe("Another camera: every frame is checked against it again.")
    archived: models.Flag | None = maybe("Put away, or taken out again.")


class FrameCounts(Answer, restates=Counts, fields="received being_read extracted refused"):
    pass


class CampaignAnswer(
    Answer,
    restates=Campaign,
    fields="id camera_id method kind project_number recorder customer place conditions started_at "
    f"ended_at time_zone lens comments {' '.join(STATED)} archived_at panel_id target roi_id created_at",
):
    method: models.Method
    kind: campaign.CampaignKind
    frames: FrameCounts | None = None
    readings: int | None = None
    measured: int | None = maybe("Of a night: how many of its frames have a measurement.")
    panel_offered: PanelOffered | None = maybe(
        "The panel that the frames name, where it is not the campaign's. Send its serial."
    )
    missing: list[str] | None = maybe("What a fit still needs, by name; of a night, what measuring needs.")
    advice: list[str] | None = maybe("What would make a fit good, by name.")
    causes: list[models.FindingGroupAnswer] | None = maybe(
        "The same as data, one a code: `error` keeps a fit from starting, `pending` ends by "
        "itself, `warn` would improve it."
    )
    findings: list[models.FindingGroupAnswer] | None = maybe(
        "Reasons of the frames' verdicts, and what holds for the campaign."
    )


class NamedRegion(Form):
    """One of several parts that are measured separately: an edge, a star."""

    name: Text
    polygon: Annotated[list[Point], Field(min_length=3, max_length=1000), FailFast()]


_GAP = r"[ \t\n]*"
_NUMBER = rf"{_GAP}[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?{_GAP}"
_PAIR = f"{_NUMBER},{_NUMBER}"
_POLYGON = rf"makePolygon{_GAP}\({_PAIR}(,{_PAIR}){{2,}}\)"
_SIZE = _PAIR.replace("[-+]", "[+]")
_RECTANGLE = rf"makeRectangle{_GAP}\({_PAIR},{_SIZE}\)"
_MACRO = f"{_GAP}({_POLYGON}|{_RECTANGLE}){_GAP};?{_GAP}"
_JSON_NUMBER = rf"{_GAP}-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]+)?{_GAP}"
_CORNER = rf"{_GAP}\[{_JSON_NUMBER},{_JSON_NUMBER}\]{_GAP}"
_JSON = rf"{_GAP}\[{_CORNER}(,{_CORNER}){{2,}}\]{_GAP}"
REGION_PATTERN = f"^({_MACRO}|{_JSON})$"  # a region as an address or a header holds it


class NewRoi(Form, one_of="polygon imagej regions"):
    """A region: its points, ImageJ's own line, or several parts with their names."""

    polygon: list[Point] | None = maybe(
        "Corners [x, y] in pixels of the image, x right, y down, in order around the area: "
        "the outline does not cross itself.",
        min_length=3,
        max_length=1000,
    )
    imagej: models.LongText | None = maybe(
        "A makePolygon(...) or makeRectangle(...) call of an ImageJ macro.",
        json_schema_extra={"pattern": f"^{_MACRO}$"},
    )
    regions: list[NamedRegion] | None = maybe(
        "For sharpness; each name once.", min_length=1, max_length=100, json_schema_extra=models.EACH_ONCE
    )

    def check(self) -> None:
        names = [part.name for part in self.regions or []]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"each region's name once; given more than once: {', '.join(twice)}")


class RegionAnswer(Answer):
    name: str
    polygon: list[Point]


class RoiAnswer(Answer, restates=Roi, fields="id sha256 created_at"):
    polygon: list[Point]
    regions: list[RegionAnswer] | None = maybe(
        "Of a region in parts; `polygon` is then the rectangle around them."
    )

    @classmethod
    def of(cls, row: Roi) -> "RoiAnswer":
        parts = [{"name": part["name"], "polygon": part["points"]} for part in row.parts or []]
        return cls.restate(row, polygon=row.points, regions=parts or None)


MOST_READINGS = 10_000
_UNITS = {"luminance": ["cd/m2", "fL"], "illuminance": ["lx", "fc"]}


class NewReading(Form):
    model_config = ConfigDict(
        json_schema_extra={
            "if": {"properties": {"quantity": {"const": "luminance"}}},
            "then": {"properties": {"unit": {"enum": [*_UNITS["luminance"], "cd/m²"]}}},
            "else": {"properties": {"unit": {"enum": [*_UNITS["illuminance"]]}}},
        }
    )

    scene: Text = told("The light level that was read: that of the frames with this scene.")
    quantity: Literal["luminance", "illuminance"] = told("What the meter showed.")
    value: models.Number = told(
        "As the meter showed it. Several readings of a scene give their spread.", gt=0, lt=1e9
    )
    unit: Annotated[
        Literal["cd/m2", "cd/m²", "fL", "lx", "fc"],
        pydantic.AfterValidator(lambda unit: unit.replace("²", "2")),
    ] = told("As the meter showed it; 1 fL is 3.426 cd/m², 1 fc is 10.764 lx.")
    meter_id: Text | None = maybe(
        "The meter that was read: without it, u(K) does not include its calibration."
    )
    taken_at: Instant | None = maybe(
        "When it was read, in UTC: shows whether the lamp drifted between reading and frames."
    )
    reason: Text | None = maybe(
        "Why the reading is right although its frames say half or less of it, or double or more: "
        "with a reason it is used, and the certificate says so."
    )
    replaces: str | None = maybe(
        "The id of the reading that this one corrects: that one is withdrawn in the moment "
        'in which this one is recorded. "": it is the first of its scene and quantity. Where another '
        "user was faster, nothing is recorded: 409 `changed_meanwhile`.",
        max_length=200,
    )

    def check(self) -> None:
        if self.unit not in (fitting := _UNITS[self.quantity]):
            raise ValueError(f"{self.unit} is no unit of {self.quantity}: use {' or '.join(fitting)}")


class ReadingAnswer(
    Answer,
    restates=Reading,
    fields="id scene quantity value entered_value entered_unit meter_id taken_at reason created_at "
    "withdrawn_at",
):
    unit: str

    @classmethod
    def of(cls, row: Reading) -> "ReadingAnswer":
        return cls.restate(row, unit="cd/m2" if row.quantity == "luminance" else "lx")


class ReadingsAnswer(Answer):
    items: list[ReadingAnswer]
