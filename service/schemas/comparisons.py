"""Answers of the comparison of two measurements."""

from pydantic import Field

from radiometry.drawing.text import in_step
from radiometry.fitting.comparison import Comparison
from service.schemas.base import Answer, Quantity
from store.measuring.comparison import SURE, MeasurementComparison, Side

_OTHER_REGION = " The two regions differ: the change may be one of the place and not of the light."


class Compared(Answer, restates=Comparison):
    """new - old, and new / old - 1."""


class Measured(Answer):
    measurement_id: str
    filename: str
    taken_at: str | None = None
    mean: Quantity
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
