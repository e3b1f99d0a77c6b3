"""Comparison of two measurements."""

from typing import Annotated

from fastapi import Query, Response
from sqlalchemy.orm import Session

from radiometry.methods import get_method
from radiometry.specification.application import PictureApplication
from service.auth import Caller, Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.problems import invalid
from service.routes import problems
from service.schemas.base import Text
from service.schemas.comparisons import ContrastAnswer
from store.measuring.comparison import Side, compare_measurements
from store.tables import Calibration, FrameRow, Measurement

router = Router(prefix="/v1", tags=["measurements"])


@router.get(
    "/measurements/{measurement_id}/comparison", response_model=ContrastAnswer, responses=problems(404, 409)
)
def contrast_measurements(
    measurement_id: Id,
    caller: Reader,
    context: UsesContext,
    old: Annotated[Text, Query(description="The measurement that it is compared with.")],
    *,
    other_region: Annotated[bool, Query(description="Compare them even if their outlines differ.")] = False,
    same_light: Annotated[bool, Query(description="You know that the same lamps lit both.")] = False,
) -> Response:
    """Compute the difference of two measurements and its significance. Errors that both share cancel.

    Measurements with different outlines are refused unless `other_region` is true.
    """
    with context.database.reading() as session:
        before, after = _side(session, old, caller), _side(session, measurement_id, caller)
        if before.quantity != after.quantity:
            message = f"is of {before.quantity}, the other of {after.quantity}: compare like with like"
            raise invalid([{"type": "quantity", "loc": ("query", "old"), "msg": message}])
        found = compare_measurements(before, after, other_region=other_region, same_light=same_light)
        return ContrastAnswer.between(before, after, found).respond()


def _side(session: Session, measurement_id: str, caller: Caller) -> Side:
    row = owned(session, Measurement, measurement_id, caller)
    application = get_method(row.method).application
    if isinstance(application, PictureApplication):
        message = f"is an {application.quantity} and has no value to compare"
        raise invalid([{"type": "quantity", "loc": ("query", "old"), "msg": message}])
    return Side(
        measurement=row,
        frame=session.get_one(FrameRow, row.frame_id),
        calibration=session.get_one(Calibration, row.calibration_id),
    )
