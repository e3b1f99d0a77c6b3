"""Effect of publishing a version, and the decisions until now."""

from typing import Annotated, Any

from fastapi import Query, Response

from radiometry.fitting.comparison import Comparison
from service.calibrations import schemas
from service.documents.issuing import build_issued, gather
from service.http import auth, lookup, operations
from service.http.context import UsesContext
from service.http.models import Answer, Instant, Method, Quantity, maybe, told
from store.impact import CoefficientChange, Impact, Touched, assess, find_in_force
from store.measuring.comparison import Reference
from store.publications import InForce
from store.queries.calibrations import Decision, list_decisions, list_lifetimes
from store.queries.organisations import name_people
from store.tables import Calibration, Camera, CoefficientRow, utc_now


class VersionNamed(Answer):
    calibration_id: str
    version: int

    @classmethod
    def of(cls, row: Calibration) -> "VersionNamed":
        return cls(calibration_id=row.id, version=row.version)


class VersionInForce(VersionNamed):
    valid_from: Instant
    valid_to: Instant | None = None

    @classmethod
    def held(cls, held: InForce) -> "VersionInForce":
        return cls.restate(held.publication, held.calibration, calibration_id=held.calibration.id)


class TouchedMeasurement(Answer):
    """A measurement that was made with the version."""

    measurement_id: str
    frame_id: str
    filename: str
    taken_at: str | None = maybe("As the frame says it.")
    iso: float | None = None
    successor: VersionNamed | None = maybe("In force when the frame was taken. Absent where none is.")

    @classmethod
    def of(cls, row: Touched) -> "TouchedMeasurement":
        successor = VersionNamed.of(row.successor) if row.successor else None
        said = {"measurement_id": row.measurement.id, "frame_id": row.frame.id}
        return cls.restate(row.frame.header or {}, row.frame, successor=successor, **said)


class RevocationAnswer(schemas.CalibrationAnswer):
    """The version as it stands now, and the measurements that were made with it."""

    measurements: list[TouchedMeasurement]

    @classmethod
    def revoked(cls, answer: schemas.CalibrationAnswer, touched: list[Touched]) -> "RevocationAnswer":
        return cls(**dict(answer), measurements=[TouchedMeasurement.of(row) for row in touched])


class CoefficientChanged(
    Answer,
    restates=(CoefficientRow, Comparison),
    fields="name iso f_number band channel change in_standard_uncertainties",
):
    model: str | None = maybe("The new one's; of sharpness it names the position.")
    old: Quantity
    new: Quantity
    difference: Quantity | None = maybe("new - old. Absent where the units differ.")

    @classmethod
    def of(cls, row: CoefficientChange) -> "CoefficientChanged":
        return cls.restate(row, row.new, row.comparison)


class FlagAt(Answer):
    flag: str
    where: str = told('"" for the whole.')


class ImpactAnswer(Answer):
    calibration_id: str
    version: int
    at: Instant
    said: str
    against: VersionInForce | None = maybe("What is in force at that time. Absent where nothing is.")
    meter_calibration: Reference | None = maybe(
        "`common`: both versions use the same meter certificates, whose error cancels in the "
        "comparison and is left out of its uncertainty; `separate`: they do not, and it counts in both; "
        "`unknown`: a reading has no certificate, and nothing is left out. Of reflectance the same of the "
        "panel: one panel of one day, another, or one that is not registered."
    )
    coefficients: list[CoefficientChanged]
    isos_gained: list[float]
    isos_lost: list[float]
    flags_gained: list[FlagAt]
    flags_lost: list[FlagAt]
    measurements: list[TouchedMeasurement] = told(
        "Made with the version in force, which this one would replace."
    )
    warnings: list[schemas.Gap] = told(
        "What its certificate would lack, published with your key.", default=[]
    )

    @classmethod
    def of(cls, row: Calibration, at: Any, said: str, impact: Impact | None) -> "ImpactAnswer":  # noqa: ANN401
        named = {"calibration_id": row.id, "version": row.version, "at": at, "said": said}
        if impact is None:
            lists = ("coefficients", "isos_gained", "isos_lost", "flags_gained", "flags_lost", "measurements")
            return cls.restate(named, {name: [] for name in lists})
        return cls.restate(
            named,
            impact,
            against=VersionInForce.held(impact.against),
            coefficients=[CoefficientChanged.of(each) for each in impact.coefficients],
            flags_gained=[FlagAt(flag=flag, where=where) for flag, where in impact.flags_gained],
            flags_lost=[FlagAt(flag=flag, where=where) for flag, where in impact.flags_lost],
            measurements=[TouchedMeasurement.of(each) for each in impact.measurements],
        )


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


router = operations.Router(prefix="/v1", tags=["calibrations"])


@router.get("/calibrations/{calibration_id}/impact", response_model=ImpactAnswer)
def get_impact(
    calibration_id: lookup.Id,
    caller: auth.Reader,
    context: UsesContext,
    at: Annotated[Instant | None, Query(description="Compared with what is in force then; now.")] = None,
) -> Response:
    """Compare a version with the one in force: coefficients, flags, measurements."""
    instant = at or utc_now()
    with context.database.reading() as session:
        calibration = lookup.owned(session, Calibration, calibration_id, caller)
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
        publication = schemas.NewPublication(valid_from=instant, reason=said)
        answer = ImpactAnswer.of(calibration, instant, said, found)
        answer.warnings = build_issued(session, record, caller, publication).gaps
    return answer.respond()


@router.get("/cameras/{camera_id}/decisions", response_model=DecisionsAnswer)
def list_camera_decisions(camera_id: lookup.Id, caller: auth.Reader, context: UsesContext) -> Response:
    """List who made, published and revoked which version, when and why; newest first, all at once."""
    with context.database.reading() as session:
        lookup.owned(session, Camera, camera_id, caller)
        found = list_decisions(session, camera_id)
        names = name_people(session, caller.organisation_id)
    return DecisionsAnswer(items=[DecisionAnswer.of(row, names) for row in found]).respond()


@router.get("/cameras/{camera_id}/validity", response_model=schemas.ValidityAnswer)
def get_camera_validity(
    camera_id: lookup.Id,
    caller: auth.Reader,
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
        lookup.owned(session, Camera, camera_id, caller)
        found = list_lifetimes(session, camera_id, method, known)
        names = name_people(session, caller.organisation_id)
    return schemas.ValidityAnswer(
        known_at=known, items=[schemas.LifetimeAnswer.of(row, names) for row in found]
    ).respond()
