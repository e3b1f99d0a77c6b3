"""Statements of a certificate about a result, alike for all methods: coefficients with U, budgets."""

import math
from collections.abc import Iterable
from typing import Any

from radiometry.fitting.curve import coverage_factor
from radiometry.methods import get_method
from store.codec import decode, drop_absent, encode

Json = dict[str, Any]

_COVERAGE_FACTOR = 2.0
"""Of a figure whose method states none: about 95 % of a normal distribution."""

_IDENTITY = ("name", "iso", "f_number", "band", "channel", "model")


def state_coefficients(method: str, result: Json, figures: Iterable[Json]) -> list[Json]:
    """The figures of a version, each with its expanded uncertainty, coverage factor and degrees of freedom.

    One that is relative only has no expanded uncertainty: nobody may take it for traceable.

    ``figures`` : with the names of `radiometry.fitting.evidence.CoefficientValue`
    """
    spec = get_method(method)
    listed = spec.list_coefficients(decode(spec.result, result))
    known = {tuple(getattr(each, name) for name in _IDENTITY): each for each in listed}
    rows = []
    for figure in figures:
        value = known.get(tuple(figure.get(name) for name in _IDENTITY))
        dof = value.effective_dof if value else None
        factor = value.coverage_factor if value else None
        if factor is None:
            factor = _COVERAGE_FACTOR if dof is None else coverage_factor(dof)
        stated = {
            "expanded_uncertainty": factor * figure["standard_uncertainty"],
            "coverage_factor": factor,
            "effective_dof": dof if dof is None or math.isfinite(dof) else None,
        }
        scope = spec.find_scope(figure["name"], figure["flags"])
        own = {name: each for name, each in figure.items() if name not in stated}
        rows.append(
            drop_absent({**own, **({} if scope == "relative_only" else stated), "uncertainty_scope": scope})
        )
    return rows


def state_budgets(method: str, result: Json) -> list[Json]:
    """Return the uncertainty budget of each coefficient that has one, with what it holds for."""
    spec = get_method(method)
    return [
        {**budget.holds_for, "lines": [drop_absent(encode(line)) for line in budget.lines]}
        for budget in spec.list_budgets(decode(spec.result, result))
    ]


def state_orientation(orientation: Any) -> list[Json]:  # noqa: ANN401  of a rig
    """Return each quantity of the orientation of a rig's cameras with its expanded uncertainty."""
    rows = []
    for pose in orientation.poses:
        for name, dof in pose.effective_dof.items():
            quantity, factor = encode(getattr(pose, name)), coverage_factor(dof)
            expanded = {
                "expanded_uncertainty": factor * quantity["standard_uncertainty"],
                "coverage_factor": factor,
                "effective_dof": dof,
            }
            rows.append({**quantity, "camera": pose.camera, "name": name, **expanded})
    return rows
