"""Effect of publishing a version, and the decisions until now."""

from typing import Annotated

from fastapi import Query, Response

from service.auth import Reader
from service.certificate import build_issued, gather
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.routes import problems
from service.schemas.base import Answer, Instant, Method
from service.schemas.calibrations import NewPublication
from service.schemas.history import ImpactAnswer
from service.schemas.validity import LifetimeAnswer, ValidityAnswer
from store.impact import assess, find_in_force
from store.queries.calibrations import Decision, list_decisions, list_lifetimes
from store.queries.organisations import name_people
from store.tables import Calibration, Camera
from store.tables.base import utc_now


class DecisionAnswer(Answer, restates=Decision, without="calibration"):
    calibration_id: str
    method: str
    version: int
    by_name: str | None = None

    @classmethod
    def of(cls, row: Decision, names: dict[str, str]) -> "DecisionAnswer":
        return cls.restate(row, row.calibration, by_name=names.get(row.by), calibration_id=row.calibration.id)


class DecisionsAnswer(Answer):
    items: list[DecisionAnswer]


router = Router(prefix="/v1", tags=["calibrations"])


@router.get("/calibrations/{calibration_id}/impact", response_model=ImpactAnswer, responses=problems(404))
def get_impact(
    calibration_id: Id,
    caller: Reader,
    context: UsesContext,
    at: Annotated[Instant | None, Query(description="Compared with what is in force then; now.")] = None,
) -> Response:
    """Compare a version with the one in force: coefficients, flags, measurements."""
    instant = at or utc_now()
    with context.database.reading() as session:
        calibration = owned(session, Calibration, calibration_id, caller)
        against, own = find_in_force(session, calibration, instant), f"version {calibration.version}"
        if against is None:
            said = f"Nothing is in force then: {own} would be the first for that time."
        elif against.calibration.id == calibration.id:
            said = f"{own.capitalize()} itself is in force then: publishing it changes nothing there."
        else:
            said = (
                f"Version {against.calibration.version} is in force then: "
                f"publishing {own} would take its place."
            )
        found = assess(session, calibration, against) if against else None
        record = gather(context, session, calibration)
        publication = NewPublication(valid_from=instant, reason=said)
        answer = ImpactAnswer.of(calibration, instant, said, found)
        answer.warnings = build_issued(session, record, caller, publication).gaps
    return answer.respond()


@router.get("/cameras/{camera_id}/decisions", response_model=DecisionsAnswer, responses=problems(404))
def list_camera_decisions(camera_id: Id, caller: Reader, context: UsesContext) -> Response:
    """List who made, published and revoked which version, when and why; newest first, all at once."""
    with context.database.reading() as session:
        owned(session, Camera, camera_id, caller)
        found = list_decisions(session, camera_id)
        names = name_people(session, caller.organisation_id)
    return DecisionsAnswer(items=[DecisionAnswer.of(row, names) for row in found]).respond()


@router.get("/cameras/{camera_id}/validity", response_model=ValidityAnswer, responses=problems(404))
def get_camera_validity(
    camera_id: Id,
    caller: Reader,
    context: UsesContext,
    method: Annotated[Method, Query()],
    known_at: Annotated[Instant | None, Query(description="As known at this time; now.")] = None,
) -> Response:
    """List the published versions of a method with the times for which they were in force.

    `in_force` holds as known at `known_at`; `revoked_from` is what a version held until it was revoked. All
    at once, newest first.
    """
    known = known_at or utc_now()
    with context.database.reading() as session:
        owned(session, Camera, camera_id, caller)
        found = list_lifetimes(session, camera_id, method, known)
        names = name_people(session, caller.organisation_id)
    return ValidityAnswer(known_at=known, items=[LifetimeAnswer.of(row, names) for row in found]).respond()
