"""Inputs and outputs shared by all calibration methods."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from radiometry.drawing.text import name_few
from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon
from radiometry.frame.statistics import ChannelStatistics
from radiometry.specification.stored import LATER

F = TypeVar("F")

MOST_DOF = 1e6
"""Effective degrees of freedom of an uncertainty that is not limited by them."""

Values = dict[str, str | float | list[float]]
"""Numbers and names that a sentence states, by name; a list is an interval, or several of them."""


@dataclass(frozen=True, kw_only=True)
class Region:
    """A part of the image that is evaluated separately.

    Attributes
    ----------
    name : str
        "" if there is only one region.
    polygon : Polygon
        Outline of the region [px].
    """

    name: str
    polygon: Polygon


@dataclass(frozen=True, kw_only=True)
class Extracted(Generic[F]):
    """Result of the extraction of one frame.

    Attributes
    ----------
    statistics : tuple of ChannelStatistics
        Statistics of the raw values in the frame's region, one row per channel.
    features : F or None
        Values specific to the method, ready for JSON; None if the method needs the
        statistics alone.
    """

    statistics: tuple[ChannelStatistics, ...]
    features: F | None


@dataclass(frozen=True, kw_only=True)
class FrameEvidence(Generic[F]):
    """One frame of a campaign as input of a fit.

    Attributes
    ----------
    frame : str
        Name of the frame in messages and points; unique in a campaign.
    role : str
        Role of the frame, such as "light" or "dark".
    scene : str or None
        Name of what the frame shows, if it was given.
    header : FrameHeader
        Metadata of the raw file.
    exposure : Exposure or None
        None only for a chart whose file states no exposure.
    statistics, features : tuple of ChannelStatistics or F, or None
        Results of `extract`; None until the frame is extracted or has its region.
    has_region : bool, default: True
        False if the method needs a region and none is drawn.
    identified : str or None, default: None
        Serial number that was read off what the frame shows; None if there is none.
    """

    frame: str
    role: str
    scene: str | None
    header: FrameHeader
    exposure: Exposure | None
    statistics: tuple[ChannelStatistics, ...] | None
    features: F | None
    has_region: bool = True
    identified: str | None = None


@dataclass(frozen=True, kw_only=True)
class Exclusion:
    """A frame that a person excludes from the fit.

    Attributes
    ----------
    frame : str
        Name of the frame.
    reason : str
        Reason for the exclusion.
    by : str
        Person who decided it.
    """

    frame: str
    reason: str
    by: str


def list_unknown_exclusions(exclude: Sequence[Exclusion], frames: Collection[str]) -> list[str]:
    """List the exclusions of frames that a campaign does not have.

    Parameters
    ----------
    exclude : sequence of Exclusion
        Exclusions of a fit.
    frames : collection of str
        Names of the campaign's frames.

    Returns
    -------
    list of str
        Fragments that can be joined by "; ", by name.
    """
    unknown = {each.frame for each in exclude} - set(frames)
    return [f"to be left out, but not of this campaign: {name_few('frame', unknown)}"] if unknown else []


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A reported quantity.

    Attributes
    ----------
    value : float
        Estimate of the quantity.
    standard_uncertainty : float
        Standard uncertainty, in the same unit.
    unit : str
        Unit of both; "1" for a ratio.
    """

    value: float
    standard_uncertainty: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class FieldCorrection:
    """Correction of one error of the field: L = factor * L_shown - offset.

    Attributes
    ----------
    source : str
        Name of the source, as in the budget.
    factor : float, default: 1.0
        Factor of the shown luminance.
    offset_cd_m2 : float, default: 0.0
        Luminance that is subtracted [cd/m2].
    u_rel : float, default: 0.0
        What is left, relative to the luminance: the same error in the whole frame.
    u_cd_m2 : float, default: 0.0
        What is left of the offset [cd/m2].
    basis : str, default: ""
        What the correction, or the uncertainty in its place, is based on.
    assumed : bool or None, default: None
        True if nothing was stated of the source, so that a plausible size is in the budget.
    values : dict or None, default: None
        What the basis names, by name.
    """

    source: str
    factor: float = 1.0
    offset_cd_m2: float = 0.0
    u_rel: float = 0.0
    u_cd_m2: float = 0.0
    basis: str = ""
    assumed: bool | None = field(default=None, metadata=LATER)
    values: Values | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class BudgetEntry:
    """Contribution of one source to the uncertainty of a coefficient.

    Attributes
    ----------
    source : str
        Name of the source.
    kind : str
        "A" (evaluated from scatter) or "B" (evaluated by other means).
    u_rel : float
        Contribution relative to the coefficient.
    variance_share : float
        Fraction of the coefficient's variance, 0 to 1.
    """

    source: str
    kind: str
    u_rel: float
    variance_share: float


@dataclass(frozen=True, kw_only=True)
class CoefficientValue:
    """One coefficient of a version as dashboards read it.

    Attributes
    ----------
    name : str
        Name, with its unit if it has one, as in the HTTP contract.
    value, standard_uncertainty : float
        Value and its standard uncertainty, in `unit`.
    unit : str
        Unit of the value.
    model : str
        Equation that the coefficient belongs to.
    iso, f_number : float or None, default: None
        Condition that the value holds for; None if it holds for all.
    band, channel : str or None, default: None
        Band or channel that the value holds for; None if it holds for all.
    flags : tuple of str, default: ()
        Codes of the flags that apply to the value.
    effective_dof : float or None, default: None
        Effective degrees of freedom of the standard uncertainty; None if the fit does not state them.
    coverage_factor : float or None, default: None
        Coverage factor that the fit itself states; None if it follows from `effective_dof`.
    """

    name: str
    value: float
    standard_uncertainty: float
    unit: str
    model: str
    iso: float | None = None
    f_number: float | None = None
    band: str | None = None
    channel: str | None = None
    flags: tuple[str, ...] = ()
    effective_dof: float | None = None
    coverage_factor: float | None = None
