"""Plots, key figures, uncertainty budgets and certificate text of a reflectance version."""

import math
from collections.abc import Iterator
from dataclasses import asdict
from datetime import datetime
from typing import Any, Final

import numpy as np

from radiometry.drawing.figure import MOST, Axis, Figure, Mark, Plot, Series
from radiometry.drawing.text import label_axis, write_quantity, write_unit
from radiometry.fitting.evidence import BudgetEntry
from radiometry.frame.multispectral import label_band
from radiometry.reflectance.results import HALF_HOUR_S, Fit, Knot, interpolate
from radiometry.specification import certificate

Node = dict[str, Any]

_KNOT: Final = ("at_s", "reflectance_k", "u_rel")
_MARGIN_S: Final = 300.0
_STEPS: Final = 81


def _build_visits(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401  no rows are needed
    """K of each visit, relative to the K of its band; by number where frames state no time."""
    points = [p for p in result["points"] if p.get("reflectance_k") is not None]
    timed = all(p.get("at_s") is not None for p in points)
    series = []
    for fit in result["band_fits"]:
        c = fit["coefficient"]
        marks = tuple(
            Mark(
                x=p["at_s"] if timed else float(p.get("visit") or 1),
                y=_compare(p["reflectance_k"], c),
                name=p["frame"],
                told=(
                    f"band {label_band(c['band'])}, visit {p.get('visit') or 1}",
                    f"K {p['reflectance_k']:.5g} {write_unit(c['reflectance_k_unit'])}",
                ),
                frame_id=p.get("frame_id", ""),
                left_out="" if p["used"] else p.get("left_out") or "not used",
            )
            for p in points
            if p["band"] == c["band"]
        )
        series.append(Series(name=label_band(c["band"]), marks=marks, line=_join(c, timed=timed)))
    if any(each.marks for each in series):
        yield Figure(
            x=Axis(label="time taken, UTC" if timed else "visit to the panel", is_time=timed),
            y=Axis(label="K / K of the band [% difference]", include=(-1.0, 1.0)),
            levels=(0.0,),
            series=tuple(series),
        )


def _build_time(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    """K relative to that of its band: the visits to the panel, K between them, and the flight's frames.

    Bars and swath are expanded uncertainties without what all visits share, which does not bend the line.
    """
    flight_s = [datetime.fromisoformat(each).timestamp() for each in result.get("flight", ())]
    for place, fit in enumerate(result["band_fits"]):
        c = fit["coefficient"]
        knots = [Knot(**{name: each.get(name) for name in _KNOT}) for each in c["knots"]]
        times = [knot.at_s for knot in knots if knot.at_s is not None]
        start_s = times[0] if len(times) == len(knots) else None
        factor = 100.0 * c.get("coverage_factor", 2.0)
        near_s: list[float] = []
        curve: list[tuple[float, float, float]] = []
        if start_s is not None:
            ends_s = [start_s - _MARGIN_S, times[-1] + (_MARGIN_S if len(times) > 1 else HALF_HOUR_S)]
            near_s = [at for at in flight_s if ends_s[0] - HALF_HOUR_S <= at <= ends_s[1] + HALF_HOUR_S]
            ends_s += near_s
            for at_s in sorted({*times, *np.linspace(min(ends_s), max(ends_s), _STEPS).tolist()}):
                follow = c.get("interpolation", "linear") == "linear"
                found = interpolate(knots, at_s=at_s, follow=follow, drift_rel=c.get("drift_half_hour_rel"))
                u = factor * math.hypot(found.u_rel, found.drift_u_rel)
                curve.append(((at_s - start_s) / 60.0, _compare(found.value, c), u))
        visits = [
            (float(n) if start_s is None else (knot.at_s or 0.0) / 60.0 - start_s / 60.0, knot)
            for n, knot in enumerate(knots, start=1)
        ]
        bars = [(x, _compare(knot.reflectance_k, c), factor * knot.u_rel) for x, knot in visits]
        marks = [Mark(x=x, y=y, low=y - u, high=y + u, name="visit to the panel") for x, y, u in bars]
        for p in result["points"]:
            if p["used"] and p["band"] == c["band"] and p.get("reflectance_k") is not None:
                at = p.get("at_s")
                x = float(p.get("visit") or 1) if start_s is None or at is None else (at - start_s) / 60.0
                y = _compare(p["reflectance_k"], c)
                marks.append(Mark(x=x, y=y, name=p["frame"], frame_id=p.get("frame_id", "")))
        ends = [y + sign * u for _, y, u in (*curve, *bars) for sign in (-1.0, 1.0)]
        foot = min(ends) - 0.15 * (max(ends) - min(ends))
        yield Figure(
            part=label_band(c["band"]),
            x=Axis(
                label="visit to the panel" if start_s is None else "since the first visit to the panel [min]"
            ),
            y=Axis(label="K / K of the band [% difference]", include=(-1.0, 1.0, foot, *ends)),
            levels=(0.0,),
            series=(
                Series(
                    marks=tuple(marks),
                    line=tuple((x, y) for x, y, _ in curve),
                    swath=tuple((x, y - u, y + u) for x, y, u in curve),
                    place=place,
                ),
            ),
            moments=tuple((at - start_s) / 60.0 for at in near_s if start_s is not None),
            moments_are="frames of the flight",
        )


def _compare(k: float, c: Node) -> float:
    """Return the difference of K from that of its band [%]."""
    return float(100.0 * (k / c["reflectance_k"] - 1.0))


def _join(c: Node, *, timed: bool) -> tuple[tuple[float, float], ...]:
    """Return the line between the visits, where the version follows it in time."""
    knots = [knot for knot in c["knots"] if knot.get("at_s") is not None]
    if not timed or c.get("interpolation", "linear") != "linear":
        return ()
    return tuple((knot["at_s"], _compare(knot["reflectance_k"], c)) for knot in knots)


def _build_bands(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    coefficients = [fit["coefficient"] for fit in result["band_fits"]]
    known = all(c.get("wavelength_nm") for c in coefficients)
    xs = [float(c["wavelength_nm"]) if known else float(n) for n, c in enumerate(coefficients, start=1)]
    air = 30.0 if known else 0.5
    series = []
    for x, c in zip(xs, coefficients, strict=True):
        k, u = c["reflectance_k"], c["expanded_uncertainty"]
        told = (f"{write_quantity(k, u, c['reflectance_k_unit'])} (95 %)",)
        mark = Mark(x=x, y=k, low=k - u, high=k + u, name=f"band {label_band(c['band'])}", told=told)
        series.append(Series(name=label_band(c["band"]), marks=(mark,)))
    yield Figure(
        x=Axis(label="wavelength [nm]" if known else "band, in turn", include=(min(xs) - air, max(xs) + air)),
        y=Axis(label=label_axis("K", coefficients[0]["reflectance_k_unit"]), include=(0.0,)),
        series=tuple(series),
    )


PLOTS: Final = (
    Plot(name="visits", title="Panel visits in time", build=_build_visits, is_wide=True),
    Plot(name="bands", title="K per band", build=_build_bands, note="95 % intervals", most_printed=1),
    Plot(
        name="time",
        title="K in time",
        build=_build_time,
        note="Bars and bands: expanded uncertainty without what all visits share",
        most_printed=MOST,
    ),
)


def list_key_figures(result: dict[str, Any]) -> tuple[certificate.KeyFigure, ...]:
    coefficients = (fit["coefficient"] for fit in result["band_fits"])
    return tuple(
        certificate.of_coefficient(c["band"], "Reflectance K", c, "reflectance_k") for c in coefficients
    )


class BudgetLine(BudgetEntry):
    """One source of u(K)."""

    u: float  # in the unit of K


def list_budgets(fitted: Fit) -> tuple[certificate.Budget, ...]:
    return tuple(
        certificate.Budget(
            holds_for={"band": fit.coefficient.band},
            lines=tuple(
                BudgetLine(**asdict(entry), u=entry.u_rel * abs(fit.coefficient.reflectance_k))
                for entry in fit.budget
            ),
        )
        for fit in fitted.band_fits
    )


CERTIFICATE: Final = certificate.CertificateText(
    procedure="Reflectance coefficient K of each band of a camera with its sunshine sensor, from frames of a "
    "panel of known reflectance",
    equation="R cos θ = K I_sq / I_ss, where I_sq is the band's signal after black-level and vignetting "
    "correction, and I_ss the reading of the sunshine sensor, converted to a level surface unless a flag or "
    "a parameter states otherwise",
    headlines=frozenset({"reflectance_k"}),
    vignetting="as stated in each file",
    columns=(
        certificate.FRAME,
        certificate.Column(name="band", head="band", form="text"),
        certificate.Column(name="visit", head="capture", share=0.7),
        certificate.Column(name="i_sq", head="I_sq"),
        certificate.Column(name="i_ss", head="I_ss"),
        certificate.Column(name="i_ss_oriented", head="as oriented"),
        certificate.Column(name="i_ss_basis", head="I_ss is", form="text"),
        certificate.Column(name="sunshine_spread_rel", head="s(I_ss) / I_ss", form="percent"),
        certificate.Column(name="gradient_rel", head="gradient", form="percent"),
        certificate.Column(name="panel_reflectance", head="R of panel"),
        certificate.Column(name="reflectance_k", head="K"),
        certificate.Column(name="residual_rel", head="deviation", form="percent"),
    ),
    holds_for_lens=False,
    statements=(
        (
            "K belongs to the camera and the sunshine sensor named here as a pair, and to the light of "
            "the day on which the panel was photographed."
        ),
        "Vignetting is corrected as stated in each file for its camera.",
    ),
)
