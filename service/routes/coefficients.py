"""What is in force, and the flat rows that dashboards draw."""

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import JSONResponse
from pydantic_core import from_json
from sqlalchemy import RowMapping

from radiometry.findings import interface
from service.auth import Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.problems import Problem
from service.ready import ReadyRoute, Wanted, answer_held
from service.routes import UNCHANGED, problems
from service.schemas.base import Instant, Method, Text, rfc3339
from service.schemas.calibrations import CoefficientsAnswer
from service.schemas.series import SeriesAnswer, SeriesRow
from service.tabular import write_csv
from store.columns import utc_now
from store.queries.calibrations import series
from store.ready.lookups import Held, find_ready
from store.ready.publications import show_instant
from store.tables import Camera

router = APIRouter(prefix="/v1", tags=["coefficients"])
ready_router = APIRouter(prefix="/v1", tags=["coefficients"], route_class=ReadyRoute)


@ready_router.get(
    "/cameras/{camera_id}/coefficients",
    response_model=CoefficientsAnswer,
    responses={**UNCHANGED, **problems(404)},
)
def get_coefficients(
    camera_id: Id,
    wanted: Annotated[Wanted, Query()],
    request: Request,
    caller: Reader,
    context: UsesContext,
) -> Response:
    """The coefficients in force at a time, as known at a time; both default to now. None is a 404.

    With `f_number`, a coefficient that was calibrated at that f-number is the one there. At another f-number
    it is the general one, with the uncertainty that it has there and the flag `f_number_not_calibrated`.
    Without `f_number`, a coefficient that has a general value is answered with it alone. The `ETag` changes
    with what is in force: with `If-None-Match`, the answer is a 304 without a body until then.
    """
    at = wanted.at or utc_now()
    with context.database.reading() as session:
        owned(session, Camera, camera_id, caller)
        held = find_ready(session, camera_id=camera_id, method=wanted.method, at=at, known_at=wanted.known_at)
    answer = answer_held(request, wanted, held)
    if answer is None:
        raise Problem(interface.NO_CALIBRATION_IN_FORCE, _explain_none(wanted, at, held))
    return answer


@router.get(
    "/series/coefficients",
    response_model=SeriesAnswer,
    responses={
        200: {"content": {"text/csv": {"schema": {"type": "string"}}}},
        **problems(404),
    },
)
def get_coefficient_series(
    caller: Reader,
    context: UsesContext,
    camera_id: Annotated[Text | None, Query()] = None,
    method: Annotated[Method | None, Query()] = None,
    start: Annotated[Instant | None, Query(alias="from")] = None,
    end: Annotated[Instant | None, Query(alias="to")] = None,
    format: Annotated[Literal["json", "csv"], Query()] = "json",  # noqa: A002  the contract's name
) -> Response:
    """Every published coefficient with its validity: flat, in one answer, for a panel or a spreadsheet."""
    with context.database.reading() as session:
        if camera_id is not None:
            owned(session, Camera, camera_id, caller)
        found = series(
            session, caller.organisation_id, camera_id=camera_id, method=method, start=start, end=end
        )
        rows = [_flatten(row) for row in found]
    if format == "csv":
        return Response(write_csv(rows, list(SeriesRow.model_fields)), media_type="text/csv")
    return JSONResponse({"rows": rows})


def _explain_none(wanted: Wanted, at: datetime, found: Sequence[Held]) -> str:
    if not found:
        return f"No {wanted.method} calibration of this camera is in force at {show_instant(at)}."
    versions = ", ".join(str(held.version) for held in found)
    isos = sorted({item["iso"] for held in found for item in from_json(held.items) if item.get("iso")})
    return (
        f"Version {versions} is in force at {show_instant(at)}, but has no such coefficient. "
        f"It was calibrated for ISO {', '.join(f'{iso:g}' for iso in isos)}."
    )


def _flatten(row: RowMapping) -> dict[str, Any]:
    """As SeriesRow says, without its checks: for a hundred thousand rows they cost more than all the rest."""
    flat = {name: value for name, value in row.items() if value is not None}
    flat["flags"] = " ".join(flat["flags"])
    for name in ("valid_from", "valid_to"):
        if name in flat:
            flat[name] = rfc3339(flat[name])
    return flat
