"""Comparison of two measurements."""

from typing import Annotated

from fastapi import Query, Response
from pydantic import Field
from sqlalchemy.orm import Session

from radiometry.drawing.text import in_step
from radiometry.fitting.comparison import Comparison
from radiometry.methods import get_method
from radiometry.specification.application import PictureApplication
from service.http import auth, lookup, models, operations
from service.http.answers import problems
from service.http.context import UsesContext
from service.http.problems import invalid
from store.measuring.comparison import SURE, MeasurementComparison, Side, compare_measurements
from store.tables import Calibration, FrameRow, Measurement

_OTHER_REGION = " The two regions differ: the change may be one of the place and not of the light."


class Compared(models.Answer, restates=Comparison):
    """new - old, and new / old - 1."""


class Measured(models.Answer):
    measurement_id: str
    filename: str
    taken_at: str | None = None
    mean: models.Quantity
    region: list[list[float]] = Field(description="Outline [x, y] in px of what the mean is of.")
    region_origin: str = Field(description="Source of the region, as in the measurement.")

    @classmethod
    def of(cls, side: Side) -> "Measured":
        return cls.restate(side, side.frame.header or {}, side.frame, measurement_id=side.measurement.id)


class ContrastAnswer(Compared):
    old: Measured
    new: Measured
    significant: bool = Field(
        description="At least two standard uncertainties of the difference, and more than `confusion_rel`."
    )
    confusion_rel: float | None = Field(
        default=None,
        description="What two types of lamp could show as a change without any, where the light is neither "
        "known nor the same in both.",
    )
    said: str
    common: list[str] = Field(description="Sources whose error is the same in both, so that it cancels.")
    same_region: bool = Field(
        description="The same outlines in images of the same size. Whether they show the same ground is not "
        "known."
    )
    cells: list[list[Compared]] | None = Field(
        default=None, description="Of two grids with as many rows and columns: cell by cell."
    )

    @classmethod
    def between(cls, old: Side, new: Side, found: MeasurementComparison) -> "ContrastAnswer":
        mean = found.mean
        return cls.restate(
            mean,
            old=Measured.of(old),
            new=Measured.of(new),
            significant=found.is_significant,
            confusion_rel=found.confusion_rel,
            said=_format_verdict(found) + ("" if found.same_region else _OTHER_REGION),
            common=found.common,
            same_region=found.same_region,
            cells=found.cells or None,
        )


def _format_verdict(found: MeasurementComparison) -> str:
    mean = found.mean
    if mean.in_standard_uncertainties is None:
        return "Both are exactly equal." if mean.difference.value == 0.0 else "Neither has an uncertainty."
    shown, unit = (mean.difference, "") if mean.change is None else (mean.change, " %")
    by = in_step(abs(shown.value), shown.standard_uncertainty)[0] + unit
    moved = "rose" if mean.difference.value > 0.0 else "fell"
    times = f"{mean.in_standard_uncertainties:.2g} times the uncertainty of the difference"
    verdict = "a significant change" if found.is_significant else "not a significant change"
    if found.confusion_rel is not None and mean.in_standard_uncertainties >= SURE:
        verdict += (
            f". Lamps of another type can show up to {found.confusion_rel:.0%} without any: state the "
            "light of both, or that it is the same"
        )
    return f"The mean {moved} by {by}, {times}: {verdict}."


router = operations.Router(prefix="/v1", tags=["measurements"])


@router.get(
    "/measurements/{measurement_id}/comparison", response_model=ContrastAnswer, responses=problems(404, 409)
)
def contrast_measurements(
    measurement_id: lookup.Id,
    caller: auth.Reader,
    context: UsesContext,
    old: Annotated[models.Text, Query(description="The measurement that it is compared with.")],
    *,
    other_region: Annotated[bool, Query(description="Compare them even if their outlines differ.")] = False,
    same_light: Annotated[bool, Query(description="You know that the same lamps lit both.")] = False,
) -> Response:
    """Compute the difference of two measurements and its significance. Errors that both share cancel.

    Measurements with different outlines are refused unless `other_region` is true.
    """
    with context.database.reading() as session:
        before, after = _side(session, old, caller), _side(session, measurement_id, caller)
        was, is_now = before.summary.measured, after.summary.measured
        if was != is_now:
            message = f"is of {was}, the other of {is_now}: compare like with like"
            raise invalid([{"type": "quantity", "loc": ("query", "old"), "msg": message}])
        found = compare_measurements(before, after, other_region=other_region, same_light=same_light)
        return ContrastAnswer.between(before, after, found).respond()


def _side(session: Session, measurement_id: str, caller: auth.Caller) -> Side:
    row = lookup.owned(session, Measurement, measurement_id, caller)
    application = get_method(row.method).application
    if isinstance(application, PictureApplication):
        message = f"is an {application.quantity} and has no value to compare"
        raise invalid([{"type": "quantity", "loc": ("query", "old"), "msg": message}])
    return Side(
        measurement=row,
        frame=session.get_one(FrameRow, row.frame_id),
        calibration=session.get_one(Calibration, row.calibration_id),
    )
