"""Coefficients in force, and the flat rows that dashboards draw."""

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated

from fastapi import Query, Request, Response
from pydantic import Field
from pydantic_core import from_json
from starlette.concurrency import run_in_threadpool

from radiometry.findings import interface
from service.calibrations.schemas import CoefficientsAnswer
from service.coefficients import formats, ready
from service.coefficients.series import SeriesAnswer, SeriesQuery, SeriesRow, answer_series, sends_series
from service.http import answers, lookup, operations
from service.http.auth import Caller, Reader
from service.http.context import Context, UsesContext
from service.http.models import Instant
from service.http.problems import Problem
from store.ready import lookups, rows
from store.ready.series import CoefficientSeries
from store.tables import Camera
from store.tables.base import utc_now

router = operations.Router(prefix="/v1", tags=["coefficients"])
ready_router = operations.Router(prefix="/v1", tags=["coefficients"], route_class=ready.AnswersReady)


@ready_router.get(
    "/cameras/{camera_id}/coefficients",
    response_model=CoefficientsAnswer,
    responses={**answers.UNCHANGED, **answers.problems(404)},
)
async def get_coefficients(
    camera_id: lookup.Id,
    wanted: Annotated[ready.Wanted, Query()],
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
    held: tuple[lookups.Held, ...] = ()
    if lookup.is_id(camera_id):
        held = await lookups.find_ready(
            context.database,
            organisation_id=caller.organisation_id,
            camera_id=camera_id,
            method=wanted.method,
            at=at,
            known_at=wanted.known_at,
        )
    answer = ready.answer_held(request, wanted, held)
    if answer is None:
        await run_in_threadpool(_require_camera, context, caller, camera_id)
        raise Problem(interface.NO_CALIBRATION_IN_FORCE, _explain_none(wanted, at, held))
    return answer


def _require_camera(context: Context, caller: Caller, camera_id: str) -> None:
    with context.database.reading() as session:
        lookup.owned(session, Camera, camera_id, caller)


class CoefficientSeriesQuery(SeriesQuery):
    start: Instant | None = Field(default=None, alias="from", description="In force at this time or later.")
    end: Instant | None = Field(default=None, alias="to", description="In force before this time.")


_COLUMNS = formats.describe_columns(SeriesRow)


@router.get(
    "/series/coefficients", response_model=SeriesAnswer, responses={**sends_series(), **answers.problems(404)}
)
def get_coefficient_series(
    query: Annotated[CoefficientSeriesQuery, Query()], request: Request, caller: Reader, context: UsesContext
) -> Response:
    """Every published coefficient with its validity: flat, in one answer, for a panel or a spreadsheet.

    The rows are ordered by camera, `valid_from` and method. An answer has at most `limit` rows, 200,000
    without it; if more follow, `next` and the header `Link` (`rel="next"`) are their address.
    """
    return answer_series(request, context, caller, CoefficientSeries, query, _COLUMNS)


def _explain_none(wanted: ready.Wanted, at: datetime, found: Sequence[lookups.Held]) -> str:
    if not found:
        return f"No {wanted.method} calibration of this camera is in force at {rows.show_instant(at)}."
    versions = ", ".join(str(held.version) for held in found)
    isos = sorted({item["iso"] for held in found for item in from_json(held.items) if item.get("iso")})
    return (
        f"Version {versions} is in force at {rows.show_instant(at)}, but has no such coefficient. "
        f"It was calibrated for ISO {', '.join(f'{iso:g}' for iso in isos)}."
    )
