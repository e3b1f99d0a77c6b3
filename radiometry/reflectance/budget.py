"""Uncertainty budgets of K per band in the form in which a certificate states them."""

from dataclasses import asdict, dataclass

from radiometry.fitting.evidence import BudgetEntry
from radiometry.reflectance.results import Fit
from radiometry.specification.coefficients import Budget


@dataclass(frozen=True, kw_only=True)
class BudgetLine(BudgetEntry):
    """One source of u(K).

    Attributes
    ----------
    u : float
        Contribution in the unit of K.
    """

    u: float


def list_budgets(fitted: Fit) -> tuple[Budget, ...]:
    """Return the budget of each band."""
    return tuple(
        Budget(
            holds_for={"band": fit.coefficient.band},
            lines=tuple(
                BudgetLine(**asdict(entry), u=entry.u_rel * abs(fit.coefficient.reflectance_k))
                for entry in fit.budget
            ),
        )
        for fit in fitted.band_fits
    )
