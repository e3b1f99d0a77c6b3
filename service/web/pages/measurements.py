"""Measurements: all of them, a new one, one with its map, and two against each other."""

from typing import Annotated

from fastapi import Query, Response

from radiometry.frame.multispectral import NAMED_INDICES
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.schemas.base import Text
from service.web.rendering import SignedInPage
from store.tables import Calibration, FrameRow, Measurement

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
