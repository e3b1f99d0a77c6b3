"""The proposal for a card: its campaign, and role and scene of each frame. Limits: docs/http.md."""

from datetime import UTC, datetime
from typing import Annotated, Final

from fastapi import Response
from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.card import CardFrame, choose_methods, sort_card
from radiometry.methods import METHODS, get_method
from service.http import answers, changes, lookup, operations
from service.http.auth import Uploader
from service.http.context import UsesContext
from service.http.models import Answer, Form, FrameRole, Method, Number, Positive, Text, maybe, told
from store.publications import in_force
from store.tables import Blob, Camera, Campaign, CampaignKind, FrameRow, utc_now

_MOST_CAMPAIGNS: Final = 50
_MOST_FRAMES: Final = 10_000
_Key = tuple[str, float | None, float]  # name, size [B] and time [s] of a file


class FrameOfCard(Form):
    """A frame as its header states it."""

    name: Annotated[str, Field(min_length=1, max_length=1000)] = told(
        'Path with "/", from the folder that was chosen.'
    )
    size_bytes: Annotated[Number, Field(ge=0)] | None = maybe("To find files that a campaign holds already.")
    taken_s: Number = told("When it was taken, since 1970 [s]; a local time counts as UTC.", default=0.0)
    exposure_time_s: Positive | None = None
    f_number: Positive | None = None
    iso: Positive | None = None
    band: Text | None = None
    signal_share: Number | None = maybe("Mean of its centre, as a share of the range from black to white.")


router = operations.Router(prefix="/v1", tags=["frames"])


class CardAsked(Form):
    """A card, and what is known of the campaign that its frames are for."""

    frames: Annotated[list[FrameOfCard], Field(min_length=1, max_length=10_000)]
    camera_id: Text | None = maybe("The camera, where it is registered.")
    campaign_id: Text | None = maybe("A campaign that the frames are added to: its scenes go on.")
    method: Method | None = maybe("Left out: the method that suits the frames.")
    kind: CampaignKind | None = None


class PlacedFrame(Answer):
    name: str
    role: FrameRole
    scene: str | None = None
    campaign_id: str | None = maybe("The camera's campaign that holds a file of this name, size and time.")


class CardProposal(Answer):
    """Method and kind of campaign that the frames of a card suit, and role and scene of each, as asked."""

    method: Method
    kind: CampaignKind
    calibration_method: Method = told("The method that the frames suit for a calibration.")
    measurement_method: Method | None = maybe("The method that they suit for a night of measurements.")
    frames: list[PlacedFrame]


@router.post("/proposals", response_model=CardProposal, responses=answers.problems(404))
def propose_frames(
    body: CardAsked, caller: Uploader, context: UsesContext, _idempotency_key: changes.IdempotencyKey = None
) -> Response:
    """Propose method, roles and scenes for the frames of a card, from their headers.

    Nothing is stored. Scenes follow from folders, pauses and changes of exposure; dark frames
    from their names, else from the brightness of their centre.
    """
    method: str | None = body.method
    kind: str | None = body.kind
    there: list[CardFrame] = []
    with context.database.reading() as session:
        if body.campaign_id is not None:
            campaign = lookup.owned(session, Campaign, body.campaign_id, caller)
            method, kind = campaign.method, campaign.kind
            there = _list_scenes(session, campaign)
        camera = lookup.owned(session, Camera, body.camera_id, caller) if body.camera_id is not None else None
        held, now = [], utc_now()
        if camera is not None:
            held = [x.name for x in METHODS if in_force(session, camera_id=camera.id, method=x.name, at=now)]
        holders = _find_holders(session, camera) if camera is not None else {}
    frames = [CardFrame(**each.model_dump(exclude_none=True)) for each in body.frames]
    best, night, looks_like_night = choose_methods(frames, held)
    if method is None:
        night_asked = looks_like_night if kind is None else kind == "measurement"
        spec = night if night_asked and night is not None else best
    else:
        spec, night_asked = get_method(method), kind == "measurement"
    placed = sort_card(frames, spec, night=night_asked, there=there)
    return CardProposal(
        method=spec.name,
        kind="measurement" if night_asked else "calibration",
        calibration_method=best.name,
        measurement_method=night.name if night else None,
        frames=[
            PlacedFrame.restate(each, name=asked.name, campaign_id=holders.get(_key(asked)))
            for asked, each in zip(frames, placed, strict=True)
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
        ).where(FrameRow.standing(campaign.id), FrameRow.scene.is_not(None))
    )
    found = []
    for row in rows.mappings():
        said = {name: value for name, value in row.items() if value is not None}
        if taken_at := said.pop("taken_at", None):
            found.append(CardFrame(taken_s=_read_s(taken_at), **said))
    return found


def _find_holders(session: Session, camera: Camera) -> dict[_Key, str]:
    """Find the campaigns, newest first, that hold frames of the camera that this card has too."""
    recent = select(Campaign.id).where(Campaign.camera_id == camera.id, Campaign.archived_at.is_(None))
    rows = session.execute(
        select(
            FrameRow.filename, Blob.size_bytes, FrameRow.header["taken_at"].as_string(), FrameRow.campaign_id
        )
        .join(Blob, Blob.sha256 == FrameRow.sha256)
        .where(
            FrameRow.campaign_id.in_(recent.order_by(Campaign.id.desc()).limit(_MOST_CAMPAIGNS)),
            FrameRow.withdrawn_at.is_(None),
        )
        .order_by(FrameRow.id)
        .limit(_MOST_FRAMES)
    )
    return {
        (name.rpartition("/")[2], size, _read_s(taken_at) // 1 if taken_at else 0.0): campaign
        for name, size, taken_at, campaign in rows
    }


def _key(frame: CardFrame) -> _Key:
    return frame.name.rpartition("/")[2], frame.size_bytes, frame.taken_s // 1


def _read_s(taken_at: str) -> float:
    instant = datetime.fromisoformat(taken_at)
    return (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).timestamp()
