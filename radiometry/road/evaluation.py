"""Evaluation of a road: from luminances of points and readings of meters to figures and a verdict."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radiometry.road import codes
from radiometry.road.field import Field, Rows, draw_fields, fit_models, select_rows, solve_field
from radiometry.road.findings import Found, flag_road
from radiometry.road.grid import GridPoint
from radiometry.road.observations import Places, gather, make_rows
from radiometry.road.plan import Outlook, count_points, weigh_figures
from radiometry.road.reporting import (
    compare_control,
    describe_grid,
    find_judged,
    report_points,
    report_scales,
    share_out,
)
from radiometry.road.results import CriterionResult, Model, RoadResult
from radiometry.road.site import UNCERTIFIED_U, Reading, Road, Scale
from radiometry.road.verdict import Drawn, compute_figures, find_worst, judge_classes, judge_road

DRAWS = 4000
# Of a reading against the map without it, in standard uncertainties; and the most that are dropped for it
_DIFFERS, _MOST_DROPPED = 4.5, 0.25


def evaluate_road(
    road: Road, points: Sequence[GridPoint], readings: Sequence[Reading], *, scale: Scale
) -> RoadResult:
    """Evaluate a road from luminances of its grid and control points, and the readings at the latter.

    The field of ln E (see `radiometry.road.field`) is solved with all readings but those that a person left
    out, and those that differ from the map made without them by more than 4.5 standard uncertainties; the
    latter are flagged. Figures are medians of draws from its posterior with intervals of 95 %.

    Parameters
    ----------
    road : Road
        All that was stated.
    points : sequence of GridPoint
        Grid, as `lay_points` lays it.
    readings : sequence of Reading
        Luminances of grid and control points, one a frame.
    scale : Scale
        Uncertainty that all luminances share.
    """
    if road.conditions.surface == "wet":
        raise codes.ROAD_WET.refuse("The road is stated to be wet.")
    places = gather(road, points, readings)
    rows = make_rows(road, places, scale)
    model, *others = fit_models(places.ground, rows, patches=road.conditions.patches_u_rel)
    field, used = _solve(places, rows, model)
    judged = find_judged(road, points)
    fields = [solve_field(places.ground, select_rows(rows, used), each) for each in others]
    draws = draw_fields(fields, places=len(points), draws=DRAWS)
    means = np.exp(field.mean[: len(points)])
    figures = compute_figures(road, points, judged, draws)
    criteria = tuple(_advise(each, figures, road, field, rows, judged) for each in judge_road(road, figures))
    control = compare_control(road, places, rows, field, used)
    lit = describe_grid(points, judged, places)
    scales = report_scales(places, rows, field)
    found = Found(road, scale, places, rows, field, used, control, scales, lit)
    weights = weigh_figures(means[judged])
    return RoadResult(
        verdict=find_worst(criteria),
        as_found=road.requirement.maintenance_factor is None,
        figures=tuple(each.result for each in figures),
        criteria=criteria,
        classes=judge_classes(road, figures),
        points=report_points(points, places, field),
        minimum=points[int(judged[means[judged].argmin()])].name,
        control=control,
        scales=scales,
        budget=share_out(field, judged, weights["e_av"]),
        budget_u_0=share_out(field, judged, weights["u_0"]),
        grid=lit,
        model=model,
        flags=flag_road(found),
    )


def _solve(places: Places, rows: Rows, model: Model) -> tuple[Field, NDArray[np.bool_]]:
    """Solve without the readings that differ; return the rows that are used, too."""
    used = np.ones(len(rows.values), np.bool_)
    readings = int(np.sum(rows.is_reading))
    while True:
        field = solve_field(places.ground, select_rows(rows, used), model)
        ratios = np.abs(field.left) / field.left_u * rows.is_reading[used]
        dropped = len(used) - int(np.sum(used)) + 1
        if not readings or ratios.max() <= _DIFFERS or dropped > _MOST_DROPPED * readings:
            return field, used
        used[np.flatnonzero(used)[int(ratios.argmax())]] = False


def _advise(
    criterion: CriterionResult,
    figures: Sequence[Drawn],
    road: Road,
    field: Field,
    rows: Rows,
    judged: NDArray[np.intp],
) -> CriterionResult:
    """Return a criterion with the number of further points that would decide it."""
    weights = weigh_figures(np.exp(field.mean[judged])).get(criterion.figure)
    if criterion.needed_u is None or weights is None or not road.control:
        return criterion
    meter = road.control[-1].meter
    u = {each.meter: each.assumed_u_rel for each in road.meters}.get(meter, UNCERTIFIED_U)
    outlook = Outlook(field, rows, judged, meter=meter, meter_u=u)
    result = next(each.result for each in figures if each.result.figure == criterion.figure)
    share = criterion.needed_u / max(result.high - result.low, 1e-12) * 2.0
    wanted = share * outlook.estimate_u(weights)
    return replace(criterion, needed_points=count_points(outlook, weights, wanted))
