"""What is in force, and the flat rows that dashboards draw."""

import math
from collections.abc import Iterator
from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Response
from fastapi.responses import JSONResponse
from sqlalchemy import RowMapping

from radiometry.findings import interface
from radiometry.methods import get_method
from radiometry.specification.application import SurfaceApplication
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
from store.applied import read_applied
from store.columns import utc_now
from store.publications import InForce, in_force, show_instant
from store.queries.calibrations import coefficients_of, series
from store.tables import Camera, CoefficientRow

_SAME_F_NUMBER_REL = 1e-3

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

    def choose(self, rows: list[CoefficientRow]) -> list[CoefficientRow]:
        """The rows with what was asked for.

        What is known both in general and at f-numbers is answered at the f-number asked for if it is known
        there, else in general.
        """
        asked = [n for n in ("name", "iso", "band") if getattr(self, n) is not None]
        rows = [row for row in rows if all(getattr(row, n) == getattr(self, n) for n in asked)]
        if self.f_number is None:
            general = {_key(row) for row in rows if row.f_number is None}
            return [row for row in rows if row.f_number is None or _key(row) not in general]
        at = {_key(row) for row in rows if self.meets(row)}
        return [row for row in rows if self.meets(row) or (row.f_number is None and _key(row) not in at)]

    def meets(self, row: CoefficientRow) -> bool:
        """Whether a row is of the f-number that was asked for, as it is written on the lens."""
        return None not in (row.f_number, self.f_number) and math.isclose(
            row.f_number or 0.0, self.f_number or 0.0, rel_tol=_SAME_F_NUMBER_REL
        )


def _key(row: CoefficientRow) -> tuple[object, ...]:
    return row.name, row.iso, row.band, row.channel, row.model


@router.get("/cameras/{camera_id}/coefficients", response_model=CoefficientsAnswer, responses=problems(404))
def get_coefficients(
    camera_id: Id, wanted: Annotated[Wanted, Query()], caller: Reader, context: UsesContext
) -> Response:
    """The coefficients in force at a time, as known at a time; both default to now. None is a 404.

    With `f_number`, a coefficient that was calibrated at that f-number is the one there. At another f-number
    it is the general one, with the uncertainty that it has there and the flag `f_number_not_calibrated`.
    Without `f_number`, a coefficient that has a general value is answered with it alone.
    """
    at = wanted.at or utc_now()
    with context.database.reading() as session:
        owned(session, Camera, camera_id, caller)
        found = in_force(session, camera_id=camera_id, method=wanted.method, at=at, known_at=wanted.known_at)
        rows = coefficients_of(session, [held.calibration.id for held in found])
    items = [item for held in found for item in _list_items(wanted, held, rows[held.calibration.id])]
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


def _list_items(wanted: Wanted, held: InForce, rows: list[CoefficientRow]) -> Iterator[CoefficientInForce]:
    application = get_method(wanted.method).application
    for row in wanted.choose(rows):
        item = _in_force(row, held)
        if (
            wanted.f_number is None
            or row.f_number is not None
            or not isinstance(application, SurfaceApplication)
            or row.name != get_method(wanted.method).coefficients[0].name
        ):
            yield item
            continue
        u = application.foresee(read_applied(held.calibration), iso=row.iso)
        changes = {
            "f_number": wanted.f_number,
            "standard_uncertainty": u,
            "flags": [*row.flags, application.unforeseen],
            "why": f"{item.why}; f/{wanted.f_number:g} was not calibrated: the value is that of the ISO "
            "value, and its uncertainty contains that of a nominal f-number",
        }
        yield item.model_copy(update=changes)


def _in_force(row: CoefficientRow, held: InForce) -> CoefficientInForce:
    publication = held.publication
    known_from = show_instant(publication.known_from)
    return CoefficientInForce(
        **Coefficient.restate(row).model_dump(),
        uncertainty_scope=get_method(held.calibration.method).find_scope(row.name, row.flags),
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
