"""Coefficients in force, and the flat rows that dashboards draw."""

import hashlib
import json
import math
from collections.abc import Callable, Coroutine, Sequence
from datetime import datetime
from functools import lru_cache
from typing import Annotated, Any
from urllib.parse import parse_qsl

from fastapi import Query, Request, Response
from pydantic import ValidationError
from pydantic_core import from_json, to_json
from starlette.concurrency import run_in_threadpool

from radiometry.findings import interface
from radiometry.methods import get_method
from radiometry.specification.application import SurfaceApplication
from service.calibrations.schemas import CoefficientsAnswer
from service.coefficients import series
from service.coefficients.series import SeriesAnswer, SeriesQuery, SeriesRow, answer_series
from service.http import answers, counts, lookup, models, operations, problems
from service.http.auth import Caller, Reader
from service.http.context import Context, UsesContext
from store.queries.organisations import hash_secret
from store.ready import lookups, rows
from store.ready.series import CoefficientSeries
from store.tables import Camera, utc_now

_SAME_F_NUMBER_REL = 1e-3
_KNOWN = {
    "iso": "It was calibrated for ISO {}.",
    "band": "Its bands are {}.",
    "name": "Its coefficients are {}.",
}
_BEARER = "Bearer "


class Wanted(models.Form):
    """Which coefficients, and as of when."""

    method: models.Method
    name: models.Text | None = None
    iso: models.PositiveText | None = None
    f_number: models.PositiveText | None = None
    band: models.BandName | None = None
    at: models.Instant | None = None
    known_at: models.Instant | None = None

    @property
    def chosen(self) -> dict[str, Any]:
        names = ("name", "iso", "band", "f_number")
        return {name: value for name in names if (value := getattr(self, name)) is not None}


def answer_held(request: Request, wanted: Wanted, held: Sequence[lookups.Held]) -> Response | None:
    """Answer with the coefficients that were asked for, or 304; None where no version has such a one."""
    if not (chosen := wanted.chosen) and all(each.whole for each in held):
        content = b",".join(inner for each in held if (inner := each.items[1:-1]))
        body = b'{"items":[%b]}' % content if content else b""
    else:
        items = [item for each in held for item in _choose(wanted, chosen, each)]
        body = to_json({"items": items}) if items else b""
    if not body:
        return None
    tag = _hash(tuple(each.etag for each in held), tuple(chosen.items()))
    try:
        return Response(body, 200, answers.standing(request, tag), "application/json")
    except answers.Unchanged as unchanged:  # counted as any other
        return unchanged.respond()


@lru_cache(maxsize=4096)
def _hash(etags: tuple[str, ...], chosen: tuple[tuple[str, Any], ...]) -> str:
    return hashlib.sha256(json.dumps([etags, dict(chosen)]).encode()).hexdigest()[:32]


def _choose(wanted: Wanted, chosen: dict[str, Any], held: lookups.Held) -> list[dict[str, Any]]:
    """Return the items asked for: of one known in general and at f-numbers that at the f-number asked for."""
    stored: list[dict[str, Any]] = from_json(held.items)
    asked = {name: value for name, value in chosen.items() if name != "f_number"}
    items = [
        (place, item)
        for place, item in enumerate(stored)
        if all(item.get(name) == value for name, value in asked.items())
    ]
    if (at := wanted.f_number) is None:
        general = {rows.key_of(item) for _, item in items if "f_number" not in item}
        return [item for _, item in items if "f_number" not in item or rows.key_of(item) not in general]
    there = {rows.key_of(item) for _, item in items if _is_at(item, at)}
    foreseen = json.loads(held.foreseen or "{}")
    found = []
    for place, item in items:
        if _is_at(item, at):
            found.append(item)
        elif "f_number" not in item and rows.key_of(item) not in there:
            there_u = foreseen.get(str(place))
            found.append(item if there_u is None else _foresee(item, wanted.method, at, there_u))
    return found


def _is_at(item: dict[str, Any], f_number: float) -> bool:
    """Return whether an item is of this f-number, as it is written on the lens."""
    return "f_number" in item and math.isclose(item["f_number"], f_number, rel_tol=_SAME_F_NUMBER_REL)


def _foresee(
    item: dict[str, Any], method: str, f_number: float, uncertainty: dict[str, float]
) -> dict[str, Any]:
    application = get_method(method).application
    assert isinstance(application, SurfaceApplication)  # noqa: S101  of no other is u foreseen
    flag = str(application.unforeseen)
    return item | {
        "f_number": f_number,
        **uncertainty,
        "flags": [*item["flags"], flag],
        "why": f"{item['why']}; f/{f_number:g} was not calibrated: the value is that of the ISO "
        "value, and its uncertainty contains that of a nominal f-number",
    }


