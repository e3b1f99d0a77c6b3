"""Parameters and results of a fit, ready for JSON, and the budgets, key figures and plots of them."""

import math
from collections.abc import Iterator
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.drawing.figure import MOST, Axis, Cell, Figure, Mark, Plot, Series
from radiometry.drawing.text import write_quantity
from radiometry.findings import Raised
from radiometry.fitting.evidence import MOST_DOF, BudgetEntry, Exclusion
from radiometry.frame.packing import Packed, unpack
from radiometry.records import Record, about, later
from radiometry.specification.certificate import Budget, KeyFigure, choose_channel, of_quantity
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.vignetting.falloff import Matrix, evaluate_curve, evaluate_slopes

FLAT, DARK = "flat", "dark"


class Params(Record):
    """Parameters of a fit; the defaults serve a campaign shot as the documentation says."""

    flats_turned_deg: float | None = parameter(
        None,
        label="Camera turned between flats",
        description="Angle by which the camera was turned about its axis from each flat of an f-number to "
        "the next, in either sense; the light then turns in the frame, and the lens does not.",
        unit="deg",
        bounds="(0, 360)",
        default_text="not turned",
        example=180.0,
        later=True,
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        check_parameters(self)


def write_equation(terms: int) -> str:
    """Return the equation of a falloff of so many terms."""
    powers = " + ".join(f"k{n} r^{2 * n}" for n in range(1, terms + 1))
    return f"signal above dark = even light * (1 + {powers})"


class Conventions(Record):
    """Conventions of the numbers, since programs differ: stored with every fit."""

    equation: str = write_equation(3)
    correction: Literal["divide"] = "divide"
    radius_unit: Literal["half_diagonal"] = "half_diagonal"
    pixel_origin: Literal["centre of the first pixel"] = "centre of the first pixel"
    corner: Literal["farthest from the centre"] = "farthest from the centre"
    covariance_of: tuple[str, ...] = ("k1", "k2", "k3", "centre_row_px", "centre_col_px")

    @classmethod
    def of(cls, terms: int) -> "Conventions":
        """Return the conventions of falloffs with up to so many terms; the k of fewer are left out."""
        names = *(f"k{n}" for n in range(1, terms + 1)), "centre_row_px", "centre_col_px"
        return cls(equation=write_equation(terms), covariance_of=names)


class Coefficient(Record):
    """Falloff of one f-number and channel: all that an application needs, in plain fields.

    V = 1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8 + k5 r^10, r the distance from the centre over `radius_px`.
    """

    f_number: float
    channel: str
    height_px: int
    width_px: int
    radius_px: float = about("Half of the diagonal of the frame [px].")
    centre_row_px: float = about("Row and column of the centre [px].")
    centre_col_px: float = about("Row and column of the centre [px].")
    k1: float = about("Coefficients of the curve.")
    k2: float = about("Coefficients of the curve.")
    k3: float = about("Coefficients of the curve.")
    k4: float | None = later("Where the flats ask for it.")
    k5: float | None = later("Where the flats ask for it.")
    covariance: tuple[tuple[float, ...], ...] = about(
        "Covariance of k1, k2, k3, those of k4 and k5 that were fitted, centre row, centre column."
    )
    model_u_rel: float = about(
        "Relative departure of the flat from the curve beyond noise; alike at neighbouring places."
    )
    corner_falloff: float = about("1 - V at the corner farthest from the centre.")
    corner_falloff_standard_uncertainty: float

    @property
    def k(self) -> tuple[float, ...]:
        """The terms that were fitted."""
        return tuple(k for k in (self.k1, self.k2, self.k3, self.k4, self.k5) if k is not None)

    @property
    def centre_px(self) -> tuple[float, float]:
        return self.centre_row_px, self.centre_col_px

    def evaluate(self, row_px: Matrix, col_px: Matrix) -> tuple[Matrix, Matrix]:
        """Compute V at places, and its derivatives by each of its parameters."""
        return evaluate_slopes(row_px, col_px, self.k, centre_px=self.centre_px, radius_px=self.radius_px)


class Spot(Record):
    """Block that is darker (or brighter) than those around it."""

    row_px: float
    col_px: float
    depth_rel: float = about("Difference, as a fraction of the fitted light.")


class CornerVariance(Record):
    """Contribution of one source to the variance of the corner falloff; ``kind`` : "A" or "B"."""

    source: str
    kind: str
    variance: float


class ChannelFit(Record):
    """Results of one f-number and channel."""

    coefficient: Coefficient = about("Falloff.")
    frames: int = about("Number of flat frames.")
    chi_squared: float = about("Weighted sum of squared residuals.")
    dof: int = about("Degrees of freedom.")
    birge_ratio: float
    residual_rms_rel: float = about("Rms residual of the blocks that count, relative to the fitted light.")
    mean_corner_falloff: float = about("Mean falloff over the four corners.")
    largest_falloff: float = about("Largest falloff anywhere in the frame.")
    gradient_rel: float = about("Gradient of the light across the frame, largest less smallest.")
    gradient_standard_uncertainty_rel: float
    gradient_fitted: bool = about(
        "True if the coefficients are those of the fit with the gradient; versions from before it was "
        "always kept may have dropped it."
    )
    centre_held: bool = about("True if the flats do not determine the centre.")
    residuals: Packed = about(
        "(light - fitted) / fitted, (row, col) of blocks; NaN where a block did not count."
    )
    block_px: int = about("Side of a block [px].")
    dark_u_rel: float = about(
        "Standard uncertainty of the dark level over the light at the centre. The covariance of k "
        "includes it, but not in versions from before it was evaluated.",
        default=0.0,
    )
    corner_variances: tuple[CornerVariance, ...] = about(
        "Budget of the corner falloff; empty in versions from before it was kept.", default=()
    )
    effective_dof: dict[str, float] = about(
        "Effective degrees of freedom of the uncertainties, by coefficient, at most 1e6; empty in "
        "versions from before they were evaluated.",
        default_factory=dict,
    )


class Threshold(Record):
    """F-number from which on the falloff, the largest anywhere and in any channel, is below a limit."""

    falloff: float = about("Limit.")
    lowest_f_number: float | None = about("Lowest f-number that is below; None if there is none.")
    from_f_number: float | None = about("Lowest f-number from which on all are below; None if there is none.")
    is_sure: bool = about("True if twice the uncertainty changes neither.")


class Point(Record):
    """One frame in the fit."""

    frame: str
    role: str
    f_number: float | None
    used: bool = about("True if the fit used it.")
    left_out: str = about('"" for one that was used, else the reason.')
    saturated_share: float | None = about(
        "Fraction of clipped pixels of the most clipped channel.", default=None
    )
    signal_share: float | None = about(
        "Median light of the weakest channel, as a fraction of its span from black to white.", default=None
    )
    gradient_rel: float | None = about("Gradient of the light in the strongest channel.", default=None)
    gradient_standard_uncertainty_rel: float | None = None
    spots: tuple[Spot, ...] = about("Spots, left out of the fit.", default=())


class Fit(Record):
    """Result of a campaign."""

    height_px: int
    width_px: int
    cfa: str = about('Pattern of the frames, "grey" or "rgb".')
    channel_fits: tuple[ChannelFit, ...] = about("Results of each f-number and channel.")
    thresholds: tuple[Threshold, ...] = about("F-numbers from which on the falloff is below a limit.")
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]
    conventions: Conventions = about("Conventions of the numbers.", default=Conventions())

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        return tuple(fit.coefficient for fit in self.channel_fits)


