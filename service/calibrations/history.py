"""Effect of publishing a version, the decisions until now, and recalls of all versions with one cause."""

from typing import Annotated, Any, Literal

from fastapi import Query, Response
from pydantic import AliasChoices, Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.fitting.comparison import Comparison
from service.calibrations import schemas
from service.calibrations.schemas import CalibrationAnswer, Gap, ValidityAnswer
from service.documents.issuing import build_issued, gather
from service.http import answers, auth, changes, lookup, operations
from service.http.context import UsesContext
from service.http.models import Answer, Form, Instant, Method, Quantity, Reason, Text, maybe, told
from service.http.paging import Page, UsesPaging
from service.roads.schemas import RoadResultSummary
from store import impact as recalls
from store.impact import Condemned, Impact, Touched, assess, find_in_force
from store.measuring.comparison import Reference
from store.queries.calibrations import Decision, VersionState, VersionStatus, list_decisions, list_lifetimes
from store.queries.organisations import name_people
from store.tables import Calibration, Camera, CoefficientRow, Meter, Recall, Road, RoadResult, utc_now


class VersionNamed(Answer):
    calibration_id: str = Field(validation_alias=AliasChoices("calibration_id", "id"))
    version: int


class VersionInForce(VersionNamed):
    valid_from: Instant
    valid_to: Instant | None = None


class TouchedMeasurement(Answer):
    """A measurement that was made with the version, and what its successor would make of it."""

    measurement_id: str
    frame_id: str
    filename: str
    taken_at: str | None = maybe("As the frame says it.")
    iso: float | None = None
    successor: VersionNamed | None = maybe("In force when the frame was taken. Absent where none is.")
    change: Quantity | None = maybe("Of the luminance, L_new / L_old - 1, or of the reflectance; in %.")
    basis: Literal["signal", "k_ratio"] | None = maybe(
        "`signal`: both applied to the measured signal; `k_ratio`: K_old / K_new - 1."
    )
    why: str | None = maybe("Why there is no change to tell.")

    @classmethod
    def of(cls, row: Touched) -> "TouchedMeasurement":
        change = row.change if row.change and row.change.change else None
        said = {"measurement_id": row.measurement.id, "frame_id": row.frame.id, "why": row.why}
        return cls.restate(change, row.frame.header or {}, row.frame, successor=row.successor, **said)


class TouchedRoad(RoadResultSummary):
    """An evaluation of a road with frames that were measured with the version, or corrected by it."""

    road_id: str
    name: str

    @classmethod
    def of(cls, touched: tuple[RoadResult, Road]) -> "TouchedRoad":
        row, road = touched
        link = f"/v1/roads/{road.id}/results/{row.number}"
        return cls.restate(row, name=road.name, verdict=row.result["verdict"], link=link)


class RevocationAnswer(CalibrationAnswer):
    """The version as it stands now, and the measurements and roads that rest on it."""

    measurements: list[TouchedMeasurement]
    roads: list[TouchedRoad]

    @classmethod
    def revoked(cls, session: Session, row: Calibration, answer: CalibrationAnswer) -> "RevocationAnswer":
        touched = [TouchedMeasurement.of(each) for each in recalls.list_touched(session, row)]
        roads = [TouchedRoad.of(each) for each in recalls.list_roads(session, row)]
        return cls(**dict(answer), measurements=touched, roads=roads)