class AnswersReady(operations.Operation):
    """A look-up in one query, which checks the key too; what it does not answer goes the usual way."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        go_the_usual_way = super().get_route_handler()

        async def look_up(request: Request) -> Response:
            return await _answer_ready(request) or await go_the_usual_way(request)

        return look_up


async def _find_held(
    context: Context,
    camera_id: str,
    wanted: Wanted,
    at: datetime,
    **asker: Any,  # noqa: ANN401
) -> tuple[lookups.Held, ...]:
    method, known_at = wanted.method, wanted.known_at
    return await lookups.find_ready(
        context.database, camera_id=camera_id, method=method, at=at, known_at=known_at, **asker
    )


async def _answer_ready(request: Request) -> Response | None:
    sent, camera_id = request.headers.get("authorization", ""), request.path_params["camera_id"]
    wanted = _read_query(request.scope["query_string"]) if sent.startswith(_BEARER) else None
    if wanted is None or not lookup.is_id(camera_id):
        return None
    context: Context = request.app.state.context
    secret, now = sent.removeprefix(_BEARER), utc_now()
    by_key = {"sha256": hash_secret(secret), "now": now, "used_after": now - counts.STEP}
    held = await _find_held(context, camera_id, wanted, wanted.at or now, **by_key)
    if (answer := answer_held(request, wanted, held)) is not None:
        context.attempts.trust(secret)
        context.rates.take(held[0].organisation_id)
    return answer


@lru_cache(maxsize=4096)
def _read_query(query: bytes) -> Wanted | None:
    """Read what is asked for; None for what the usual way refuses, or may read otherwise."""
    try:
        pairs = parse_qsl(query.decode("ascii"), keep_blank_values=True, errors="strict")
        asked = dict(pairs)
        numbers = [asked[name] for name in ("iso", "f_number") if name in asked]
        if len(asked) < len(pairs) or not all(map(operations.NUMBER.fullmatch, numbers)):
            return None
        return Wanted.model_validate(asked)
    except (ValidationError, ValueError):
        return None


Asked = Annotated[Wanted, Query()]
router = operations.Router(prefix="/v1", tags=["coefficients"])
ready_router = operations.Router(prefix="/v1", tags=["coefficients"], route_class=AnswersReady)


@ready_router.get("/cameras/{camera_id}/coefficients", **answers.sends(CoefficientsAnswer))
async def get_coefficients(
    camera_id: lookup.Id, wanted: Asked, request: Request, caller: Reader, context: UsesContext
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
        held = await _find_held(context, camera_id, wanted, at, organisation_id=caller.organisation_id)
    if (answer := answer_held(request, wanted, held)) is None:
        await run_in_threadpool(_require_camera, context, caller, camera_id)
        raise problems.Problem(interface.NO_CALIBRATION_IN_FORCE, _explain_none(wanted, at, held))
    return answer


def _require_camera(context: Context, caller: Caller, camera_id: str) -> None:
    with context.database.reading() as session:
        lookup.owned(session, Camera, camera_id, caller)


class CoefficientSeriesQuery(SeriesQuery):
    start: models.Instant | None = models.maybe("In force at this time or later.", alias="from")
    end: models.Instant | None = models.maybe("In force before this time.", alias="to")


_COLUMNS = series.describe_columns(SeriesRow)


@router.get("/series/coefficients", response_model=SeriesAnswer, responses=series.RESPONSES)
def get_coefficient_series(
    query: Annotated[CoefficientSeriesQuery, Query()], request: Request, caller: Reader, context: UsesContext
) -> Response:
    """Every published coefficient with its validity: flat, in one answer, for a panel or a spreadsheet.

    The rows are ordered by camera, `valid_from` and method. An answer has at most `limit` rows, 200,000
    without it; if more follow, `next` and the header `Link` (`rel="next"`) are their address.
    """
    return answer_series(request, context, caller, CoefficientSeries, query, _COLUMNS)


def _explain_none(wanted: Wanted, at: datetime, found: Sequence[lookups.Held]) -> str:
    if not found:
        return f"No {wanted.method} calibration of this camera is in force at {rows.show_instant(at)}."
    versions = ", ".join(str(held.version) for held in found)
    items = [item for held in found for item in from_json(held.items)]
    said = [f"Version {versions} is in force at {rows.show_instant(at)}, but has no such coefficient."]
    for key, sentence in _KNOWN.items():
        there = sorted({item[key] for item in items if key in item})
        if wanted.chosen.get(key) not in {None, *there}:
            known = ", ".join(f"{each:g}" if key == "iso" else each for each in there)
            said.append(sentence.format(known) if known else f"It knows no {key}.")
    return " ".join(said)
