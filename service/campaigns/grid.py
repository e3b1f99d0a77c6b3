"""The grid of a campaign's frames: read in columns, changed many at once."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Final

from fastapi import Query, Request, Response
from fastapi.responses import JSONResponse
from pydantic import Field, WithJsonSchema
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from radiometry.frame.verdicts import Verdict
from radiometry.specification.roles import Gap
from service.frames import pictures, routes
from service.frames.schemas import ExpectedFrame, FramesChange, FramesChanged
from service.http import answers, auth, changes, connections, lookup, models, operations, paging, problems
from service.http.context import Context, UsesContext
from store.queries import audit, campaigns
from store.reviews import hash_code
from store.tables import Campaign, CampaignReview, FrameRow

_Texts = Annotated[list[str | None], WithJsonSchema({"type": "array", "items": {"type": ["string", "null"]}})]
_Numbers = Annotated[
    list[float | None], WithJsonSchema({"type": "array", "items": {"type": ["number", "null"]}})
]


class GridColumns(models.Answer):
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
    instant: _Texts = models.told(
        "`taken_at` in UTC, the earlier of two if the clock showed it twice; null if its zone is not known."
    )
    time_zone: _Texts = models.told(
        "Of its clock, as campaign or organisation state it; null if none was needed or stated."
    )
    width_px: _Numbers
    height_px: _Numbers
    roi_id: _Texts = models.told("Of a frame's own region.")
    roi_origin: _Texts = models.told("drawn, or found on a panel.")
    signal_dn: _Numbers = models.told(
        "Mean of the green channels, else of all, in the region that holds; black not subtracted."
    )
    clipped_share: _Numbers = models.told("Of the channel with most pixels at the white level.")
    outcome: list[str] = models.told("Of the verdict: pass, warn, fail or pending.")
    code: _Texts = models.told("Of the gravest reason of the verdict.")
    detail: _Texts = models.told("Its sentence.")
    refusal_code: _Texts
    left_out: _Texts = models.told("Why a person left it out.")
    withdrawn: list[bool]
    thumbnail: _Texts = models.told("Changes with the frame's thumbnail; null while there is none.")


class GapAnswer(models.Answer, restates=Gap, without="at"):
    """A frame to photograph next."""

    at: dict[str, Any] = models.told("Values of the grid's axes, as far as they are known.")


class CampaignGridAnswer(models.Answer):
    """A page of a campaign's grid."""

    frames: GridColumns
    gaps: list[GapAnswer] = models.told("What to photograph next; of the first page.")
    partial: bool = models.told(
        "Only the frames that have changed since `since`; the others are as they were."
    )
    since: str | None = models.maybe(
        "Of the first page: asks next time for what has changed. Absent if that is not known."
    )
    next: str | None = Field(json_schema_extra={"nullable_on_purpose": True})


router = operations.Router(prefix="/v1/campaigns/{campaign_id}", tags=["frames"])

_MOST_FRAMES = 5000


@router.get("/grid", **answers.sends(CampaignGridAnswer, 404))
def get_campaign_grid(
    campaign: lookup.Own[Campaign],
    request: Request,
    context: UsesContext,
    limit: Annotated[int, Query(ge=1, le=_MOST_FRAMES)] = 1000,
    cursor: paging.Cursor = None,
    since: Annotated[
        models.Text | None,
        Query(description="The `since` of an earlier answer: the frames that have changed are enough."),
    ] = None,
) -> Response:
    """Return a campaign's frames in columns, with the gaps to photograph next.

    Frames come in the order in which they were sent, withdrawn ones too. The ETag changes with the campaign.
    With `since` the answer holds the changed frames alone and says `partial`, unless all may have changed.
    """
    with context.database.reading() as session:
        revision = select(CampaignReview.revision).where(CampaignReview.campaign_id == campaign.id)
        after = "" if cursor is None else paging.read_key(cursor, FrameRow.__tablename__)
        tagged = f"{session.scalar(revision)}-{hash_code()}-{cursor or ''}-{limit}"
        tag = hashlib.sha256(tagged.encode()).hexdigest()
        headers = answers.standing(request, tag, Vary="Authorization")
        if since:
            # which verdicts have changed is known once they are kept
            context.reviews.find(session, campaign.id)
    with context.database.reading() as session:
        campaign = session.get_one(Campaign, campaign.id)
        reviewed = session.get_one(CampaignReview, campaign.id)
        known = _read_since(since, reviewed)
        frames = campaigns.read_grid(session, campaign, after=after, limit=limit + 1, since=known)
        more, frames = len(frames) > limit, frames[:limit]
        review = context.reviews.find(session, campaign.id, verdicts_of=[frame["id"] for frame in frames])
    place = paging.write_cursor([FrameRow.__tablename__, frames[-1]["id"]]) if more else None

    answer = CampaignGridAnswer(
        frames=_shape(frames, review.verdicts),
        gaps=[] if cursor else [GapAnswer.restate(gap, at=dict(gap.at)) for gap in review.gaps],
        partial=known is not None,
        since=f"{reviewed.revision}-{hash_code()}" if not cursor and _is_kept(context, reviewed) else None,
        next=connections.address_with(request, cursor=place) if place else None,
    )
    return JSONResponse(answer.dump() | {"next": answer.next}, headers=headers)


