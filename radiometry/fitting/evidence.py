"""Inputs and outputs shared by all calibration methods."""

from collections.abc import Collection, Sequence
from typing import Generic, Literal, TypeVar

from radiometry.drawing.text import name_few
from radiometry.findings import shared
from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon
from radiometry.frame.statistics import ChannelStatistics
from radiometry.records import Record, about, later

F = TypeVar("F")
Acceptance = Literal["simple", "guarded", "shared_risk"]

MOST_DOF = 1e6  # Effective degrees of freedom of an uncertainty that is not limited by them

# Numbers and names that a sentence states, by name; a list is an interval, or several of them
Values = dict[str, str | float | list[float]]


class Region(Record):
    """A part of the image that is evaluated separately."""

    name: str  #: "" if there is only one region
    polygon: Polygon  #: Outline of the region [px]


class Extracted(Record, Generic[F]):
    """Result of the extraction of one frame."""

    #: Statistics of the raw values in the frame's region, one row per channel
    statistics: tuple[ChannelStatistics, ...]
    #: Values specific to the method, ready for JSON; None if the method needs the statistics alone
    features: F | None


class FrameEvidence(Record, Generic[F]):
    """One frame of a campaign as input of a fit."""

    frame: str  #: Name of the frame in messages and points; unique in a campaign
    role: str  #: Role of the frame, such as "light" or "dark"
    scene: str | None  #: Name of what the frame shows, if it was given
    header: FrameHeader  #: Metadata of the raw file
    exposure: Exposure | None  #: None only for a chart whose file states no exposure
    #: Results of `extract`; None until the frame is extracted or has its region
    statistics: tuple[ChannelStatistics, ...] | None
    features: F | None
    has_region: bool = True  #: False if the method needs a region and none is drawn
    #: Serial number that was read off what the frame shows; None if there is none
    identified: str | None = None


class Exclusion(Record):
    """A frame that a person excludes from the fit."""

    frame: str
    reason: str = about("Reason for the exclusion.")
    by: str = about("Person who decided it.")


def require_complete(lacking: Sequence[str]) -> None:
    if lacking:
        raise shared.FIT_INCOMPLETE.reject(f"The fit cannot start: {'; '.join(lacking)}.")


def list_unknown_exclusions(exclude: Sequence[Exclusion], frames: Collection[str]) -> list[str]:
    unknown = {each.frame for each in exclude} - set(frames)
    return [f"to be left out, but not of this campaign: {name_few('frame', unknown)}"] if unknown else []


class Quantity(Record, kw_only=False):
    """A reported quantity."""

    value: float = about("Estimate of the quantity.")
    standard_uncertainty: float = about("Standard uncertainty, in the same unit.")
    unit: str = about('Unit of both; "1" for a ratio.')


class FieldCorrection(Record):
    """Correction of one error of the field: L = factor * L_shown - offset."""

    source: str = about("Name of the source, as in the budget.")
    factor: float = about("Factor of the shown luminance.", default=1.0)
    offset_cd_m2: float = about("Luminance that is subtracted [cd/m2].", default=0.0)
    u_rel: float = about(
        "What is left, relative to the luminance: the same error in the whole frame.", default=0.0
    )
    u_cd_m2: float = about("What is left of the offset [cd/m2].", default=0.0)
    basis: str = about("What the correction, or the uncertainty in its place, is based on.", default="")
    assumed: bool | None = later(
        "True if nothing was stated of the source, so that a plausible size is in the budget."
    )
    values: Values | None = later("What the basis names, by name.")


class BudgetEntry(Record):
    """Contribution of one source to the uncertainty of a coefficient."""

    source: str
    kind: str = about('"A" (evaluated from scatter) or "B" (evaluated by other means).')
    u_rel: float = about("Contribution relative to the coefficient.")
    variance_share: float = about("Fraction of the coefficient's variance, 0 to 1.")


_COLOUR = "Band or channel that the value holds for; None if it holds for all."
_CONDITION = "Condition that the value holds for; None if it holds for all."


class CoefficientValue(Record):
    """One coefficient of a version as dashboards read it."""

    name: str = about("Name, with its unit if it has one, as in the HTTP contract.")
    value: float = about("Value and its standard uncertainty, in `unit`.")
    standard_uncertainty: float = about("Value and its standard uncertainty, in `unit`.")
    unit: str = about("Unit of the value.")
    model: str = about("Equation that the coefficient belongs to.")
    iso: float | None = about(_CONDITION, default=None)
    f_number: float | None = about(_CONDITION, default=None)
    band: str | None = about(_COLOUR, default=None)
    channel: str | None = about(_COLOUR, default=None)
    flags: tuple[str, ...] = about("Codes of the flags that apply to the value.", default=())
    effective_dof: float | None = about(
        "Effective degrees of freedom of the standard uncertainty; None if the fit does not state them.",
        default=None,
    )
    coverage_factor: float | None = about(
        "Coverage factor that the fit itself states; None if it follows from `effective_dof`.", default=None
    )
