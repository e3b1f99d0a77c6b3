"""Uncertainty budget of K in the form in which a certificate states it."""

from dataclasses import dataclass

from radiometry.fitting.sources import DARK_CURRENT, READING, SCATTER
from radiometry.luminance.results import IsoFit


@dataclass(frozen=True, kw_only=True)
class BudgetLine:
    """One source of u(K).

    Attributes
    ----------
    source : str
        Name of the source.
    kind : str
        "A" (evaluated from scatter) or "B" (evaluated by other means).
    input_uncertainty : float
        Standard uncertainty of the source itself, in `input_unit`.
    input_unit : str
        Unit of the source.
    sensitivity : float or None
        `u_rel` per `input_uncertainty` [1/input_unit]; None if the input is exact.
    u_rel : float
        Relative contribution to u(K).
    u : float
        Contribution to u(K) in the unit of K.
    variance_share : float
        Fraction of u(K)^2, 0 to 1.
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
    """List the uncertainty of each source and the sensitivity of K to it.

    Parameters
    ----------
    iso_fit : IsoFit
        Fit of one ISO value.

    Returns
    -------
    tuple of BudgetLine
        One line per source.

    Notes
    -----
    u_j(K) / K = c_j u(x_j), with c_j the sensitivity of K to a source that all
    points share in part. An f-number enters squared (c = 2 if every frame has the
    same), and less if several average out [1]_. A frame's own scatter averages: c =
    0.3 for eleven frames alike. Birge's excess is a statement about K itself: its
    sensitivity is 1.

    References
    ----------
    .. [1] JCGM 100:2008, 5.1.3 and 5.2.2, doi:10.59161/JCGM100-2008E
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