class BudgetLine(BudgetEntry):
    """One source of u(corner falloff); ``u_rel`` is relative to the light in the corner."""

    u: float  # Contribution to the falloff


def list_budgets(fitted: Fit) -> tuple[Budget, ...]:
    budgets = []
    for fit in fitted.channel_fits:
        total = math.fsum(line.variance for line in fit.corner_variances)
        lines = tuple(
            BudgetLine(
                source=line.source,
                kind=line.kind,
                u=math.sqrt(line.variance),
                u_rel=math.sqrt(line.variance) / (1.0 - fit.coefficient.corner_falloff),
                variance_share=line.variance / total if total else 0.0,
            )
            for line in fit.corner_variances
        )
        holds_for = {"f_number": fit.coefficient.f_number, "channel": fit.coefficient.channel}
        budgets += [Budget(holds_for=holds_for, lines=lines)] if lines else []
    return tuple(budgets)


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    fits = sorted(result["channel_fits"], key=lambda fit: float(fit["coefficient"]["f_number"]))
    shown, name = choose_channel(fit["coefficient"]["channel"] for fit in fits), "corner_falloff"
    figures: list[KeyFigure] = []
    for fit in fits:
        c, dofs = fit["coefficient"], fit.get("effective_dof") or {name: None}
        if c["channel"] == shown:
            value, u = 100.0 * c[name], 100.0 * c[f"{name}_standard_uncertainty"]
            quantity = {"value": value, "standard_uncertainty": u, "unit": "%"}
            label = f"Corner falloff, {shown}"
            figures += of_quantity(f"f/{c['f_number']:g}", label, quantity, dof=dofs.get(name, MOST_DOF))
    return tuple(figures)


