"""The uncertainty budget of K in the form in which a certificate states it."""

from dataclasses import dataclass

from radiometry.fitting.sources import READING, SCATTER
from radiometry.luminance.results import IsoFit


@dataclass(frozen=True, kw_only=True)
class BudgetLine:
    """One source of u(K).

    ``input_uncertainty``, ``input_unit`` : standard uncertainty of the source itself
    ``sensitivity`` : ``u_rel`` per ``input_uncertainty`` [1/input_unit], None where the input is exact
    ``u_rel``, ``u`` : its contribution to u(K), relative and in K's unit; ``variance_share`` : of u(K)^2
    """

    source: str
    kind: str
    input_uncertainty: float
    input_unit: str
    sensitivity: float | None
    u_rel: float
    u: float
    variance_share: float


def explain_budget(iso_fit: IsoFit) -> tuple[BudgetLine, ...]:
    """Say of each source how uncertain it is by itself, and how strongly K feels it.

    Model: u_j(K) / K = c_j u(x_j)   c_j the sensitivity of K to a source that all points share in part: an
    f-number enters squared (c = 2 where every frame has the same), and less where several average out [1].
    A frame's own scatter averages: c = 0.3 for eleven frames alike. Birge's excess is a statement about K
    itself: its sensitivity is 1.
    References [1] JCGM 100:2008, 5.1.3 and 5.2.2
    """
    coefficient = iso_fit.coefficient
    chosen = next(model for model in iso_fit.models if model.model == coefficient.model)
    inputs = {
        "dark signal": (coefficient.dark_signal_standard_uncertainty_dn, "DN"),
        "f-number": (coefficient.f_number_u_rel, "1"),
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
