"""Reflectance panels as they were measured on a day."""

from typing import Annotated, Any

from pydantic import ConfigDict, Field, model_validator

from service.schemas.base import Answer, BandName, Day, Form, Instant, Number, Text
from store.tables import Panel

_EXAMPLE: dict[str, Any] = {
    "serial": "RP02-1603036-SC",
    "measured_on": "2026-03-14",
    "bands": [
        {"band": "green", "reflectance": 0.69, "standard_uncertainty": 0.005},
        {"band": "red", "reflectance": 0.68, "standard_uncertainty": 0.005},
    ],
}


class PanelBand(Form, Answer):
    """What a panel reflects in a band; `Red edge`, `RedEdge` and `red_edge` are one name, always the last."""

    band: BandName
    reflectance: Annotated[
        Number, Field(gt=0, le=1.2, description="A share; over 1 only for a glossy panel.")
    ]
    standard_uncertainty: Annotated[
        Number | None, Field(ge=0, lt=1, description="Absolute, as the reflectance is; k = 1.")
    ] = None


class NewPanel(Form):
    model_config = ConfigDict(json_schema_extra={"examples": [_EXAMPLE]})

    serial: Text
    measured_on: Day
    bands: Annotated[list[PanelBand], Field(min_length=1, max_length=100)]

    @model_validator(mode="after")
    def _each_band_once(self) -> "NewPanel":
        names = [band.band for band in self.bands]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"each band once; given more than once: {', '.join(twice)}")
        return self

    def columns(self) -> dict[str, Any]:
        """The table's columns; the bands in an order that does not depend on how they were sent."""
        bands = sorted((band.model_dump(exclude_none=True) for band in self.bands), key=lambda b: b["band"])
        return {"serial": self.serial, "measured_on": self.measured_on, "bands": bands}


class PanelAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={"examples": [{"id": "pnl_1", **_EXAMPLE, "created_at": "2026-05-01T08:00:00Z"}]}
    )

    id: str
    serial: str
    measured_on: Day
    bands: list[PanelBand]
    created_at: Instant

    @classmethod
    def of(cls, row: Panel) -> "PanelAnswer":
        return cls.model_validate(row)
