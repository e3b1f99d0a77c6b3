"""What is in force, and the flat rows that dashboards draw."""

from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Response
from fastapi.responses import JSONResponse
from sqlalchemy import RowMapping

from radiometry.findings import interface
from service.auth import Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.problems import Problem
from service.routes import problems
from service.schemas.base import BandName, Form, Instant, Method, PositiveText, Text, rfc3339
from service.schemas.calibrations import (
    Coefficient,
    CoefficientInForce,
    CoefficientsAnswer,
)
from service.schemas.series import SeriesAnswer, SeriesRow
from service.tabular import write_csv
from store.columns import utc_now
from store.publications import InForce, in_force, show_instant
from store.queries.calibrations import coefficients_of, series
from store.tables import Camera, CoefficientRow

router = APIRouter(prefix="/v1", tags=["coefficients"])


class Wanted(Form):
    """Which coefficients, and as of when."""

    method: Method
    name: Text | None = None
    iso: PositiveText | None = None
    f_number: PositiveText | None = None
    band: BandName | None = None
    at: Instant | None = None
    known_at: Instant | None = None

    def matches(self, row: CoefficientRow) -> bool:
        """Whether a row has every property that was asked for."""
        asked = ("name", "iso", "f_number", "band")
        return all(getattr(self, n) is None or getattr(row, n) == getattr(self, n) for n in asked)


@router.get("/cameras/{camera_id}/coefficients", response_model=CoefficientsAnswer, responses=problems(404))
def get_coefficients(
    camera_id: Id, wanted: Annotated[Wanted, Query()], caller: Reader, context: UsesContext
) -> Response:
    """The coefficients in force at a time, as known at a time; both default to now. None is a 404."""
    at = wanted.at or utc_now()
    with context.database.reading() as session:
        owned(session, Camera, camera_id, caller)
        found = in_force(session, camera_id=camera_id, method=wanted.method, at=at, known_at=wanted.known_at)
        rows = coefficients_of(session, [held.calibration.id for held in found])
    items = [
        _in_force(row, held) for held in found for row in rows[held.calibration.id] if wanted.matches(row)
    ]
    if not items:
        raise Problem(interface.NO_CALIBRATION_IN_FORCE, _explain_none(wanted, at, found, rows))
    return CoefficientsAnswer(items=items).respond()


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


def _in_force(row: CoefficientRow, held: InForce) -> CoefficientInForce:
    publication = held.publication
    known_from = show_instant(publication.known_from)
    return CoefficientInForce(
        **Coefficient.restate(row).model_dump(),
        calibration_id=held.calibration.id,
        version=held.calibration.version,
        valid_from=publication.valid_from,
        valid_to=publication.valid_to,
        why=f"{held.sentence()}, known since {known_from}: {publication.reason}",
    )


def _explain_none(
    wanted: Wanted, at: datetime, found: list[InForce], rows: dict[str, list[CoefficientRow]]
) -> str:
    if not found:
        return f"No {wanted.method} calibration of this camera is in force at {show_instant(at)}."
    versions = ", ".join(str(held.calibration.version) for held in found)
    isos = sorted({row.iso for held in found for row in rows[held.calibration.id] if row.iso})
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
