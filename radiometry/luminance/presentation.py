"""Plots, key figures, uncertainty budget and certificate text of a luminance version."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, Final

import numpy as np

from radiometry.drawing.figure import Axis, Figure, Mark, Plot, Series
from radiometry.drawing.text import label_axis, write_exposure, write_quantity
from radiometry.fitting.sources import DARK_CURRENT, READING, SCATTER, predict
from radiometry.luminance.results import IsoFit
from radiometry.records import Record
from radiometry.specification.certificate import CertificateText, Column, KeyFigure, of_coefficient

Node = dict[str, Any]
Rows = Callable[[], Sequence[Any]]

_X: Final = "X = t S L / f²  [cd·s/m²]"
_ALONG: Final = 80
_TAKEN: Final = Axis(label="time taken, UTC", is_time=True)
_RULES: Final = {
    "simple": "The verdict compares the largest deviation of a point from the luminance meter with the "
    "tolerance. Measurement uncertainty is not taken into account in this decision.",
    "guarded": "Decision rule (JCGM 106:2012, guarded acceptance): K at each f-number must be within "
    "the tolerance with a probability of 95 % to either side: 1.645 u(K) of many degrees of freedom.",
    "shared_risk": "Decision rule (JCGM 106:2012, shared risk): the largest deviation of a point from the "
    "luminance meter must not exceed the tolerance, and the expanded uncertainty of K must not exceed it "
    "either. The parties share the risk of a wrong decision.",
}


def _build_signal(result: Node, _: Rows) -> Iterator[Figure]:
    """The signal against X, in logarithms, and against ln X alone: figures 9 and 10 of the procedure."""
    for part, log_x, log_y in (
        ("Linear", False, False),
        ("Logarithmic", True, True),
        ("Semilogarithmic", True, False),
    ):
        semilog = log_x and not log_y
        yield Figure(
            part=part,
            note="Line: the model N = a ln X + b of the procedure" if semilog else "",
            x=_signal_axis(_X, logarithmic=log_x),
            y=_signal_axis("signal above dark [DN]", logarithmic=log_y),
            series=tuple(
                Series(
                    name=_name(c),
                    marks=tuple(_mark(p, p["rhs"], p["adjusted_signal_dn"]) for p in points),
                    model=_sample(_find_semilog(fit) if semilog else c, points, log_x=log_x, log_y=log_y),
                )
                for fit, (c, points) in zip(result["iso_fits"], _by_iso(result), strict=True)
            ),
        )


def _signal_axis(label: str, *, logarithmic: bool) -> Axis:
    added = ", logarithmic" if logarithmic else ""
    return Axis(label=label + added, logarithmic=logarithmic, include=() if logarithmic else (0.0,))


def _find_semilog(fit: Node) -> Node | None:
    """Return the fit in ln X; None where there were too few points for it."""
    return next((each for each in fit.get("models") or () if each["model"] == "semilog"), None)


def _sample(
    model: Node | None, points: Sequence[Node], *, log_x: bool, log_y: bool
) -> tuple[tuple[float, float], ...]:
    if not points or model is None:
        return ()
    rhs = [p["rhs"] for p in points]
    # a power or a logarithm has no value at 0
    low, high = min(rhs) / (1.0 if log_x else 50.0), max(rhs)
    along = np.geomspace(low, high, _ALONG) if log_x else np.linspace(low, high, _ALONG)
    signal = predict(model["model"], np.asarray(model["parameters"]), along)
    kept = signal > 0.0 if log_y else np.isfinite(signal)
    return tuple(zip(along[kept].tolist(), signal[kept].tolist(), strict=True))


def _draw_residuals(result: Node, x: Axis, place: Callable[[Node], float | None]) -> tuple[Figure, ...]:
    """Return residuals against what ``place`` returns of a point; points without it are not drawn."""
    limit = 100.0 * result["tolerance_rel"]
    series = tuple(
        Series(
            name=_name(c),
            marks=tuple(
                _mark(p, at, 100.0 * p["residual_rel"])
                for p in points
                if p.get("residual_rel") is not None and (at := place(p)) is not None
            ),
        )
        for c, points in _by_iso(result)
    )
    if not _spread(series):
        return ()
    # one scale for all plots of residuals, symmetric
    used = [abs(100.0 * p["residual_rel"]) for p in result["points"] if p["used"] and p.get("rhs")]
    widest = 1.1 * max([limit, *used])
    y = Axis(label="residual [% of L]", include=(-widest, widest))
    levels = (-limit, 0.0, limit)
    return (Figure(x=x, y=y, series=series, band=(-limit, limit), levels=levels, cuts_left_out=True),)


def _build_by_luminance(result: Node, _: Rows) -> tuple[Figure, ...]:
    x = Axis(label="L meter [cd/m²], logarithmic", logarithmic=True)
    return _draw_residuals(result, x, lambda p: p["luminance_cd_m2"])


def _build_by_f_number(result: Node, _: Rows) -> tuple[Figure, ...]:
    x = Axis(label="f-number", logarithmic=True, ticks=_tick(result, "f_number", "f/{:g}"))
    return _draw_residuals(result, x, lambda p: float(p["f_number"]))


def _build_by_time(result: Node, rows: Rows) -> tuple[Figure, ...]:
    times = {row.frame: at for row in rows() if (at := _read_time(row)) is not None}
    return _draw_residuals(result, _TAKEN, lambda p: times.get(p["frame"]))


def _build_apertures(result: Node, _: Rows) -> tuple[Figure, ...]:
    """One line per K: at each f-number, then of the ISO value."""
    series: list[Series] = []
    names: list[str] = []
    unit = result["iso_fits"][0]["coefficient"]["luminance_k_unit"]
    for place, (c, _points) in enumerate(_by_iso(result)):
        marks = []
        of = [*((f"f/{a['f_number']:g}", a) for a in c.get("apertures") or ()), ("all", c)]
        for name, each in of:
            k, u = each["luminance_k"], each["expanded_uncertainty"]
            told = f"{name if name != 'all' else 'all f-numbers'}: {write_quantity(k, u, unit)} (95 %)"
            marks.append(Mark(x=k, y=-float(len(names)), low=k - u, high=k + u, name=_name(c), told=(told,)))
            names.append(f"ISO {c['iso']:g} {name}")
        series.append(Series(name=_name(c), marks=tuple(marks), place=place))
    if len(names) == len(series):
        return ()
    ticks = tuple((-float(n), name) for n, name in enumerate(names))
    y = Axis(label="", ticks=ticks, include=(0.5, 0.5 - len(names)))
    return (Figure(x=Axis(label=label_axis("K", unit)), y=y, series=tuple(series)),)


def _draw_dark(result: Node, rows: Rows, x: Axis, place: Callable[[Any], float | None]) -> tuple[Figure, ...]:
    """Return the dark frames' signal, a series per ISO value."""
    coefficients = [c for c, _ in _by_iso(result)]
    darks = [row for row in rows() if row.role == "dark" and row.exposure and row.statistics]
    series = []
    for n, c in enumerate(coefficients):
        marks = []
        for row in darks:
            at = place(row)
            if row.exposure.iso != c["iso"] or at is None:
                continue
            signal = row.measure(c["channel"])
            u = 2.0 * signal.standard_uncertainty_dn
            told = (
                f"{write_exposure(row.exposure.exposure_time_s)}, ISO {row.exposure.iso:g}",
                f"{write_quantity(signal.value_dn, u, 'DN')} (95 %)",
            )
            mean = signal.value_dn
            marks.append(Mark(x=at, y=mean, low=mean - u, high=mean + u, name=row.frame, told=told))
        series.append(Series(name=_name(c), marks=tuple(marks), place=n))
    shown = tuple(each for each in series if each.marks)
    return (Figure(x=x, y=Axis(label="dark signal [DN]"), series=shown),) if _spread(shown) else ()


