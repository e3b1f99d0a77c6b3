"""Figures of a road from draws of its field, and the verdict of three values on them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from radiometry.road.grid import GridPoint, inside
from radiometry.road.results import ClassResult, CriterionResult, FigureResult, Verdict
from radiometry.road.rules import find_rule
from radiometry.road.site import Criterion, Requirement, Road

Array = NDArray[np.float64]
Drawn = Mapping[str, Array]
"""Draws of each figure."""

CONFIDENCE = 0.95
GUARD = 1.645
"""Standard uncertainties between a value and a limit for a probability of 95 % (JCGM 106)."""

_UNITS = {"e_av": "lx", "e_min": "lx", "pdi": "mW/(lx*m2)"}
_ORDER: Sequence[Verdict] = ("does_not", "not_decided", "not_measured", "conforms")


def draw_figures(
    road: Road, points: Sequence[GridPoint], judged: NDArray[np.intp], light: Array
) -> dict[str, Array]:
    """Compute the figures of the judged part from draws of E at all points of the grid, (draws, points)."""
    ours = light[:, judged]
    average, least = ours.mean(axis=1), ours.min(axis=1)
    factor = road.requirement.maintenance_factor or 1.0
    found = {"e_av": factor * average, "e_min": factor * least}
    found |= {"u_0": least / average, "average_to_min": average / least}
    if edges := [each.name for each in road.site.strips if each.kind == "edge"]:
        parts = np.array([each.part for each in points])
        sides = [light[:, parts == e].mean(axis=1) / light[:, parts == inside(e)].mean(axis=1) for e in edges]
        # the worse side as a whole: the least of each draw is biased where both are alike
        found["eir"] = min(sides, key=lambda each: float(np.median(each)))
    if road.conditions.power_w is not None:
        area = road.site.measure_area({points[n].part for n in judged})
        found["pdi"] = 1e3 * road.conditions.power_w / (average * area)
    return found


def summarise(figure: str, draws: Array) -> FigureResult:
    """Return the median of a figure's draws with the interval that has it with 95 %."""
    low, value, high = np.quantile(draws, (0.025, 0.5, 0.975)).tolist()
    return FigureResult(
        figure=figure,
        value=value,
        standard_uncertainty=float(draws.std()),
        low=low,
        high=high,
        expanded_uncertainty=(high - low) / 2.0,
        unit=_UNITS.get(figure, "1"),
    )


def judge_criterion(requirement: Requirement, criterion: Criterion, drawn: Drawn) -> CriterionResult:
    """Decide whether a figure conforms, by the requirement's rule [1].

    Guarded: it conforms if the probability that it does is 95 % or more, does not if it is 5 % or less, and
    is not decided between. Simple: the value alone decides. Shared risk: so it does, if the expanded
    uncertainty is at most the largest accepted.

    [1] JCGM 106:2012, sections 8 and 9, doi:10.59161/JCGM106-2012
    """
    if criterion.figure not in drawn:
        return CriterionResult(**asdict(criterion), probability=None, verdict="not_measured")
    low = -math.inf if criterion.at_least is None else criterion.at_least
    high = math.inf if criterion.at_most is None else criterion.at_most
    draws = drawn[criterion.figure]
    result, probability = summarise(criterion.figure, draws), float(np.mean((draws >= low) & (draws <= high)))
    verdict: Verdict = "conforms" if low <= result.value <= high else "does_not"
    needed = 2.0 * min(abs(result.value - low), abs(result.value - high)) / GUARD
    if requirement.decision == "guarded" and 1.0 - CONFIDENCE < probability < CONFIDENCE:
        verdict = "not_decided"
    elif requirement.decision == "guarded":
        verdict = "conforms" if probability >= CONFIDENCE else "does_not"
    elif requirement.decision == "shared_risk" and requirement.largest_u_rel is not None:
        needed = requirement.largest_u_rel * abs(result.value)
        verdict = verdict if result.expanded_uncertainty <= needed else "not_decided"
    needed_u = needed if verdict == "not_decided" else None
    return CriterionResult(**asdict(criterion), probability=probability, verdict=verdict, needed_u=needed_u)


def find_worst(criteria: Sequence[CriterionResult]) -> Verdict:
    """Return the verdict on a class: the gravest on its criteria."""
    return min((each.verdict for each in criteria), key=_ORDER.index)


def judge_classes(requirement: Requirement, drawn: Drawn) -> tuple[ClassResult, ...]:
    """Return the verdict on the other classes of the rule of which every figure was measured."""
    found = []
    for each in find_rule(requirement.rule).classes:
        if each.name != requirement.road_class and {c.figure for c in each.criteria} <= drawn.keys():
            criteria = [judge_criterion(requirement, criterion, drawn) for criterion in each.criteria]
            found.append(ClassResult(road_class=each.name, verdict=find_worst(criteria)))
    return tuple(found)
