"""Reflectance panels as they were measured on a day."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from service.schemas.base import EACH_ONCE, Answer, BandName, Day, Form, Number, Text
from store.queries.evidence import Offer
from store.tables import Panel


class PanelBand(Form, Answer):
    """Reflectance of a panel in a band; `Red edge`, `RedEdge`, `red_edge` are one name, always the last."""

    band: BandName
    reflectance: Annotated[
        Number, Field(gt=0, le=1.2, description="A share; over 1 only for a glossy panel.")
    ]
    standard_uncertainty: Annotated[
        Number | None, Field(ge=0, lt=1, description="Absolute, as the reflectance is; k = 1.")
    ] = None
    origin: Annotated[
        Literal["file"] | None,
        Field(description="`file`: as the camera or the panel's code states it, on a day that is not known."),
    ] = None


class NewPanel(Form):
    serial: Text = Field(description="As printed on the panel, or in its code.")
    measured_on: Day = Field(description="When its reflectance was measured: panels age.")
    bands: Annotated[
        list[PanelBand],
        Field(min_length=1, max_length=100, description="Each band once.", json_schema_extra=EACH_ONCE),
    ]

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


class PanelOffered(Answer, restates=Offer, fields="serial registered"):
    """The panel that a campaign's frames name, where it is not the campaign's."""

    bands: list[PanelBand] = Field(description="As the files or the panel's code state them; may be empty.")


class PanelAnswer(Answer, restates=Panel, fields="id serial measured_on created_at"):
    bands: list[PanelBand]
