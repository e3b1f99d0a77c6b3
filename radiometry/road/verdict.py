"""Figures of a road from draws of its field, and the verdict of three values on them."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radiometry.road.grid import GridPoint, inside
from radiometry.road.results import ClassResult, CriterionResult, FigureResult, Verdict
from radiometry.road.rules import find_criteria, find_rule
from radiometry.road.site import Criterion, Requirement, Road

Array = NDArray[np.float64]

CONFIDENCE = 0.95
GUARD = 1.645
"""Standard uncertainties between a value and a limit for a probability of 95 % (JCGM 106)."""

_UNITS = {"e_av": "lx", "e_min": "lx", "pdi": "mW/(lx*m2)"}
_ORDER: Sequence[Verdict] = ("does_not", "not_decided", "not_measured", "conforms")
_MAINTAINED = ("e_av", "e_min")


class Drawn(NamedTuple):
    """A figure with its draws."""

    result: FigureResult
    draws: Array


def compute_figures(
    road: Road, points: Sequence[GridPoint], judged: NDArray[np.intp], light: Array
) -> tuple[Drawn, ...]:
    """Compute the figures of the judged part from draws of E at all points of the grid, (draws, points)."""
    ours = light[:, judged]
    average, least = ours.mean(axis=1), ours.min(axis=1)
    found = {"e_av": average, "e_min": least, "u_0": least / average, "average_to_min": average / least}
    if edges := [each.name for each in road.site.strips if each.kind == "edge"]:
        parts = np.array([each.part for each in points])
        sides = [light[:, parts == e].mean(axis=1) / light[:, parts == inside(e)].mean(axis=1) for e in edges]
        # the worse side as a whole: the least of each draw is biased where both are alike
        found["eir"] = min(sides, key=lambda each: float(np.median(each)))
    if road.conditions.power_w is not None:
        found["pdi"] = 1e3 * road.conditions.power_w / (average * _measure_area(points, judged, road))
    factor = road.requirement.maintenance_factor or 1.0
    return tuple(
        _summarise(name, draws * (factor if name in _MAINTAINED else 1.0)) for name, draws in found.items()
    )


def _measure_area(points: Sequence[GridPoint], judged: NDArray[np.intp], road: Road) -> float:
    """Return the area of the judged part [m2]."""
    parts, (low, high) = {points[n].part for n in judged}, road.site.field_m
    of_strips = sum((high - low) * each.width_m for each in road.site.strips if each.name in parts)
    for area in road.site.areas:
        if area.name in parts:
            (x, y), (x1, y1) = np.array(area.corners_m).T, np.roll(area.corners_m, -1, axis=0).T
            of_strips += abs(float(np.sum(x * y1 - x1 * y))) / 2.0
    return of_strips


def _summarise(name: str, draws: Array) -> Drawn:
    low, middle, high = np.quantile(draws, (0.025, 0.5, 0.975)).tolist()
    return Drawn(
        FigureResult(
            figure=name,
            value=middle,
            standard_uncertainty=float(draws.std()),
            low=low,
            high=high,
            unit=_UNITS.get(name, "1"),
        ),
        draws,
    )


def judge_road(road: Road, figures: Sequence[Drawn]) -> tuple[CriterionResult, ...]:
    """Compare the figures with the requirement's criteria."""
    criteria = find_criteria(road.requirement)
    return tuple(judge_criterion(road.requirement, each, figures) for each in criteria)


def judge_criterion(
    requirement: Requirement, criterion: Criterion, figures: Sequence[Drawn]
) -> CriterionResult:
    """Decide whether a figure conforms, by the requirement's rule [1].

    Guarded: it conforms if the probability that it does is 95 % or more, does not if it is 5 % or less, and
    is not decided between. Simple: the value alone decides. Shared risk: so it does, if the expanded
    uncertainty is at most the largest accepted.

    [1] JCGM 106:2012, sections 8 and 9, doi:10.59161/JCGM106-2012
    """
    found = next((each for each in figures if each.result.figure == criterion.figure), None)
    if found is None:
        return CriterionResult(**asdict(criterion), probability=None, verdict="not_measured")
    low = -math.inf if criterion.at_least is None else criterion.at_least
    high = math.inf if criterion.at_most is None else criterion.at_most
    result = found.result
    probability = float(np.mean((found.draws >= low) & (found.draws <= high)))
    verdict: Verdict = "conforms" if low <= result.value <= high else "does_not"
    largest = requirement.largest_u_rel
    if requirement.decision == "guarded":
        guarded: Verdict = "does_not" if probability <= 1.0 - CONFIDENCE else "not_decided"
        verdict = "conforms" if probability >= CONFIDENCE else guarded
    elif requirement.decision == "shared_risk" and largest is not None:
        verdict = verdict if result.expanded_uncertainty <= largest * abs(result.value) else "not_decided"
    needed = None
    if verdict == "not_decided":
        needed = 2.0 * min(abs(result.value - low), abs(result.value - high)) / GUARD
        if requirement.decision == "shared_risk" and largest is not None:
            needed = largest * abs(result.value)
    return CriterionResult(**asdict(criterion), probability=probability, verdict=verdict, needed_u=needed)


def find_worst(criteria: Sequence[CriterionResult]) -> Verdict:
    """Return the verdict on a class: the gravest on its criteria."""
    return min((each.verdict for each in criteria), key=_ORDER.index)


def judge_classes(road: Road, figures: Sequence[Drawn]) -> tuple[ClassResult, ...]:
    """Return the verdict on the other classes of the rule of which every figure was measured."""
    measured = {each.result.figure for each in figures}
    found = []
    for each in find_rule(road.requirement.rule).classes:
        if each.name == road.requirement.road_class or not {c.figure for c in each.criteria} <= measured:
            continue
        criteria = [judge_criterion(road.requirement, criterion, figures) for criterion in each.criteria]
        found.append(ClassResult(road_class=each.name, verdict=find_worst(criteria)))
    return tuple(found)
