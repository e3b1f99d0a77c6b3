"""Uncertainty budgets of the corner falloff in the form in which a certificate states them."""

import math
from dataclasses import dataclass

from radiometry.fitting.evidence import BudgetEntry
from radiometry.specification.coefficients import Budget
from radiometry.vignetting.results import Fit


@dataclass(frozen=True, kw_only=True)
class BudgetLine(BudgetEntry):
    """One source of u(corner falloff); ``u_rel`` is relative to the light in the corner.

    Attributes
    ----------
    u : float
        Contribution to the falloff.
    """

    u: float


def list_budgets(fitted: Fit) -> tuple[Budget, ...]:
    """Return the budget of the corner falloff of each f-number and channel.

    Returns
    -------
    tuple of Budget
        One budget for each, none in versions from before budgets were kept.
    """
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
