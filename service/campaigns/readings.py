"""Meter readings: one, many, or a spreadsheet's CSV."""

from typing import Annotated, Any

from fastapi import Depends, Query, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.campaigns.schemas import MOST_READINGS, NewReading, ReadingAnswer, ReadingsAnswer
from service.http import auth, changes, lookup, models, operations, tables
from service.http.answers import problems
from service.http.paging import Page, UsesPaging
from service.http.problems import Problem, not_found, wrong
from store.queries import audit, campaigns
from store.tables import Campaign, Meter, Reading, utc_now

_COLUMNS = ("scene", "quantity", "value", "unit", "meter_id", "taken_at", "reason")
_KIND = tables.Kind(
    numbers=frozenset({"value"}), most=MOST_READINGS, rows_are="readings", known=_COLUMNS, needed=_COLUMNS[:4]
)

router = operations.Router(prefix="/v1", tags=["readings"])

# 1 foot-lambert = 1/pi cd/ft2, 1 footcandle = 1 lm/ft2, with 1 ft = 0.3048 m
_SI = {"cd/m2": 1.0, "lx": 1.0, "fL": 3.4262590996353905, "fc": 10.763910416709722}
MeterIds = Annotated[
    list[models.Text] | None,
    Query(max_length=3, description="A reading that names no meter takes the one of its quantity."),
]

_BODY = tables.OneOrMany(NewReading, _KIND)


@router.post(
    "/campaigns/{campaign_id}/readings",
    status_code=201,
    response_model=ReadingAnswer | ReadingsAnswer,
    responses=problems(409),
    openapi_extra=_BODY.stated,
)
def add_campaign_readings(
    campaign: lookup.Own[Campaign],
    body: Annotated[list[NewReading] | NewReading, Depends(_BODY)],
    caller: auth.Calibrator,
    session: Session,
    meter_id: MeterIds = None,
) -> changes.Reply:
    """Record what the meter said of a scene; values are kept as entered and in SI.

    A reading that `replaces` another one takes its place, and the other stays in the record, withdrawn.
    """
    forms = [body] if isinstance(body, NewReading) else body
    lookup.require_meters(session, [(form.meter_id, form.quantity) for form in forms], caller)
    meters = [lookup.owned(session, Meter, each, caller) for each in meter_id or ()]
    # a meter's kind is the quantity that it reads; which of two was read could not be known
    usual = {meter.kind: meter.id for meter in meters}
    if len(usual) < len(meters):
        raise wrong("query.meter_id", "names two meters of one kind; name the meter in each reading")
    now = utc_now()
    replaced = _find_replaced(session, campaign, forms, caller)
    columns = [{"meter_id": usual.get(form.quantity)} | _columns(form) for form in forms]
    rows = campaigns.add_readings(session, campaign, [{"created_at": now} | each for each in columns])
    for reading in replaced:
        reading.withdrawn_at = now
    answers = [ReadingAnswer.of(row) for row in rows]
    one = isinstance(body, NewReading)
    return changes.Reply(status=201, body=answers[0] if one else ReadingsAnswer(items=answers))


@router.get("/campaigns/{campaign_id}/readings", response_model=Page[ReadingAnswer])
def list_readings(campaign: lookup.Own[Campaign], paging: UsesPaging, session: Session) -> Response:
    """A campaign's readings, withdrawn ones too, oldest first."""
    rows = select(Reading).where(Reading.campaign_id == campaign.id)
    return paging.send(session, rows, lambda found: [ReadingAnswer.of(row) for row in found])


@router.delete("/readings/{reading_id}", response_model=ReadingAnswer)
def withdraw_reading(reading: lookup.Own[Reading], _caller: auth.Calibrator) -> changes.Reply:
    """Withdraw a mistyped reading: no fit uses it any more, the record keeps it."""
    reading.withdrawn_at = reading.withdrawn_at or utc_now()
    return changes.Reply(status=200, body=ReadingAnswer.of(reading))


@router.post("/readings/{reading_id}/restore", response_model=ReadingAnswer)
def restore_reading(reading: lookup.Own[Reading], _caller: auth.Calibrator) -> changes.Reply:
    """Undo the withdrawal of a reading."""
    reading.withdrawn_at = None
    return changes.Reply(status=200, body=ReadingAnswer.of(reading))


def _find_replaced(
    session: Session, campaign: Campaign, forms: list[NewReading], caller: auth.Caller
) -> list[Reading]:
    """Return the readings that are replaced; refuse what another user has changed since it was seen."""
    if all(form.replaces is None for form in forms):
        return []
    # two who type in one empty field at once: the second waits here, and finds the first one's reading
    lookup.owned(session, Campaign, campaign.id, caller, for_update=True)
    mine = select(Reading).where(Reading.standing(campaign.id)).order_by(Reading.id)
    standing = session.scalars(mine).all()
    places = {(each.scene, each.quantity): each for each in standing}
    replaced: list[Reading] = []
    for form in forms:
        seen = lookup.owned(session, Reading, form.replaces, caller) if form.replaces else None
        if seen is not None and seen.campaign_id != campaign.id:
            raise not_found("reading in this campaign")
        place = (form.scene, form.quantity)
        if seen is not None and seen.withdrawn_at is None and seen not in replaced:
            replaced.append(seen)
        elif seen is not None or (form.replaces == "" and place in places):
            later = (each for each in standing if seen and each.created_at == seen.withdrawn_at)
            found = next(later, places.get(place))
            who = audit.name_last_actor(session, (found or seen or campaign).id)
            by = f" by {who}" if who else ""
            state = f"it is now {found.entered_value:g} {found.entered_unit}" if found else "it is withdrawn"
            detail = f"The reading of {form.scene} was changed{by} meanwhile: {state}."
            raise Problem(interface.CHANGED_MEANWHILE, detail)
    return replaced


def _columns(form: NewReading) -> dict[str, Any]:
    said = form.model_dump(exclude={"value", "unit", "replaces"}, exclude_none=True)
    value = form.value * _SI[form.unit]
    return said | {"value": value, "entered_value": form.value, "entered_unit": form.unit}
