"""The proposal for a card: its campaign, and role and scene of each frame. Limits: docs/http.md."""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from datetime import UTC, datetime
from itertools import pairwise
from statistics import median
from typing import Annotated, Final

from fastapi import Response
from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.drawing.text import natural_key
from radiometry.methods import METHODS, get_method
from radiometry.specification.application import PictureApplication
from radiometry.specification.method import MethodSpec
from radiometry.specification.roles import CHART, DARK, FIELD, Role
from service.http import answers, changes, lookup, operations
from service.http.auth import Uploader
from service.http.context import UsesContext
from service.http.models import Answer, Form, FrameRole, Method, Number, Positive, Text, maybe, told
from store.publications import in_force
from store.tables import Blob, Camera, Campaign, CampaignKind, FrameRow, utc_now

_PAUSE_S: Final = 60.0  # a pause this long starts a scene, if it is also _PAUSES times the median pause
_PAUSES: Final = 2.5
_EXPOSURE_RATIO: Final = 4.0  # a change of t S / f^2 by this factor starts a scene after two median pauses
_DARK_SIGNAL: Final = 0.002  # the centre of a dark frame is below this share of the range from black to white
_SERIES: Final = 3  # more exposure times with two frames each, at one f-number, are a series
_MOST_CAMPAIGNS: Final = 50
_MOST_FRAMES: Final = 10_000
_Key = tuple[str, float | None, float]  # name, size [B] and time [s] of a file
_PICTURES: Final = (".jpg", ".jpeg", ".png", ".heic")
# folders that cameras make (DCF: three digits and five characters), which name no scene
_CAMERA_FOLDER: Final = re.compile(r"dcim|\d{3}\w{5}|\d{4}set|\d{3}|dji_\d+_.*", re.IGNORECASE)


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


class CardFrame(FrameOfCard):
    """The same with its role; ``scene`` of one that its campaign has already."""

    role: str = ""
    scene: str | None = None

    @property
    def is_dark(self) -> bool:
        return self.signal_share is not None and self.signal_share < _DARK_SIGNAL

    @property
    def exposure(self) -> float:
        """Return t S / f^2; 0 for a file that lacks the time."""
        f_number = self.f_number or 1.0
        return (self.exposure_time_s or 0.0) * (self.iso or 100.0) / f_number / f_number


def choose_methods(
    frames: Sequence[CardFrame], in_force: Collection[str]
) -> tuple[MethodSpec, MethodSpec | None, bool]:
    """Return the method to calibrate, that of a night, and whether it looks like one; `in_force`: names."""
    pictures = all(frame.name.lower().endswith(_PICTURES) for frame in frames)
    able = [spec for spec in METHODS if not pictures or all(role == CHART for role in _roles(spec))]
    words = _words(able)
    named = [role for frame in frames if (role := _name_role(frame.name, words))]
    bands = len({frame.band for frame in frames if frame.band}) > 1

    def score(spec: MethodSpec) -> int:
        own = {role.name for role in spec.roles}
        suits = sum(1 if role in own else -1 for role in named if role != FIELD.name)
        return suits + bands * (len(frames) if spec.reference == "panel" else -len(frames))

    measuring = [
        spec for spec in able if spec.application and not isinstance(spec.application, PictureApplication)
    ]
    measuring.sort(key=lambda spec: (spec.name not in in_force, (spec.reference == "panel") != bands))
    night = measuring[0] if measuring else None
    if named:
        looks_like_night = all(role == FIELD.name for role in named)
    else:
        apart = len(_list_folders(_below_common_folder(frames))) > 1 or any(frame.is_dark for frame in frames)
        looks_like_night = night is not None and night.name in in_force and not apart
    best = max(able, key=score)
    lit = [frame for frame in frames if not frame.is_dark]
    times = Counter(frame.exposure_time_s for frame in lit if frame.exposure_time_s)
    paired = [time_s for time_s, count in times.items() if count > 1]
    by_time = len(paired) > _SERIES and max(paired) > _EXPOSURE_RATIO * min(paired)
    if by_time and len({frame.f_number for frame in lit}) == 1 and best.grid.rows == "f_number":
        others = [spec for spec in able if spec.grid.rows == "exposure_time_s"]
        best = next((spec for spec in others if score(spec) == score(best)), best)
    return best, night, looks_like_night and night is not None