@router.patch("/frames", response_model=FramesChanged, responses=answers.problems(404, 409))
def change_frames(
    campaign: lookup.Own[Campaign], body: FramesChange, caller: auth.Calibrator, session: Session
) -> changes.Reply:
    """Change many frames alike: move them to a scene, leave them out, withdraw or restore them.

    With `expected` nothing is changed where another user was faster: 409 `changed_meanwhile` says who, and
    how the frame is now.
    """
    ids = sorted(set(body.frame_ids))
    chosen = select(FrameRow).where(FrameRow.campaign_id == campaign.id, FrameRow.id.in_(ids))
    frames = session.scalars(chosen.order_by(FrameRow.id).with_for_update()).all()
    if unknown := set(ids) - {frame.id for frame in frames}:
        raise problems.wrong("body.frame_ids", f"{min(unknown)} is not a frame of this campaign")
    if body.expected:
        _require_unchanged(session, frames, body.expected)
    jobs = [job for frame in frames for job in routes.apply_change(session, frame, body, caller)]
    return changes.Reply(status=200, body=FramesChanged(frames=len(frames), read_again=len(jobs)), jobs=jobs)


def _require_unchanged(session: Session, frames: Sequence[FrameRow], expected: ExpectedFrame) -> None:
    said = expected.model_dump(exclude_none=True)
    for frame in frames:
        found: dict[str, Any] = {
            "role": frame.role,
            "scene": frame.scene or "",
            "left_out": frame.left_out is not None,
            "withdrawn": frame.withdrawn_at is not None,
        }
        if changed := {name: found[name] for name, value in said.items() if found[name] != value}:
            who = audit.name_last_actor(session, frame.id)
            now = ", ".join(_STATES[name](value) for name, value in changed.items())
            by = f" by {who}" if who else ""
            detail = f"{frame.filename} was changed{by} meanwhile: {now}. Look at it again."
            raise problems.Problem(interface.CHANGED_MEANWHILE, detail)


_STATES: Final[dict[str, Callable[[Any], str]]] = {
    "role": lambda role: f"its role is {role}",
    "scene": lambda scene: f"its scene is {scene}" if scene else "it has no scene",
    "left_out": lambda out: "it is left out" if out else "it is used again",
    "withdrawn": lambda out: "it is withdrawn" if out else "it is restored",
}


def _read_since(since: str | None, reviewed: CampaignReview) -> int | None:
    """Return the revision after which the changes are asked for; None where all frames may have changed."""
    revision, _, code = (since or "").partition("-")
    fresh = reviewed.kept_revision == reviewed.revision and reviewed.kept_by == hash_code() == code
    known = int(revision) if fresh and revision.isdecimal() else -1
    return known if reviewed.whole_revision <= known <= reviewed.revision else None


def _is_kept(context: Context, seen: CampaignReview) -> bool:
    """Return whether the verdicts that were answered are kept: later ones are then told apart from them."""
    kept = select(CampaignReview.kept_revision).where(CampaignReview.campaign_id == seen.campaign_id)
    with context.database.reading() as session:
        return session.scalars(kept).one() >= seen.revision


def _shape(frames: list[dict[str, Any]], verdicts: Mapping[str, Verdict]) -> GridColumns:
    for frame in frames:
        verdict = verdicts.get(frame["id"])
        reason = verdict.reasons[0] if verdict and verdict.reasons else None
        frame["outcome"] = verdict.outcome if verdict else "pending"
        frame["code"], frame["detail"] = (str(reason.code), reason.detail) if reason else (None, None)
        frame["left_out"] = (frame["left_out"] or {}).get("reason")
        frame["instant"] = models.rfc3339(frame["instant"]) if frame["instant"] else None
        frame["withdrawn"] = frame["withdrawn_at"] is not None
        frame["thumbnail"] = pictures.tag_of(frame["preview_sha256"], frame["region_id"])
    return GridColumns(**{name: [frame[name] for frame in frames] for name in GridColumns.model_fields})