def _spread(series: Sequence[Series]) -> bool:
    """Return True if marks stand at two places of x or more: at one, a plot shows no dependence on x."""
    return len({mark.x for each in series for mark in each.marks}) > 1


def _build_dark_by_iso(result: Node, rows: Rows) -> tuple[Figure, ...]:
    x = Axis(label="ISO value", logarithmic=True, ticks=_tick(result, "iso", "{:g}"))
    return _draw_dark(result, rows, x, lambda row: float(row.exposure.iso))


def _build_dark_by_exposure(result: Node, rows: Rows) -> tuple[Figure, ...]:
    times = {row.exposure.exposure_time_s for row in rows() if row.role == "dark" and row.exposure}
    ticks = tuple((float(time_s), write_exposure(time_s)) for time_s in sorted(times))
    x = Axis(label="exposure time", logarithmic=True, ticks=ticks)
    return _draw_dark(result, rows, x, lambda row: float(row.exposure.exposure_time_s))


def _read_time(row: Any) -> float | None:  # noqa: ANN401  a row of the fit
    """Return when a frame was taken, in seconds since 1970; a time without an offset is read as UTC."""
    if row.taken_at is None:
        return None
    at = datetime.fromisoformat(row.taken_at)
    return (at if at.tzinfo else at.replace(tzinfo=UTC)).timestamp()


