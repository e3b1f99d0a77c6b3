"""Numbers of a map, for drawing it and pointing at it."""

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, WithJsonSchema

from radiometry.fitting.comparison import SUBTRACTED
from service.map_values import Layout, Values, Window
from service.schemas.base import Answer, Form
from store.tables import Measurement

_Pixel = Annotated[int, Field(ge=0, lt=1_000_000)]
_Size = Annotated[int | None, Field(ge=1, lt=1_000_000, description="Left out: up to the border.")]


Layer = Literal["value", "expanded_uncertainty_rel"]


class MapWindow(Form):
    """Which part of a map."""

    layer: Annotated[
        Layer,
        Field(
            description="`value`: those of map.tif. `expanded_uncertainty_rel`: the expanded uncertainty "
            "(k = 2) of each mean over that mean."
        ),
    ] = "value"
    step: Annotated[int, Field(ge=1, le=4096, description="The side of the squares, in pixels.")] = 1
    top: _Pixel = 0
    left: _Pixel = 0
    height: _Size = None
    width: _Size = None

    @property
    def tag(self) -> str:
        return f"{self.layer}-{self.step}-{self.top}-{self.left}-{self.height}-{self.width}"


# here null is a value: that of a pixel which was saturated
_Value = Annotated[float | None, WithJsonSchema({"type": ["number", "null"]})]


class ValueUncertainty(Answer):
    """Uncertainty of a value v: u^2 = (u_rel v)^2 + u_constant^2 + u_pixel^2; the last two in its unit."""

    u_rel: float = Field(description="Of K, meter, time, f-number: the same share in every pixel.")
    u_constant: float = Field(description="Of the dark signal and of stray light: the same in every pixel.")
    u_pixel: float = Field(
        description="A single pixel's own, as it was found in the measured region; a mean over a square "
        "of n x n pixels has 1/n of it, up to 1.5/n for `green` and 2.7/n for `grey` of a mosaic, whose "
        "pixels share raw values."
    )


class MapValuesAnswer(Answer):
    layer: Layer
    unit: str = Field(description='As in map.tif: "cd/m2", or "1" of a reflectance, an index or a share.')
    height_px: int = Field(description="Of the whole map.")
    width_px: int
    top: int
    left: int
    step: int
    values: list[list[_Value]] = Field(
        description="Rows of columns; the mean of `step` x `step` pixels. null: saturated, or not defined."
    )
    uncertainty: ValueUncertainty | None = Field(
        default=None,
        description="Of values; absent of an index, whose uncertainty follows no such rule, and of other "
        "layers.",
    )
    notes: list[str] = Field(description="What the uncertainty of a place does not contain.")

    @classmethod
    def of(
        cls,
        row: Measurement,
        layout: Layout,
        window: Window,
        values: Values,
        asked: MapWindow,
        *,
        notes: list[str],
    ) -> "MapValuesAnswer":
        is_value = asked.layer == "value"
        return cls(
            layer=asked.layer,
            unit=layout.unit if is_value else "1",
            height_px=layout.height_px,
            width_px=layout.width_px,
            top=window.top,
            left=window.left,
            step=asked.step,
            values=_plain(values),
            uncertainty=uncertainty_of(row.result) if is_value else None,
            notes=notes,
        )


class FootprintAnswer(Answer):
    """A GeoJSON polygon: one ring of longitude and latitude, closed."""

    type: Literal["Polygon"]
    coordinates: list[list[list[float]]]


class StacItem(Answer):
    """A STAC item: a GeoJSON feature with links and assets."""

    type: Literal["Feature"]
    stac_version: str
    stac_extensions: list[str]
    id: str
    geometry: FootprintAnswer | None = Field(json_schema_extra={"nullable_on_purpose": True})
    bbox: list[float] | None = Field(default=None, description="Absent where there is no geometry.")
    properties: dict[str, Any]
    links: list[dict[str, str]]
    assets: dict[str, dict[str, Any]]


def uncertainty_of(result: dict[str, Any]) -> ValueUncertainty | None:
    """Split a stored budget: all that is shared scales with the value, but for what is subtracted."""
    if "smallest" not in result or "budget" not in result:
        return None
    mean, smallest = result["mean"]["value"], result["smallest"]
    shared = {
        share["source"]: share.get("standard_uncertainty_cd_m2", share.get("standard_uncertainty"))
        for share in result["budget"]
        if share["shared"]
    }
    if not mean:
        return None
    constant = math.hypot(*(shared.pop(source, 0.0) for source in SUBTRACTED))
    relative = math.hypot(*shared.values()) / abs(mean)
    known = math.hypot(relative * smallest["value"], constant)
    noise = math.sqrt(max(0.0, smallest["standard_uncertainty"] ** 2 - known**2))
    return ValueUncertainty(u_rel=relative, u_constant=constant, u_pixel=noise)


def _plain(values: Values) -> list[list[float | None]]:
    """The shortest decimals that are the same float32: as doubles they would be twice as long."""
    return [[None if np.isnan(value) else float(str(value)) for value in line] for line in values]
