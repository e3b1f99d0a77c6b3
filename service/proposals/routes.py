"""The proposal for a card: which campaign its frames suit, and role and scene of each."""

from datetime import UTC, datetime
from typing import Annotated

from fastapi import Response
from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.methods import METHODS, get_method
from service.auth import Caller, Uploader
from service.changes import IdempotencyKey
from service.context import UsesContext
from service.lookup import owned
from service.operations import Router
from service.proposals.card import CardFrame, choose_methods, sort_card
from service.routes import problems
from service.schemas.base import Answer, Form, FrameRole, Method, Number, Positive, Text
from service.schemas.campaigns import Kind
from store.publications import in_force
from store.tables import Camera, Campaign, FrameRow
from store.tables.base import utc_now

router = Router(prefix="/v1", tags=["frames"])


class FrameOfCard(Form):
    """A frame as its header states it."""

    name: Annotated[str, Field(min_length=1, max_length=1000)] = Field(
        description='Path with "/", from the folder that was chosen.'
    )
    taken_s: Number = Field(
        default=0.0, description="When it was taken, since 1970 [s]; a local time counts as UTC."
    )
    exposure_time_s: Positive | None = None
    f_number: Positive | None = None
    iso: Positive | None = None
    band: Text | None = None
    signal_share: Number | None = Field(
        default=None, description="Mean of its centre, as a share of the range from black to white."
    )


class CardAsked(Form):
    """A card, and what is known of the campaign that its frames are for."""

    frames: Annotated[list[FrameOfCard], Field(min_length=1, max_length=10_000)]
    camera_id: Text | None = Field(default=None, description="The camera, where it is registered.")
    campaign_id: Text | None = Field(
        default=None, description="A campaign that the frames are added to: its scenes go on."
    )
    method: Method | None = Field(default=None, description="Left out: the method that suits the frames.")
    kind: Kind | None = None


class PlacedFrame(Answer):
    name: str
    role: FrameRole
    scene: str | None = None


class CardProposal(Answer):
    """Method and kind of campaign that the frames of a card suit, and role and scene of each, as asked."""

    method: Method
    kind: Kind
    calibration_method: Method = Field(description="The method that the frames suit for a calibration.")
    measurement_method: Method | None = Field(
        default=None, description="The method that they suit for a night of measurements."
    )
    frames: list[PlacedFrame]


@router.post("/proposals", response_model=CardProposal, responses=problems(404))
def propose_frames(
    body: CardAsked, caller: Uploader, context: UsesContext, _idempotency_key: IdempotencyKey = None
) -> Response:
    """Propose method, roles and scenes for the frames of a card, from their headers.

    Nothing is stored. Scenes follow from folders, pauses and changes of exposure; dark frames
    from their names or the brightness of their centre.
    """
    method: str | None = body.method
    kind: str | None = body.kind
    there: list[CardFrame] = []
    with context.database.reading() as session:
        if body.campaign_id is not None:
            campaign = owned(session, Campaign, body.campaign_id, caller)
            method, kind = campaign.method, campaign.kind
            there = _list_scenes(session, campaign)
        held = _list_held(session, body.camera_id, caller)
    frames = [CardFrame(**each.model_dump()) for each in body.frames]
    best, night, looks_like_night = choose_methods(frames, held)
    if method is None:
        night_asked = looks_like_night if kind is None else kind == "measurement"
        spec = night if night_asked and night is not None else best
    else:
        spec, night_asked = get_method(method), kind == "measurement"
    return CardProposal(
        method=spec.name,
        kind="measurement" if night_asked else "calibration",
        calibration_method=best.name,
        measurement_method=night.name if night else None,
        frames=[
            PlacedFrame(name=asked.name, role=placed.role, scene=placed.scene)
            for asked, placed in zip(
                frames, sort_card(frames, spec, night=night_asked, there=there), strict=True
            )
        ],
    ).respond()


def _list_scenes(session: Session, campaign: Campaign) -> list[CardFrame]:
    """List the frames of a campaign that are in scenes, with the times that their files state."""
    names = ("exposure_time_s", "f_number", "iso", "scene")
    rows = session.execute(
        select(
            FrameRow.filename.label("name"),
            FrameRow.header["taken_at"].as_string().label("taken_at"),
            *(getattr(FrameRow, name) for name in names),
        ).where(
            FrameRow.campaign_id == campaign.id,
            FrameRow.scene.is_not(None),
            FrameRow.withdrawn_at.is_(None),
        )
    )
    return [
        CardFrame(
            name=row.name, taken_s=_read_s(row.taken_at), **{name: getattr(row, name) for name in names}
        )
        for row in rows
        if row.taken_at is not None
    ]


def _read_s(taken_at: str) -> float:
    instant = datetime.fromisoformat(taken_at)
    return (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).timestamp()


def _list_held(session: Session, camera_id: str | None, caller: Caller) -> set[str]:
    """List the methods of which a camera has a version in force."""
    if camera_id is None:
        return set()
    camera, now = owned(session, Camera, camera_id, caller), utc_now()
    return {spec.name for spec in METHODS if in_force(session, camera_id=camera.id, method=spec.name, at=now)}