def _by_iso(result: Node) -> Iterator[tuple[Node, list[Node]]]:
    for fit in result["iso_fits"]:
        c = fit["coefficient"]
        yield c, [p for p in result["points"] if p["iso"] == c["iso"] and p.get("rhs")]


def _name(c: Node) -> str:
    return f"ISO {c['iso']:g}"


def _tick(result: Node, name: str, form: str) -> tuple[tuple[float, str], ...]:
    return tuple((value, form.format(value)) for value in sorted({p[name] for p in result["points"]}))


def _mark(p: Node, x: float, y: float) -> Mark:
    exposure = f"{write_exposure(p['exposure_time_s'])}, f/{p['f_number']:g}, ISO {p['iso']:g}"
    told = [
        f"{p['scene']}, {exposure}",
        f"signal {p['adjusted_signal_dn']:.5g} DN, L {p['luminance_cd_m2']:.4g} cd/m²",
    ]
    if p["used"]:
        told.append(f"residual {100.0 * p['residual_rel']:+.2f} % of L")
    return Mark(
        x=x,
        y=y,
        name=p["frame"],
        told=tuple(told),
        frame_id=p.get("frame_id", ""),
        left_out="" if p["used"] else p["left_out"],
    )


PLOTS: Final = (
    Plot(
        name="signal",
        title="Signal and exposure \N{MULTIPLICATION SIGN} luminance",
        build=_build_signal,
        is_wide=True,
        most_printed=2,
    ),
    Plot(
        name="apertures",
        title="K per aperture",
        note="95 % intervals; “all” is the K of the ISO value",
        build=_build_apertures,
    ),
    Plot(name="residuals-f-number", title="Residuals and f-number", leads=True, build=_build_by_f_number),
    Plot(name="residuals-luminance", title="Residuals and luminance", leads=True, build=_build_by_luminance),
    Plot(name="residuals-time", title="Residuals and time", leads=True, build=_build_by_time),
    Plot(
        name="residuals-signal",
        title="Residuals and signal",
        leads=True,
        most_printed=1,
        build=lambda result, _: _draw_residuals(
            result,
            Axis(label="signal above dark [DN], logarithmic", logarithmic=True),
            lambda p: p["adjusted_signal_dn"],
        ),
    ),
    Plot(
        name="dark-iso",
        title="Dark signal and ISO",
        note="Dark frames of the campaign in its present region",
        build=_build_dark_by_iso,
    ),
    Plot(name="dark-exposure", title="Dark signal and exposure time", build=_build_dark_by_exposure),
    Plot(
        name="dark-time",
        title="Dark signal and time",
        build=lambda result, rows: _draw_dark(result, rows, _TAKEN, _read_time),
    ),
)


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    return tuple(
        of_coefficient(_name(c), "K", c, "luminance_k", passed=fit.get("passed"))
        for fit in result["iso_fits"]
        for c in (fit["coefficient"],)
    )


class BudgetLine(Record):
    """One source of u(K)."""

    source: str
    kind: str  # "A" (evaluated from scatter) or "B" (evaluated by other means)
    input_uncertainty: float
    input_unit: str
    sensitivity: float | None  # `u_rel` per `input_uncertainty`; None if the input is exact
    u_rel: float
    u: float  # in the unit of K
    variance_share: float


