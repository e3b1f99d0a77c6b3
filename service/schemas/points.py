"""Points of a campaign from a table: one frame a row, of which only statistics exist."""

import re
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from service.schemas.base import Answer, Form, Number, Text
from service.schemas.tools.exposure import FNumber, Iso
from service.schemas.tools.settings import ExposureTime
from store.tables import FrameRow

MOST_POINTS = 1000

_Level = Annotated[Number, Field(ge=0, le=1e6)]
_DARK = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}
_FRACTION = re.compile(r"1/(\d+(?:\.\d+)?)")


def _read_fraction(sent: Any) -> Any:  # noqa: ANN401  whatever was sent
    """Return the number of a text such as 1/60."""
    found = _FRACTION.fullmatch(sent) if isinstance(sent, str) else None
    return 1.0 / float(found[1]) if found and float(found[1]) else sent


def _read_dark(sent: Any) -> Any:  # noqa: ANN401  whatever was sent
    found = _DARK.get(str(sent).lower())
    if found is None:
        raise ValueError("must be yes or no; a dark frame is a row of its own, with its own mean")
    return found


class NewPoint(Form):
    """One frame: what it shows, its settings, and the statistics of its region, black included."""

    filename: Text = Field(description="Name of the frame, as ImageJ's Label.")
    scene: Text | None = Field(default=None, description="Light level; a dark frame has none.")
    dark: Annotated[bool, BeforeValidator(_read_dark)] = Field(
        default=False, description="yes of a frame without light."
    )
    exposure_time_s: Annotated[ExposureTime, BeforeValidator(_read_fraction)]
    f_number: FNumber
    iso: Iso
    mean_dn: _Level
    min_dn: _Level
    max_dn: _Level
    std_dn: _Level | None = Field(default=None, description="Else the largest that mean and range allow.")
    pixels: Annotated[float, Field(ge=1, le=1e9, description="Number of samples; ImageJ's Area.")]

    @model_validator(mode="after")
    def _is_possible(self) -> "NewPoint":
        if not self.min_dn <= self.mean_dn <= self.max_dn:
            raise ValueError(
                f"mean_dn {self.mean_dn:g} lies outside min_dn to max_dn, {self.min_dn:g} to {self.max_dn:g}"
            )
        if not self.pixels.is_integer():
            raise ValueError("pixels is no whole number: in ImageJ, remove the scale (Analyze, Set Scale)")
        if self.dark == (self.scene is not None):
            raise ValueError("needs a scene, or dark yes without a scene")
        return self

    @property
    def role(self) -> Literal["light", "dark"]:
        return "dark" if self.dark else "light"


class PointsTable(Form):
    """Statements that a table does not contain."""

    white_level_dn: float = Field(gt=0, le=1e6, description="Where the sensor clips: 255 of 8 bits.")
    black_level_dn: float | None = Field(default=None, ge=0, le=1e6, description="Absent if it is unknown.")
    exposure_time_s: Annotated[
        float | None, Field(gt=1e-9, le=86_400, description="Of rows that state none.")
    ] = None
    f_number: Annotated[float | None, Field(ge=0.1, le=1000, description="Of rows that state none.")] = None
    iso: Annotated[float | None, Field(ge=0.1, le=1e9, description="Of rows that state none.")] = None


class AddedPoint(Answer, restates=FrameRow, fields="filename role scene"):
    frame_id: str


class PointsAnswer(Answer):
    """The frames of a table, in the order of its rows."""

    items: list[AddedPoint]
    ignored_columns: list[str] = Field(description="Columns that were not read.")