class CoefficientChanged(
    Answer,
    restates=(CoefficientRow, Comparison),
    fields="name iso f_number band channel change in_standard_uncertainties",
):
    model: str | None = maybe("The new one's; of sharpness it names the position.")
    old: Quantity
    new: Quantity
    difference: Quantity | None = maybe("new - old. Absent where the units differ.")


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
        "Made with the version in force; what this one would make of each."
    )
    warnings: list[Gap] = told("What its certificate would lack, published with your key.", default=[])

    @classmethod
    def of(cls, row: Calibration, at: Any, said: str, impact: Impact | None) -> "ImpactAnswer":  # noqa: ANN401
        named = {"calibration_id": row.id, "version": row.version, "at": at, "said": said}
        if impact is None:
            lists = ("coefficients", "isos_gained", "isos_lost", "flags_gained", "flags_lost", "measurements")
            return cls.restate(named, {name: [] for name in lists})
        return cls.restate(
            named,
            impact,
            against=VersionInForce.restate(impact.against.publication, impact.against.calibration),
            coefficients=[
                CoefficientChanged.restate(each, each.new, each.comparison) for each in impact.coefficients
            ],
            flags_gained=[FlagAt(flag=flag, where=where) for flag, where in impact.flags_gained],
            flags_lost=[FlagAt(flag=flag, where=where) for flag, where in impact.flags_lost],
            measurements=[TouchedMeasurement.of(each) for each in impact.measurements],
        )


class NewCause(Form, one_of="meter_id meter_certificate_number software recorder"):
    """The cause of a recall: exactly one of these fields."""

    meter_id: Text | None = None
    meter_certificate_number: Text | None = maybe("The certificate number when a version was made.")
    software: Text | None = maybe("The fit code version, `software.stilb` of a version.")
    recorder: Text | None = maybe("Recorder of the campaign, now or before.")


class NewPurge(Form):
    cause: NewCause
    reason: Reason


class CondemnedVersion(
    Answer, restates=(Calibration, VersionStatus), fields="camera_id method version valid_from valid_to"
):
    calibration_id: str
    camera: str = told("Make, model and serial number.")
    state: VersionState
    in_force: bool = told("Whether it is in force for any time, as known now: `valid_from` to `valid_to`.")
    measurements: list[TouchedMeasurement] = told(
        "Made with it. The successor of each is a version that the recall does not revoke."
    )
    roads: list[TouchedRoad]

    @classmethod
    def of(cls, row: Condemned) -> "CondemnedVersion":
        camera = row.camera
        return cls.restate(
            row.calibration,
            row.status,
            calibration_id=row.calibration.id,
            camera=f"{camera.make} {camera.model} {camera.serial}",
            in_force=row.status.valid_from is not None,
            measurements=[TouchedMeasurement.of(each) for each in row.measurements],
            roads=[TouchedRoad.of(each) for each in row.roads],
        )


class PurgeAnswer(
    Answer,
    restates=Recall,
    fields="id cause reason calibration_ids created_by created_at confirmed_by confirmed_at",
):
    state: Literal["proposed", "confirmed"]
    cause: dict[str, str]
    calibration_ids: list[str] = told("The versions under review, which confirming revokes.")
    versions: list[CondemnedVersion] | None = maybe("Their current status. Absent in a list.")

    @classmethod
    def of(cls, row: Recall, condemned: list[Condemned] | None = None) -> "PurgeAnswer":
        versions = None if condemned is None else [CondemnedVersion.of(each) for each in condemned]
        return cls.restate(row, state="confirmed" if row.confirmed_at else "proposed", versions=versions)


class DecisionAnswer(Answer, restates=Decision, without="calibration"):
    calibration_id: str
    method: str
    version: int
    by_name: str | None = None


class DecisionsAnswer(Answer):
    items: list[DecisionAnswer]


router = operations.Router(prefix="/v1", tags=["calibrations"])


