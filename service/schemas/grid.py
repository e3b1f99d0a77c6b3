"""The grid of a campaign: facts of its frames in columns, and gaps."""

from typing import Annotated, Any

from pydantic import Field, WithJsonSchema

from radiometry.specification.grid import Gap
from service.schemas.base import Answer

_Texts = Annotated[list[str | None], WithJsonSchema({"type": "array", "items": {"type": ["string", "null"]}})]
_Numbers = Annotated[
    list[float | None], WithJsonSchema({"type": "array", "items": {"type": ["number", "null"]}})
]


class GridColumns(Answer):
    """One entry per frame in each column; null for what a frame does not have."""

    id: list[str]
    filename: list[str]
    role: list[str]
    scene: _Texts
    state: list[str]
    exposure_time_s: _Numbers
    f_number: _Numbers
    iso: _Numbers
    band: _Texts
    capture_id: _Texts
    taken_at: _Texts
    width_px: _Numbers
    height_px: _Numbers
    roi_id: _Texts = Field(description="Of a frame's own region.")
    roi_origin: _Texts = Field(description="drawn, or found on a panel.")
    signal_dn: _Numbers = Field(
        description="Mean of the green channels, else of all, in the region that holds; black not subtracted."
    )
    clipped_share: _Numbers = Field(description="Of the channel with most pixels at the white level.")
    outcome: list[str] = Field(description="Of the verdict: pass, warn, fail or pending.")
    code: _Texts = Field(description="Of the gravest reason of the verdict.")
    detail: _Texts = Field(description="Its sentence.")
    refusal_code: _Texts
    left_out: _Texts = Field(description="Why a person left it out.")
    withdrawn: list[bool]


class GapAnswer(Answer, restates=Gap, without="at"):
    """A frame to photograph next."""

    at: dict[str, Any] = Field(description="Values of the grid's axes, as far as they are known.")


class CampaignGridAnswer(Answer):
    """A page of a campaign's grid."""

    frames: GridColumns
    gaps: list[GapAnswer] = Field(description="What to photograph next; of the first page.")
    next: str | None = Field(json_schema_extra={"nullable_on_purpose": True})
