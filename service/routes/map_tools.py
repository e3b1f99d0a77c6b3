"""Line profiles, isolines and histograms of a measurement's map."""

from collections.abc import Callable
from typing import Annotated, Any

from fastapi import Query, Request, Response

from service.auth import Caller, Reader
from service.context import Context, UsesContext
from service.immutable import immutable_headers, not_modified
from service.isolines import answer_isolines
from service.lookup import Id
from service.map_tools import OpenMap, open_map
from service.operations import Router
from service.profiles import answer_histogram, answer_profile
from service.routes import UNCHANGED, problems
from service.routes.measurement_lists import GeoJson
from service.schemas.map_tools import (
    BinsOfMap,
    HistogramAnswer,
    IsolinesAnswer,
    LevelsOfMap,
    LineOfMap,
    ProfileAnswer,
)
from service.series import MEDIA_TYPES
from service.tabular import write_csv

router = Router(prefix="/v1/measurements/{measurement_id}", tags=["measurements"])

_CSV: dict[int | str, dict[str, Any]] = {200: {"content": {"text/csv": {"schema": {"type": "string"}}}}}


def _answer(
    measurement_id: str,
    request: Request,
    caller: Caller,
    context: Context,
    make: Callable[[OpenMap, dict[str, str]], Response],
) -> Response:
    """Answer from the map, unless who asks has the answer."""
    with open_map(context, measurement_id, caller) as found:
        tag = found.tag(f"{request.url.path}?{request.url.query}")
        return not_modified(request, tag) or make(found, immutable_headers(tag))


@router.get("/profile.json", response_model=ProfileAnswer, responses={**UNCHANGED, **problems(404, 500)})
def get_measurement_profile(
    measurement_id: Id,
    request: Request,
    caller: Reader,
    context: UsesContext,
    asked: Annotated[LineOfMap, Query()],
) -> Response:
    """Values of the map along a line, with the uncertainty that all share and that of each alone.

    Each point is the pixel in which it lies, a pixel apart, or the mean of those across and along. Points
    that are saturated have no value; points not distinguished from zero have one and are marked.
    """
    return _answer(
        measurement_id,
        request,
        caller,
        context,
        lambda found, headers: answer_profile(found, asked).respond(headers),
    )


@router.get("/profile.csv", response_class=Response, responses={**_CSV, **UNCHANGED, **problems(404, 500)})
def get_measurement_profile_csv(
    measurement_id: Id,
    request: Request,
    caller: Reader,
    context: UsesContext,
    asked: Annotated[LineOfMap, Query()],
) -> Response:
    """The points of a line profile, a line each."""

    def make(found: OpenMap, headers: dict[str, str]) -> Response:
        answer = answer_profile(found, asked)
        rows = [{**point.model_dump(), "unit": answer.unit} for point in answer.points]
        return Response(write_csv(rows, list(rows[0])), media_type=MEDIA_TYPES["csv"], headers=headers)

    return _answer(measurement_id, request, caller, context, make)


@router.get("/histogram.json", response_model=HistogramAnswer, responses={**UNCHANGED, **problems(404, 500)})
def get_measurement_histogram(
    measurement_id: Id,
    request: Request,
    caller: Reader,
    context: UsesContext,
    asked: Annotated[BinsOfMap, Query()],
) -> Response:
    """Pixels of an area of the map by their values, with percentiles.

    Saturated pixels and those that are not distinguished from zero are counted apart, and rank highest and
    lowest in the percentiles.
    """
    return _answer(
        measurement_id,
        request,
        caller,
        context,
        lambda found, headers: answer_histogram(found, asked).respond(headers),
    )


@router.get("/histogram.csv", response_class=Response, responses={**_CSV, **UNCHANGED, **problems(404, 500)})
def get_measurement_histogram_csv(
    measurement_id: Id,
    request: Request,
    caller: Reader,
    context: UsesContext,
    asked: Annotated[BinsOfMap, Query()],
) -> Response:
    """The bins of a histogram, a line each, with a line for the pixels of each kind that are in none.

    `kind` is `bin`, `too_dark`, `below`, `above` or `unknown`: together they are all pixels of the area.
    """

    def make(found: OpenMap, headers: dict[str, str]) -> Response:
        answer = answer_histogram(found, asked)
        counts = {kind: getattr(answer, kind) for kind in ("too_dark", "below", "above", "unknown")}
        rows = [
            *({"kind": "bin", **each.model_dump()} for each in answer.bins),
            *(
                {"kind": kind, "pixels": count, "share": count / answer.pixels}
                for kind, count in counts.items()
            ),
        ]
        told = [{**row, "unit": answer.unit} for row in rows]
        return Response(write_csv(told, list(told[0])), media_type=MEDIA_TYPES["csv"], headers=headers)

    return _answer(measurement_id, request, caller, context, make)


@router.get(
    "/isolines.geojson",
    response_model=IsolinesAnswer,
    response_class=GeoJson,
    responses={**UNCHANGED, **problems(404, 500)},
)
def get_measurement_isolines(
    measurement_id: Id,
    request: Request,
    caller: Reader,
    context: UsesContext,
    asked: Annotated[LevelsOfMap, Query()],
) -> Response:
    """Lines of equal value, a feature a level, traced in the map's means over squares of `step_px`.

    Rings around a single square are left out and counted. No line crosses a square with a saturated pixel.
    """
    return _answer(
        measurement_id,
        request,
        caller,
        context,
        lambda found, headers: GeoJson(answer_isolines(found, asked).dump(), headers=headers),
    )
