"""Comparison of several cameras, and drift of one: nothing is stored."""

from collections import Counter
from collections.abc import Sequence
from typing import Annotated

from fastapi import Query, Response

from radiometry.fleet import drift, results
from radiometry.fleet.determinations import Determination, Source
from radiometry.fleet.verdict import judge_fleet
from service.calibrations import schemas
from service.http import answers, auth, lookup, operations, problems
from service.http.context import UsesContext
from service.http.models import Answer, Instant, Method, PositiveText, maybe
from service.tools.routes import stateless
from store.queries.fleet import list_determinations
from store.tables import Camera


class Determined(Answer, restates=(Determination, Source), fields="at value standard_uncertainty"):
    calibration_id: str


class ParameterDrift(schemas.Parameter, restates=drift.Drift, without="key"):
    determinations: list[Determined]

    @classmethod
    def of(cls, row: drift.Drift) -> "ParameterDrift":
        determined = [
            Determined.restate(each, each.source, calibration_id=each.source.version)
            for each in row.determinations
        ]
        return cls.restate(row, row.key, determinations=determined)


class DriftAnswer(Answer):
    camera_id: str
    method: Method
    recalibrate_by: Instant | None = maybe("The earliest of all parameters.")
    parameters: list[ParameterDrift]
    left_out: list[schemas.VersionLeftOut]


router = operations.Router(prefix="/v1", tags=["fleet"])


@router.post(
    "/fleet/verdict",
    response_model=schemas.FleetVerdictAnswer,
    responses=answers.problems(404),
    dependencies=stateless,
)
def judge_cameras(body: schemas.NewFleetVerdict, caller: auth.Reader, context: UsesContext) -> Response:
    """Judge whether one set of coefficients serves several cameras of a model, and what sharing it costs.

    Each campaign with a published version that was not revoked is a repeat of its camera's calibration.
    """
    lenses = {named.calibration_id: named.serial for named in body.lenses or []}
    with context.database.reading() as session:
        cameras = [lookup.owned(session, Camera, camera_id, caller) for camera_id in body.camera_ids]
        _refuse_other_models(cameras)
        found = list_determinations(session, cameras, body.method, lenses)
    _refuse_unknown_versions(lenses, found)
    _refuse_tolerance(body, found)
    verdict = judge_fleet(
        found, method=body.method, cameras=[camera.serial for camera in cameras], tolerance=body.tolerance
    )
    campaigns = {(row.source.camera, row.source.campaign) for row in found}
    repeats = Counter(serial for serial, _ in campaigns)
    return schemas.FleetVerdictAnswer.restate(
        verdict,
        method=body.method,
        verdict=verdict.outcome,
        cameras=[
            schemas.FleetCamera(camera_id=camera.id, serial=camera.serial, repeats=repeats[camera.serial])
            for camera in cameras
        ],
        parameters=[schemas.ParameterVerdictAnswer.of(row) for row in verdict.parameters],
        assumed=schemas.ASSUMED,
    ).respond()


@router.get("/cameras/{camera_id}/drift", response_model=DriftAnswer)
def get_drift(
    camera: lookup.Own[Camera],
    context: UsesContext,
    method: Method,
    tolerance: Annotated[
        PositiveText | None, Query(description="A share below 1 such as 0.04; of geometry px.")
    ] = None,
) -> Response:
    """How each coefficient of a camera changes from version to version, and when to calibrate it again."""
    if tolerance is not None and results.main_unit(method) == results.PERCENT:
        _refuse_no_share("query.tolerance", tolerance)
    with context.database.reading() as session:
        found = list_determinations(session, [camera], method, {})
    drifts, left_out = drift.judge_drift(found, method=method, tolerance=tolerance)
    return DriftAnswer.restate(
        camera_id=camera.id,
        method=method,
        recalibrate_by=min((row.recalibrate_by for row in drifts if row.recalibrate_by), default=None),
        parameters=[ParameterDrift.of(row) for row in drifts],
        left_out=left_out,
    ).respond()


def _refuse_other_models(cameras: Sequence[Camera]) -> None:
    models = sorted({f"{camera.make} {camera.model}" for camera in cameras})
    if len(models) > 1:
        raise problems.wrong(
            "body.camera_ids",
            f"these are cameras of different models ({', '.join(models)}), whose coefficients cannot be "
            "compared; ask for each model separately",
        )


def _refuse_unknown_versions(lenses: dict[str, str], found: list[Determination]) -> None:
    known = {row.source.version for row in found}
    for calibration_id in lenses:
        if calibration_id not in known:
            raise problems.wrong(
                "body.lenses",
                f"{calibration_id} is not a published version of these cameras and this method; leave it out",
            )


def _refuse_tolerance(body: schemas.NewFleetVerdict, found: list[Determination]) -> None:
    """A misspelt name would leave its parameter without a verdict; 4 for 4 % would accept everything."""
    if not isinstance(body.tolerance, dict):
        if results.main_unit(body.method) == results.PERCENT:
            _refuse_no_share("body.tolerance", body.tolerance)
        return
    keys = {row.key.name: row.key for row in found}
    for name, tolerance in body.tolerance.items():
        if name not in keys:
            known = ", ".join(sorted(keys)) or "none: nothing is published"
            raise problems.wrong(f"body.tolerance.{name}", f"there is no such parameter; there are {known}")
        if results.find_sensitivity(body.method, keys[name], {}, mean=1.0).kind == "relative":
            _refuse_no_share(f"body.tolerance.{name}", tolerance)


def _refuse_no_share(field: str, tolerance: float) -> None:
    if tolerance >= 1.0:
        raise problems.wrong(field, "must be a share less than 1, such as 0.04 for 4 %")
