"""Isolines of a measurement's map."""

from typing import Annotated

from fastapi import Query, Request, Response

from service.auth import Reader
from service.context import UsesContext
from service.immutable import immutable_headers, not_modified
from service.isolines import answer_isolines
from service.lookup import Id
from service.map_tools import open_map
from service.operations import Router
from service.routes import UNCHANGED, problems
from service.routes.measurement_lists import GeoJson
from service.schemas.map_tools import IsolinesAnswer, LevelsOfMap

router = Router(prefix="/v1/measurements/{measurement_id}", tags=["measurements"])


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
    with open_map(context, measurement_id, caller) as found:
        tag = found.tag(f"{request.url.path}?{request.url.query}")
        unchanged = not_modified(request, tag)
        return unchanged or GeoJson(answer_isolines(found, asked).dump(), headers=immutable_headers(tag))