def explain_budget(iso_fit: IsoFit) -> tuple[BudgetLine, ...]:
    """List the uncertainty of each source and the sensitivity c of K to it: u_j(K) / K = c_j u(x_j).

    An f-number enters squared (c = 2), less where several average out (JCGM 100:2008, 5.1.3 and 5.2.2).
    """
    coefficient = iso_fit.coefficient
    chosen = next(model for model in iso_fit.models if model.model == coefficient.model)
    inputs = {
        "dark signal": (coefficient.dark_signal_standard_uncertainty_dn, "DN"),
        DARK_CURRENT: (coefficient.dark_rate_standard_uncertainty_dn_per_s or 0.0, "DN/s"),
        "f-number": (
            coefficient.f_number_u_rel if chosen.f_number_u_rel is None else chosen.f_number_u_rel,
            "1",
        ),
        "exposure time": (coefficient.exposure_time_u_rel, "1"),
        "meter calibration": (coefficient.meter_calibration_u_rel, "1"),
    }
    if chosen.meter_repeatability_rel is not None:
        inputs[READING] = (chosen.meter_repeatability_rel, "1")
    if chosen.frame_scatter_rel is not None:
        inputs[SCATTER] = (chosen.frame_scatter_rel, "1")
    lines = []
    for entry in iso_fit.budget:
        uncertainty, unit = inputs.get(entry.source, (entry.u_rel, "1"))
        lines.append(
            BudgetLine(
                source=entry.source,
                kind=entry.kind,
                input_uncertainty=uncertainty,
                input_unit=unit,
                sensitivity=entry.u_rel / uncertainty if uncertainty > 0.0 else None,
                u_rel=entry.u_rel,
                u=entry.u_rel * abs(coefficient.luminance_k),
                variance_share=entry.variance_share,
            )
        )
    return tuple(lines)


def state_conditions(parameters: Mapping[str, Any], result: Mapping[str, Any]) -> tuple[str, ...]:
    """State the decision rule of a version, and the light and distance that its K holds for."""
    rule = parameters.get("acceptance") or "simple"
    risks = [fit["beyond_tolerance_risk"] for fit in result["iso_fits"] if "beyond_tolerance_risk" in fit]
    risk = ""
    if risks:
        risk = f" K is off by more than the tolerance with a probability of up to {max(risks):.1%}."
    elif rule != "simple":
        risk = " K is relative only: its expanded uncertainty is unknown, and this rule accepts nothing."
    spectral = result.get("spectral") or {"lamp": "not recorded", "camera_response": "not recorded"}
    index = f", f1' = {spectral['f1_prime']:.0%}" if spectral.get("f1_prime") is not None else ""
    distance_m = parameters.get("focus_distance_m")
    distance = "not recorded" if distance_m is None else f"{distance_m:g} m"
    return (
        f"{_RULES[rule]}{risk}",
        (
            f"K holds for light of the lamp of its calibration. Lamp: {spectral['lamp']}. Camera response: "
            f"{spectral['camera_response']}{index}."
        ),
        f"Distance to the calibrated surface: {distance}.",
    )


def describe_fits(result: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield for each ISO value what K is valid for, and its parameters."""
    for c in [fit["coefficient"] for fit in result["iso_fits"]]:
        ranges = ("f_number_range", "signal_range_dn", "rhs_range")
        f_numbers, signals, x = (" to ".join(f"{end:.5g}" for end in c[name]) for name in ranges)
        valid = (
            f"Valid for {', '.join(map(write_exposure, c['exposure_times_s']))}; f/{f_numbers}; signals of "
            f"{signals} DN above dark; X of {x} cd·s/m²; channel {c['channel']}; exposure values "
            f"{c['exposure_basis']}. An f-number not listed below has u = {100 * c['f_number_u_rel']:.2f} %."
        )
        parameters = ", ".join(map("{} = {:.8g}".format, c["parameter_names"], c["parameters"]))
        covariance = "; ".join(", ".join(f"{value:.4e}" for value in row) for row in c["covariance"])
        model = (
            f"Model {c['model']}: {parameters}; covariance {covariance} (without the meter's calibration)."
        )
        yield _name(c), f"{valid}\n{model}"


CERTIFICATE: Final = CertificateText(
    procedure="Luminance coefficient K of a camera against a luminance meter, one per ISO value and one at "
    "each f-number, following the standard operating procedure “Drone Camera Calibration”; K fitted by "
    "generalised least squares",
    equation="N - D = K X,  X = t S L / f²",
    headlines=frozenset({"luminance_k"}),
    columns=(
        Column(name="luminance_cd_m2", head="L [cd/m²]", share=0.9),
        Column(name="adjusted_signal_dn", head="N - D"),
        Column(name="residual_rel", head="error of L", form="percent"),
    ),
    state=state_conditions,
    verdicts=lambda result: [(fit["largest_residual_rel"], fit["passed"]) for fit in result["iso_fits"]],
    describe=describe_fits,
)
