"""What every method is given, and what it gives back, whatever it calibrates."""

from dataclasses import dataclass
from typing import Generic, TypeVar

from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon
from radiometry.frame.statistics import ChannelStatistics

F = TypeVar("F")


@dataclass(frozen=True, kw_only=True)
class Region:
    """A part of the picture that is looked at by itself; ``name`` is "" where there is only one."""

    name: str
    polygon: Polygon


@dataclass(frozen=True, kw_only=True)
class Extracted(Generic[F]):
    """What one frame says.

    ``statistics`` : of the raw numbers in its region, a row per channel
    ``features`` : the method's own figures, ready for JSON; None where the statistics are all it needs
    """

    statistics: tuple[ChannelStatistics, ...]
    features: F | None


@dataclass(frozen=True, kw_only=True)
class FrameEvidence(Generic[F]):
    """One frame of a campaign as a fit sees it.

    ``frame`` : its name in messages and points; unique in a campaign
    ``scene`` : what the frame shows, where somebody said so
    ``exposure`` : None only for a chart whose file states none
    ``statistics``, ``features`` : of `extract`, None while the frame waits for it or for its region
    ``has_region`` : False while nobody has drawn a region that the method needs
    """

    frame: str
    role: str
    scene: str | None
    header: FrameHeader
    exposure: Exposure | None
    statistics: tuple[ChannelStatistics, ...] | None
    features: F | None
    has_region: bool = True


@dataclass(frozen=True, kw_only=True)
class Exclusion:
    """A frame that somebody leaves out of the fit: which, why, and who says so."""

    frame: str
    reason: str
    by: str


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A reported quantity."""

    value: float
    standard_uncertainty: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class BudgetEntry:
    """One source's share of a coefficient's uncertainty.

    ``kind`` : A (from scatter) or B (from elsewhere); ``u_rel`` : relative to the coefficient
    """

    source: str
    kind: str
    u_rel: float
    variance_share: float


@dataclass(frozen=True, kw_only=True)
class CoefficientValue:
    """One coefficient of a version as dashboards see it.

    ``name`` : with its unit where it has one, as in the HTTP contract; ``model`` : the equation it belongs to
    ``iso``, ``f_number``, ``band``, ``channel`` : what it holds for, None where it holds for all
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