def sort_card(
    frames: Sequence[CardFrame], spec: MethodSpec, *, night: bool, there: Sequence[CardFrame] = ()
) -> list[CardFrame]:
    """Return each frame with role and scene; `there`: frames in the scenes of the campaign, which go on."""
    if night:
        return [frame.model_copy(update={"role": FIELD.name}) for frame in frames]
    roles = {role.name: role for role in _roles(spec)}
    usual = next((role for role in roles.values() if role.has_scene), spec.roles[0])
    words = _words([spec])
    named = [_name_role(frame.name, words) for frame in frames]
    # where people name their dark frames, what else is dark is a light frame of a weak lamp
    seen_by_centre = DARK.name in roles and DARK.name not in named
    placed = []
    for frame, below, stated in zip(frames, _below_common_folder(frames), named, strict=True):
        role = stated or (DARK.name if seen_by_centre and frame.is_dark else usual.name)
        placed.append(below.model_copy(update={"role": role}))
    lit = [frame for frame in placed if frame.role in roles and roles[frame.role].has_scene]
    scenes = _name_scenes(lit, there)
    return [frame.model_copy(update={"scene": scenes.get(frame.name)}) for frame in placed]


def split_scenes(frames: Iterable[CardFrame]) -> list[list[CardFrame]]:
    """Split frames at long pauses and at changes of the exposure, in the order of their times."""
    ordered = sorted(frames, key=lambda frame: (frame.taken_s, natural_key(frame.name)))
    usual = median([after.taken_s - before.taken_s for before, after in pairwise(ordered)] or [0.0])
    scenes = [ordered[:1]] if ordered else []
    for before, after in pairwise(ordered):
        pause = after.taken_s - before.taken_s
        low, high = sorted((before.exposure, after.exposure))
        changed = low > 0 and high > _EXPOSURE_RATIO * low
        if pause >= max(_PAUSE_S, _PAUSES * usual) or (changed and usual > 0 and pause >= 2 * usual):
            scenes.append([])
        scenes[-1].append(after)
    return scenes


def _name_scenes(lit: Sequence[CardFrame], there: Sequence[CardFrame]) -> dict[str, str]:
    """Name scenes after their folders; frames of one folder, or of none, are split by time."""
    folders = _list_folders(lit)
    if len(folders) == 1:
        loose = [frame for frame in lit if _folder(frame.name) not in folders]
        folders = [] if loose or len(split_scenes(lit)) > 1 else folders
    named = {frame.name: _folder(frame.name) for frame in lit if _folder(frame.name) in folders}
    used = {frame.scene for frame in there} | set(named.values())
    fresh = (name for number in range(1, len(lit) + len(used) + 1) if (name := f"Scene {number}") not in used)
    for some in split_scenes([*(frame for frame in lit if frame.name not in named), *there]):
        known = Counter(frame.scene for frame in some if frame.scene)
        if new := [frame for frame in some if frame.scene is None]:
            scene = known.most_common(1)[0][0] if known else next(fresh)
            named |= {frame.name: scene or "" for frame in new}
    return named


def _roles(spec: MethodSpec) -> tuple[Role, ...]:
    return (*spec.roles, *spec.applied_roles)


def _words(specs: Iterable[MethodSpec]) -> list[str]:
    return [*dict.fromkeys(role.name for spec in specs for role in spec.roles if not role.has_scene)]


def _name_role(path: str, words: Sequence[str]) -> str | None:
    """Return the role that a folder's name begins with or a file's name contains; field: a folder alone."""
    *folders, file = path.lower().split("/")
    for role in (*words, FIELD.name):
        if any(folder.startswith(role) for folder in folders) or (role != FIELD.name and role in file):
            return role
    return None


def _below_common_folder(frames: Sequence[CardFrame]) -> list[CardFrame]:
    """Without the folder that was chosen: it is the card's or the night's, and names no scene."""
    heads = {frame.name.partition("/")[0] if "/" in frame.name else "" for frame in frames}
    if len(heads) != 1 or heads == {""}:
        return list(frames)
    return [frame.model_copy(update={"name": frame.name.partition("/")[2]}) for frame in frames]


def _folder(path: str) -> str:
    return next((part for part in path.split("/")[-2::-1] if not _CAMERA_FOLDER.fullmatch(part)), "")


def _list_folders(frames: Iterable[CardFrame]) -> list[str]:
    return [*dict.fromkeys(folder for frame in frames if (folder := _folder(frame.name)))]


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
    return CardProposal(
        method=spec.name,
        kind="measurement" if night_asked else "calibration",
        calibration_method=best.name,
        measurement_method=night.name if night else None,
        frames=[
            PlacedFrame(
                name=asked.name, role=placed.role, scene=placed.scene, campaign_id=holders.get(_key(asked))
            )
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
