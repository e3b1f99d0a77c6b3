"""Meter readings: one, many, or a spreadsheet's CSV."""

import csv
import io
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request, Response
from pydantic import Field, TypeAdapter, ValidationError
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.auth import Calibrator, Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.paging import Cursor, Limit, Page, page
from service.problems import HttpCode, Problem, invalid
from service.routes import problems
from service.schemas.campaigns import NewReading, ReadingAnswer, ReadingsAnswer
from service.writing import Reply, Writes
from store.columns import utc_now
from store.queries.campaigns import add_readings
from store.tables import Campaign, Meter, Reading

router = APIRouter(prefix="/v1", tags=["readings"])

# 1 foot-lambert = 1/pi cd/ft2, 1 footcandle = 1 lm/ft2, with 1 ft = 0.3048 m
_SI = {"cd/m2": 1.0, "lx": 1.0, "fL": 3.4262590996353905, "fc": 10.763910416709722}
_COLUMNS = ("scene", "quantity", "value", "unit", "meter_id", "taken_at")
_MAX_BYTES = 4 << 20
_FORM: TypeAdapter[NewReading | list[NewReading]] = TypeAdapter(
    Annotated[NewReading | Annotated[list[NewReading], Field(min_length=1, max_length=10_000)], Field()]
)

_REQUEST = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {
                "schema": {
                    "oneOf": [
                        {"$ref": "#/components/schemas/NewReading"},
                        {
                            "type": "array",
                            "items": {"$ref": "#/components/schemas/NewReading"},
                            "minItems": 1,
                            "maxItems": 10_000,
                        },
                    ]
                }
            },
            "text/csv": {
                "schema": {"type": "string"},
                "example": "scene,quantity,value,unit\nlevel-1,luminance,54.4,cd/m2\n",
            },
        },
    }
}


async def _body(request: Request) -> list[NewReading] | NewReading:
    """Read JSON or CSV, by the content type; each bad field or row is named."""
    data = await request.body()
    if len(data) > _MAX_BYTES:
        raise Problem(413, HttpCode.UPLOAD_TOO_LARGE, "Readings may take 4 MiB at most in one request.")
    if request.headers.get("content-type", "").split(";")[0].strip().lower() == "text/csv":
        return _read_csv(data)
    try:
        return _FORM.validate_json(data)
    except ValidationError as error:
        raise invalid(error.errors(include_input=False, include_url=False, include_context=False)) from error


@router.post(
    "/campaigns/{campaign_id}/readings",
    status_code=201,
    response_model=ReadingAnswer | ReadingsAnswer,
    responses=problems(404, 413),
    openapi_extra=_REQUEST,
)
def add_campaign_readings(
    campaign_id: Id,
    body: Annotated[list[NewReading] | NewReading, Depends(_body)],
    caller: Calibrator,
    writing: Writes,
) -> Response:
    """Record what the meter said of a scene; values are kept as entered and in SI."""
    forms = [body] if isinstance(body, NewReading) else body

    def change(session: Session) -> Reply:
        campaign = owned(session, Campaign, campaign_id, caller)
        for meter_id in {form.meter_id for form in forms if form.meter_id}:
            owned(session, Meter, meter_id, caller)
        rows = add_readings(session, campaign, [_columns(form) for form in forms])
        answers = [ReadingAnswer.of(row) for row in rows]
        one = isinstance(body, NewReading)
        return Reply(status=201, body=answers[0] if one else ReadingsAnswer(items=answers))

    return writing.run(caller, change)


@router.get("/campaigns/{campaign_id}/readings", response_model=Page[ReadingAnswer], responses=problems(404))
def list_readings(
    campaign_id: Id,
    request: Request,
    caller: Reader,
    context: UsesContext,
    limit: Limit = 100,
    cursor: Cursor = None,
) -> Any:  # noqa: ANN401
    """A campaign's readings, withdrawn ones too, oldest first."""
    rows = select(Reading).where(Reading.campaign_id == campaign_id)
    with context.database.reading() as session:
        owned(session, Campaign, campaign_id, caller)
        return page(
            session,
            request,
            rows,
            by=Reading.id,
            limit=limit,
            cursor=cursor,
            shape=lambda found: [ReadingAnswer.of(row) for row in found],
        )


@router.delete("/readings/{reading_id}", response_model=ReadingAnswer, responses=problems(404))
def withdraw_reading(reading_id: Id, caller: Calibrator, writing: Writes) -> Response:
    """Withdraw a mistyped reading: no fit uses it any more, the record keeps it."""

    def change(session: Session) -> Reply:
        reading = owned(session, Reading, reading_id, caller)
        reading.withdrawn_at = reading.withdrawn_at or utc_now()
        session.flush()
        return Reply(status=200, body=ReadingAnswer.of(reading))

    return writing.run(caller, change)


def _columns(form: NewReading) -> dict[str, Any]:
    return {
        "scene": form.scene,
        "quantity": form.quantity,
        "value": form.value * _SI[form.unit],
        "entered_value": form.value,
        "entered_unit": form.unit,
        "meter_id": form.meter_id,
        "taken_at": form.taken_at,
    }


def _read_csv(data: bytes) -> list[NewReading]:
    """Read a spreadsheet's CSV: comma, semicolon or tab; each bad row is named with its line."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise Problem(400, HttpCode.BAD_REQUEST, "The CSV is not UTF-8; save it as UTF-8.") from error
    first = text.partition("\n")[0]
    separator = max(",;\t", key=first.count)
    reader = csv.DictReader(io.StringIO(text), delimiter=separator)
    columns = [name.strip() for name in reader.fieldnames or []]
    if not {"scene", "quantity", "value", "unit"} <= set(columns) <= set(_COLUMNS):
        raise Problem(
            422,
            HttpCode.VALIDATION_FAILED,
            f"The first line must name the columns {', '.join(_COLUMNS)} (the last two may be absent); "
            f"it names {', '.join(columns) or 'nothing'}.",
        )
    reader.fieldnames = columns
    return _read_rows(reader, decimal_comma=separator != ",")


def _read_rows(reader: "csv.DictReader[str]", *, decimal_comma: bool) -> list[NewReading]:
    forms: list[NewReading] = []
    errors: list[dict[str, Any]] = []
    for row in reader:
        cells = {name: cell.strip() for name, cell in row.items() if name and cell and cell.strip()}
        if decimal_comma and "value" in cells:
            cells["value"] = cells["value"].replace(",", ".")
        try:
            forms.append(NewReading.model_validate(cells))
        except ValidationError as error:
            found = error.errors(include_input=False, include_url=False, include_context=False)
            errors += [{**e, "loc": (f"line {reader.line_num}", *e["loc"])} for e in found]
    if errors or not forms:
        raise invalid(errors or [{"loc": ("csv",), "msg": "there are no rows below the first line"}])
    return forms