@router.get("/calibrations/{calibration_id}/impact", response_model=ImpactAnswer)
def get_impact(
    calibration: lookup.Own[Calibration],
    caller: auth.Reader,
    context: UsesContext,
    session: Session,
    at: Annotated[Instant | None, Query(description="Compared with what is in force then; now.")] = None,
) -> Response:
    """Compare a version with the one in force: coefficients, flags, measurements."""
    instant = at or utc_now()
    against, own = find_in_force(session, calibration, instant), f"version {calibration.version}"
    if against is None:
        said = f"Nothing is in force then: {own} would be the first for that time."
    elif against.calibration.id == calibration.id:
        said = f"{own.capitalize()} itself is in force then: publishing it changes nothing there."
    else:
        said = (
            f"Version {against.calibration.version} is in force then: publishing {own} would take its place."
        )
    found = assess(session, calibration, against) if against else None
    record = gather(context, session, calibration)
    publication = schemas.NewPublication(valid_from=instant, reason=said)
    answer = ImpactAnswer.of(calibration, instant, said, found)
    answer.warnings = build_issued(session, record, caller, publication).gaps
    return answer.respond()


@router.get("/cameras/{camera_id}/decisions", response_model=DecisionsAnswer)
def list_camera_decisions(camera: lookup.Own[Camera], session: Session) -> Response:
    """List who made, published and revoked which version, when and why; newest first, all at once."""
    found = list_decisions(session, camera.id)
    names = name_people(session, camera.organisation_id)
    items = [
        DecisionAnswer.restate(
            row, row.calibration, by_name=names.get(row.by), calibration_id=row.calibration.id
        )
        for row in found
    ]
    return DecisionsAnswer(items=items).respond()


@router.get("/cameras/{camera_id}/validity", response_model=ValidityAnswer)
def get_camera_validity(
    camera: lookup.Own[Camera],
    session: Session,
    method: Method,
    known_at: Annotated[Instant | None, Query(description="As known at this time; now.")] = None,
) -> Response:
    """List the published versions of a method with the times for which they were in force.

    `in_force` holds as known at `known_at`; `revoked_from` is what a version held until it was revoked. All
    at once, newest first.
    """
    known = known_at or utc_now()
    found = list_lifetimes(session, camera.id, method, known)
    names = name_people(session, camera.organisation_id)
    return ValidityAnswer(
        known_at=known, items=[schemas.LifetimeAnswer.of(row, names) for row in found]
    ).respond()


recalls_router = operations.Router(prefix="/v1/recalls", tags=["recalls"])


@recalls_router.post("", status_code=201, response_model=PurgeAnswer, responses=answers.problems(404))
def propose_recall(body: NewPurge, caller: auth.Publisher, session: Session) -> changes.Reply:
    """Find every version made with a cause, for review. Nothing is revoked yet."""
    if body.cause.meter_id is not None:
        lookup.owned(session, Meter, body.cause.meter_id, caller)
    cause = body.cause.model_dump(exclude_none=True)
    recall = recalls.propose(session, caller.organisation_id, cause, reason=body.reason, by=caller.key_id)
    location = {"Location": f"/v1/recalls/{recall.id}"}
    return changes.Reply(status=201, body=_whole(session, recall), headers=location)


@recalls_router.get("", response_model=Page[PurgeAnswer])
def list_recalls(paging: UsesPaging, caller: auth.Reader, session: Session) -> Response:
    """List the recalls of your organisation, newest first."""
    return paging.send_own(session, caller, select(Recall), PurgeAnswer.of, newest_first=True)


@recalls_router.get("/{recall_id}", response_model=PurgeAnswer)
def get_recall(recall: lookup.Own[Recall], session: Session) -> Response:
    """Return a recall with the current status of its versions, and the measurements that they affect."""
    return _whole(session, recall).respond()


@recalls_router.post("/{recall_id}/confirm", response_model=PurgeAnswer, responses=answers.problems(409))
def confirm_recall(recall: lookup.Own[Recall], caller: auth.Publisher, session: Session) -> changes.Reply:
    """Revoke all versions of a recall in one step. Answers 409 if the cause now finds other versions."""
    recalls.confirm(session, recall, by=caller.key_id)
    return changes.Reply(status=200, body=_whole(session, recall))


def _whole(session: Session, recall: Recall) -> PurgeAnswer:
    return PurgeAnswer.of(recall, recalls.review(session, recall))
