"""What a certificate states of a stored result, in one form for all methods: coefficients with U, budgets."""

from collections.abc import Iterable
from typing import Any

from radiometry.methods import get_method
from store.codec import decode, drop_absent, encode

Json = dict[str, Any]

COVERAGE_FACTOR = 2.0
"""Of a figure whose method states none: about 95 % of a normal distribution."""


def state_coefficients(method: str, result: Json, figures: Iterable[Json]) -> list[Json]:
    """The figures of a version, each with its expanded uncertainty and coverage factor.

    ``figures`` : with the names of `radiometry.fitting.evidence.CoefficientValue`
    """
    expanded = get_method(method).list_expanded(result)
    rows = []
    for figure in figures:
        key = figure["name"], figure.get("iso"), figure.get("band")
        value, factor = expanded.get(key, (COVERAGE_FACTOR * figure["standard_uncertainty"], COVERAGE_FACTOR))
        rows.append(drop_absent({**figure, "expanded_uncertainty": value, "coverage_factor": factor}))
    return rows


def state_budgets(method: str, result: Json) -> list[Json]:
    """Return the uncertainty budget of each coefficient that has one, with what it holds for."""
    spec = get_method(method)
    return [
        {**budget.holds_for, "lines": [drop_absent(encode(line)) for line in budget.lines]}
        for budget in spec.list_budgets(decode(spec.result, result))
    ]