Node = dict[str, Any]

_COLUMNS: Final = 24


def _build_surface(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401  no rows are needed
    """One map per f-number, of the channel that stands for brightness, all in one scale."""
    shown = [c for c in _list(result) if c["channel"] == choose_channel(c["channel"] for c in _list(result))]
    darkest = max((c["corner_falloff"] for c in shown), default=0.0)
    for c in shown:
        height, width = float(c["height_px"]), float(c["width_px"])
        rows = max(1, round(_COLUMNS * height / width))
        cells = []
        for place in range(rows * _COLUMNS):
            row, col = divmod(place, _COLUMNS)
            (top, bottom), (left, right) = (
                [(each + end) * size / count for end in (0, 1)]
                for each, size, count in ((row, height, rows), (col, width, _COLUMNS))
            )
            y, x = 0.5 * (top + bottom), 0.5 * (left + right)
            lost = 1.0 - _share(c, y, x)
            told = f"row {y:.0f}, column {x:.0f}: {100.0 * (1.0 - lost):.1f} % of the light"
            cells.append(
                Cell(x=(left, right), y=(-bottom, -top), share=max(0.0, lost) / max(darkest, 1e-9), told=told)
            )
        yield Figure(
            part=f"f/{c['f_number']:g}",
            x=Axis(label="column [px]"),
            y=Axis(label="row [px]", is_downward=True),
            cells=tuple(cells),
            note=f"Channel {c['channel']}; full shade: {100.0 * darkest:.1f} % of the light lost",
        )


def _list_terms(c: Node) -> list[float]:
    return [c[f"k{n}"] for n in range(1, len(c["covariance"]) - 1)]


def _share(c: Node, row: float, col: float) -> float:
    r2 = ((row - c["centre_row_px"]) ** 2 + (col - c["centre_col_px"]) ** 2) / c["radius_px"] ** 2
    return float(evaluate_curve(np.array(r2), _list_terms(c)))


def _build_falloff(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    for channel in _channels(result):
        series = []
        for c in _list(result):
            if c["channel"] == channel:
                curve = list(_evaluate(c))
                swath = tuple((r, 100.0 * (v - 2.0 * u), 100.0 * (v + 2.0 * u)) for r, v, u in curve)
                line = tuple((r, 100.0 * v) for r, v, _ in curve)
                series.append(Series(name=f"f/{c['f_number']:g}", line=line, swath=swath))
        yield Figure(
            part=channel,
            x=Axis(label="distance from the centre [half diagonals]"),
            y=Axis(label="share of the light [%]", include=(100.0,)),
            series=tuple(series),
        )


def _build_corner(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    series = []
    for channel in _channels(result):
        marks = []
        for c in _list(result):
            if c["channel"] == channel:
                y, u = 100.0 * c["corner_falloff"], 200.0 * c["corner_falloff_standard_uncertainty"]
                told = (f"{write_quantity(y, u, '%')}, two standard uncertainties",)
                name = f"{channel}, f/{c['f_number']:g}"
                marks.append(Mark(x=c["f_number"], y=y, low=y - u, high=y + u, name=name, told=told))
        line = tuple((mark.x, mark.y) for mark in marks)
        series.append(Series(name=channel, marks=tuple(marks), line=line))
    f_numbers = sorted({c["f_number"] for c in _list(result)})
    yield Figure(
        x=Axis(label="f-number", logarithmic=True, ticks=tuple((f, f"f/{f:g}") for f in f_numbers)),
        y=Axis(label="falloff at the corner [%]", include=(0.0,)),
        levels=tuple(100.0 * each["falloff"] for each in result["thresholds"]),
        series=tuple(series),
    )


def _evaluate(c: Node) -> Iterator[tuple[float, float, float]]:
    """Yield (r, V, u(V)) along the radius, with u from the covariance of k1, k2 ..."""
    covariance, terms = np.array(c["covariance"])[:-2, :-2], np.array(_list_terms(c))
    for r in np.linspace(0.0, 1.0, 61):
        powers = r ** (2 * np.arange(1, terms.size + 1))
        variance = max(0.0, powers @ covariance @ powers)
        yield float(r), float(1.0 + powers @ terms), math.sqrt(variance)


def _build_residuals(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    """Maps of (light - fitted) / fitted per f-number, of the brightness' channel, in one scale."""
    fits = sorted(result["channel_fits"], key=lambda fit: float(fit["coefficient"]["f_number"]))
    shown = [fit for fit in fits if fit["coefficient"]["channel"] == _channels(result)[0]]
    maps = [_shrink(unpack(Packed(**fit["residuals"]))) for fit in shown]
    largest = max((float(np.nanmax(np.abs(each))) for each in maps if np.isfinite(each).any()), default=0.0)
    for fit, residuals in zip(shown, maps, strict=True):
        c = fit["coefficient"]
        height, width = c["height_px"] / len(residuals), c["width_px"] / len(residuals[0])
        cells = tuple(
            Cell(
                x=(col * width, (col + 1) * width),
                y=(-(row + 1) * height, -row * height),
                share=float(value / (largest or 1.0)) if math.isfinite(value) else None,
                told=f"{100.0 * value:+.2g} %" if math.isfinite(value) else "unknown",
            )
            for (row, col), value in np.ndenumerate(residuals)
        )
        yield Figure(
            part=f"f/{c['f_number']:g}",
            x=Axis(label="column [px]"),
            y=Axis(label="row [px]", is_downward=True),
            cells=cells,
            note=f"Channel {c['channel']}; full shade: ±{100.0 * largest:.2g} %, orange: less light",
        )


def _shrink(residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return means over neighbours; no side has more cells than columns are shown."""
    step = math.ceil(max(residuals.shape) / _COLUMNS)
    rows, cols = (range(0, size, step) for size in residuals.shape)
    blocks = [[residuals[row : row + step, col : col + step] for col in cols] for row in rows]
    return np.array([[np.nanmean(b) if np.isfinite(b).any() else np.nan for b in line] for line in blocks])


def _list(result: Node) -> list[Node]:
    return sorted((fit["coefficient"] for fit in result["channel_fits"]), key=lambda c: float(c["f_number"]))


def _channels(result: Node) -> list[str]:
    channels = list(dict.fromkeys(fit["coefficient"]["channel"] for fit in result["channel_fits"]))
    return sorted(channels, key=lambda name: name != choose_channel(channels))


PLOTS: Final = (
    Plot(name="surface", title="Surface", build=_build_surface),
    Plot(
        name="corner",
        title="Corner per aperture",
        build=_build_corner,
        most_printed=1,
        note="Bars: two standard uncertainties",
    ),
    Plot(name="falloff", title="Falloff along the radius", build=_build_falloff, most_printed=1),
    Plot(name="residuals", title="Residuals", build=_build_residuals, most_printed=MOST),
)
