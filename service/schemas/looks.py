"""A region that is being drawn, and the verdicts of a whole campaign."""

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from radiometry.frame.verdicts import Verdict
from service.schemas.base import Answer, Form
from service.schemas.campaigns import Point
from service.schemas.frames import VerdictAnswer


class NewLook(Form):
    """Corners of a region that is not set yet."""

    polygon: Annotated[
        list[Point],
        Field(min_length=3, max_length=1000, description="Corners [x, y] in pixels, x right, y down."),
    ]


class FrameVerdict(VerdictAnswer):
    frame_id: str


class VerdictsAnswer(Answer):
    items: list[FrameVerdict]

    @classmethod
    def of(cls, verdicts: Mapping[str, Verdict]) -> "VerdictsAnswer":
        return cls(
            items=[
                FrameVerdict.restate(verdicts[frame_id], frame_id=frame_id) for frame_id in sorted(verdicts)
            ]
        )
