"""Which files need not be sent: asked by hash before an upload."""

from collections.abc import Mapping, Sequence
from typing import Annotated

from pydantic import Field

from service.schemas.base import Answer, Form, Sha256
from service.schemas.campaigns import Role
from service.schemas.frames import State
from store.tables import FrameRow

MOST_HASHES = 1000


class HashesAsked(Form):
    sha256: Annotated[list[Sha256], Field(min_length=1, max_length=MOST_HASHES)]


class KnownFrame(Answer, restates=FrameRow, fields="sha256 filename scene campaign_id"):
    """A frame that is there, with its statements: a sender sees whether it means the same."""

    frame_id: str
    job_id: str | None = Field(default=None, description="The newest job that reads it.")
    role: Role
    state: State = Field(description="A refused one may be sent again: it is then read again.")


class KnownAnswer(Answer):
    known: list[KnownFrame]
    unknown: list[str] = Field(description="To be sent. In the order asked, each once.")

    @classmethod
    def of(cls, asked: Sequence[str], found: Sequence[FrameRow], jobs: Mapping[str, str]) -> "KnownAnswer":
        places = {each: [frame for frame in found if frame.sha256 == each] for each in dict.fromkeys(asked)}
        return cls(
            known=[
                KnownFrame.restate(frame, frame_id=frame.id, job_id=jobs.get(frame.id))
                for there in places.values()
                for frame in there
            ],
            unknown=[each for each, there in places.items() if not there],
        )
