"""Measurements: all of them, a new one, one with its map, and two against each other."""

from typing import Annotated, Literal, TypeVar

from fastapi import Depends, Query, Request, Response
from pydantic import ValidationError

from radiometry.frame.bands import NAMED_INDICES
from service.auth import Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.map_tools import open_map
from service.operations import Router
from service.problems import invalid
from service.profiles import answer_histogram, answer_profile
from service.schemas.base import Text
from service.schemas.map_tools import BinsOfMap, LineOfMap
from service.web.charts import View, draw_figure, send_svg
from service.web.map_plots import plot_histogram, plot_profile
from service.web.rendering import SignedInPage
from store.tables import Calibration, FrameRow, Measurement

Asked = TypeVar("Asked", LineOfMap, BinsOfMap)

router = Router(include_in_schema=False)


@router.get("/measurements")
def show_measurements(page: SignedInPage) -> Response:
    return page.render("measurements.html", title="Measurements")


# before the page of one measurement, whose id it would be taken for
@router.get("/measurements/new")
def show_new_measurement(page: SignedInPage) -> Response:
    return page.render("measurement-new.html", title="Measure a frame", indices=" ".join(NAMED_INDICES))


@router.get("/measurements/comparison")
def show_comparison(
    page: SignedInPage, context: UsesContext, old: Annotated[Text, Query()], new: Annotated[Text, Query()]
) -> Response:
    with context.database.reading() as session:
        for named in (old, new):
            owned(session, Measurement, named, page.caller)
    return page.render("comparison.html", title="Compare measurements", old=old, new=new)


def _read_line(request: Request) -> LineOfMap:
    return _read_query(request, LineOfMap)


def _read_bins(request: Request) -> BinsOfMap:
    return _read_query(request, BinsOfMap)


def _read_query(request: Request, form: type[Asked]) -> Asked:
    """Read a form of the API out of a query that has more."""
    given = {name: value for name, value in request.query_params.items() if name in form.model_fields}
    try:
        return form.model_validate(given)
    except ValidationError as error:
        raise invalid(error.errors()) from error


@router.get("/plots/measurements/{measurement_id}/profile")
def plot_measurement_profile(
    measurement_id: Id,
    caller: Reader,
    context: UsesContext,
    view: Annotated[View, Depends()],
    asked: Annotated[LineOfMap, Depends(_read_line)],
    axis: Annotated[Literal["logarithmic", "linear"], Query()] = "linear",
) -> Response:
    with open_map(context, measurement_id, caller) as found:
        profile = answer_profile(found, asked)
    figure = plot_profile(profile, logarithmic=axis == "logarithmic")
    return send_svg(draw_figure(figure, "Profile along the line", view=view))


@router.get("/plots/measurements/{measurement_id}/histogram")
def plot_measurement_histogram(
    measurement_id: Id,
    caller: Reader,
    context: UsesContext,
    view: Annotated[View, Depends()],
    asked: Annotated[BinsOfMap, Depends(_read_bins)],
) -> Response:
    with open_map(context, measurement_id, caller) as found:
        histogram = answer_histogram(found, asked)
    return send_svg(draw_figure(plot_histogram(histogram), "Histogram of the map", view=view))


@router.get("/measurements/{measurement_id}")
def show_measurement(measurement_id: Id, page: SignedInPage, context: UsesContext) -> Response:
    with context.database.reading() as session:
        measurement = owned(session, Measurement, measurement_id, page.caller)
        frame = session.get_one(FrameRow, measurement.frame_id)
        calibration = session.get_one(Calibration, measurement.calibration_id)
    return page.render(
        "measurement.html",
        title=frame.filename,
        measurement=measurement,
        calibration=calibration,
    )
