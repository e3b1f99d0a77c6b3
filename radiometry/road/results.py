"""Results of a road: figures with U, verdicts, points, control points, model and plan."""

from typing import Literal

from radiometry.findings import Raised
from radiometry.records import Record, about
from radiometry.road.grid import GridPoint
from radiometry.road.site import Criterion

Verdict = Literal["conforms", "does_not", "not_decided", "not_measured"]
PointState = Literal["agrees", "differs", "left_out", "not_seen"]


class FigureResult(Record):
    """A figure with its uncertainty."""

    figure: str = about('"e_av", "e_min", "u_0", "average_to_min", "eir", or "pdi".')
    value: float = about("Estimate.")
    standard_uncertainty: float = about("Standard uncertainty.")
    low: float = about("Lower end of the interval that has the figure with 95 %.")
    high: float = about("Upper end of it.")
    expanded_uncertainty: float = about("Half of that interval.")
    unit: str = about('"lx", "1", or "mW/(lx*m2)".')


class Prospect(Record):
    """Expected effect of further control points on a figure, should its value stay."""

    points: int = about("Further control points, read once each with the meter of the last.")
    expanded_uncertainty: float = about("Expanded uncertainty of the figure with them.")
    is_decided: bool = about("True if that would decide it.")


class CriterionResult(Criterion):
    """A figure compared with its limit."""

    probability: float | None = about("Probability that the figure conforms; None if it is not measured.")
    verdict: Verdict
    needed_u: float | None = about(
        "Expanded uncertainty that would decide it, should the value stay; None if it is decided.",
        default=None,
    )
    needed_points: int | None = about(
        "Further control points that are expected to reach it; None if it is decided, or if no number does.",
        default=None,
    )
    prospects: tuple[Prospect, ...] = about("What would decide it; none if it is decided.", default=())


class ClassResult(Record):
    """Verdict on another class of the same rule."""

    road_class: str
    verdict: Verdict


class PointResult(GridPoint):
    """Illuminance of one point of the grid."""

    illuminance_lx: float = about("E [lx], without the pavement's patches.")
    u_rel: float = about("Relative standard uncertainty.")
    luminance_cd_m2: float | None = about(
        "As seen about it, the mean of its frames; None if it was not seen."
    )
    is_hidden: bool = about("True if a person left it out, or no frame shows it.")


class ControlResult(Record):
    """A control point against the map that is made without it."""

    name: str
    x_m: float
    y_m: float
    quantity: str
    value: float = about("Mean of the readings [lx or cd/m2].")
    without_it: float | None = about("What the map says that is made without it; None if it was not seen.")
    without_it_u_rel: float | None = about("Relative standard uncertainty of their difference.")
    difference_rel: float | None = about("Reading over map, less 1.")
    state: PointState
    reason: str = about("Why a person left it out.", default="")


class ScaleResult(Record):
    """Scale of the luminances by the control points."""

    surface: str = about("Name of the pavement.")
    factor: float = about("E over that expected of K and a pavement of the stated luminance factor.")
    factor_u: float
    expected_u: float = about("Standard uncertainty of the factor, 1, without the points.")
    slope: float = about("b1: change of ln E/L with 1 - cos of the light's angle of incidence.")
    slope_u: float


class Share(Record):
    """Contribution of one source to the variance of a figure."""

    source: str = about('"camera", "lens", "lamp spectrum", "pavement", "angle", "meter" or "points".')
    u_rel: float
    variance_share: float


class GridResult(Record):
    """Grid of the judged part."""

    points: int
    hidden: int = about("Points that are not seen, whose light is predicted from their neighbours.")
    along: int = about("N, points along.")
    along_m: float = about("D, distance along [m].")
    across_m: float = about("d, distance across [m].")
    place_u_m: float = about("Largest standard uncertainty of the place of a point [m].")
    place_limit_m: float = about("A third of the smaller distance [m].")
    view_deg: float = about("Largest angle between a view and the vertical [deg].")


class Model(Record):
    """The fitted field of ln E."""

    patches_rel: float = about("Scatter of the pavement from place to place.")
    patch_m: float = about("Length over which patches resemble each other [m].", default=1e-3)
    along_m: float = about("Length over which the light changes along [m].")
    across_m: float = about("Length over which the light changes across [m].")
    sigma: float = about("Standard deviation of ln E over such lengths.")
    unlike: float = about("Share of its variance that is not the same under all luminaires.", default=1.0)


class RoadResult(Record):
    """All that was found of a road."""

    verdict: Verdict
    as_found: bool = about("True if no maintenance factor was stated.")
    figures: tuple[FigureResult, ...]
    criteria: tuple[CriterionResult, ...]
    classes: tuple[ClassResult, ...]
    points: tuple[PointResult, ...]
    minimum: str = about("Name of the point with the least light.")
    control: tuple[ControlResult, ...]
    scales: tuple[ScaleResult, ...]
    budget: tuple[Share, ...] = about("Of E_av.")
    budget_u_0: tuple[Share, ...] = about("Of U_0.")
    grid: GridResult
    model: Model
    flags: tuple[Raised, ...]


class PlannedPoint(Record):
    """Place for a control point."""

    name: str
    x_m: float
    y_m: float
    is_spare: bool = False


class ExposureTime(Record):
    """An exposure time, and the largest error by flicker with it."""

    time_s: float
    error_rel: float


class Plan(Record):
    """Control points and exposures for a flight."""

    points: tuple[PlannedPoint, ...] = about("In the order in which one walks; the spare last.")
    e_av_u_rel: float = about("Expected relative expanded uncertainty of E_av.")
    u_0_u_rel: float = about("Expected relative expanded uncertainty of U_0.")
    is_reached: bool = about("True if both are at most the wanted ones.")
    times: tuple[ExposureTime, ...] = about("Without error by flicker.")
    avoid: tuple[ExposureTime, ...] = about("Usual times with the largest errors.")
