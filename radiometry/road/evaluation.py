"""Evaluation of a road: from luminances of points and readings of meters to figures and a verdict."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Raised
from radiometry.road import codes, results
from radiometry.road.field import ANGLE_U, Field, Rows, draw_fields, fit_models, solve_field
from radiometry.road.grid import GridPoint, find_distance
from radiometry.road.observations import Places, Sight, Solved, gather, make_rows
from radiometry.road.plan import Outlook, find_judged, weigh_figures
from radiometry.road.rules import find_criteria
from radiometry.road.site import Road, Scale
from radiometry.road.verdict import Drawn, draw_figures, find_worst, judge_classes, judge_criterion, summarise
from radiometry.spectral.lamps import LABELS

Array = NDArray[np.float64]

DRAWS = 4000
# Of a reading against the map without it, in standard uncertainties; and the most that are dropped for it
_DIFFERS, _MOST_DROPPED = 4.5, 0.25
_PROSPECTS = (4, 8, 16, 40)
# Sources that a reader sees as one
_NAMES = {"patches": "pavement", "field": "pavement", "noise": "camera", "falloff": "lens"}
_UNEVEN = ("angle", "falloff")
# Of flags
FEWEST_POINTS, STEEPEST_DEG = 4, 20.0
_FAR, _SCATTERS = 2.0, 2.5
_HIDDEN_SHARE = 0.1


def evaluate_road(
    road: Road, points: Sequence[GridPoint], sight: Sight, *, scale: Scale
) -> results.RoadResult:
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
    sight : Sight
        Luminances of grid and control points in each frame.
    scale : Scale
        Uncertainty that all luminances share.
    """
    if road.conditions.surface == "wet":
        raise codes.ROAD_WET.refuse("The road is stated to be wet.")
    judged, places = find_judged(road, points), gather(road, points, sight)
    rows = make_rows(road, places, scale)
    model, *others = fit_models(places.ground, rows, patches=road.conditions.patches_u_rel)
    used, field = _solve(places, rows, model)
    solved = Solved(road, scale, points, judged, places, rows, used, field)
    light = draw_fields(places.ground, rows.keep(used), others, places=len(points), draws=DRAWS)
    drawn = draw_figures(road, points, judged, light)
    means = np.exp(field.mean[judged])
    weights = weigh_figures(means)
    criteria = [judge_criterion(road.requirement, each, drawn) for each in find_criteria(road.requirement)]
    control, scales, grid = compare_control(solved), report_scales(solved), describe_grid(solved)
    return results.RoadResult(
        verdict=find_worst(criteria),
        as_found=road.requirement.maintenance_factor is None,
        figures=tuple(summarise(*each) for each in drawn.items()),
        criteria=tuple(_advise(each, drawn, solved) for each in criteria),
        classes=judge_classes(road.requirement, drawn),
        points=report_points(solved),
        minimum=points[int(judged[means.argmin()])].name,
        control=control,
        scales=scales,
        budget=share_out(solved, weights["e_av"]),
        budget_u_0=share_out(solved, weights["u_0"]),
        grid=grid,
        model=model,
        flags=flag_road(solved, control, scales, grid),
    )


def _solve(places: Places, rows: Rows, model: results.Model) -> tuple[NDArray[np.bool_], Field]:
    """Solve without the readings that differ; return the rows that are used, too."""
    used = np.ones(len(rows.values), np.bool_)
    most = _MOST_DROPPED * np.sum(rows.is_reading)
    while True:
        field = solve_field(places.ground, rows.keep(used), model)
        ratios = np.abs(field.left) / field.left_u * rows.is_reading[used]
        if ratios.max() <= _DIFFERS or np.sum(~used) + 1 > most:
            return used, field
        used[np.flatnonzero(used)[int(ratios.argmax())]] = False


def _advise(criterion: results.CriterionResult, drawn: Drawn, solved: Solved) -> results.CriterionResult:
    """Return a criterion with the further points that would decide it, and what fewer would do."""
    control, judged = solved.road.control, solved.judged
    weights = weigh_figures(np.exp(solved.field.mean[judged])).get(criterion.figure)
    if criterion.needed_u is None or weights is None or not control:
        return criterion
    outlook = Outlook(solved.field, solved.rows, judged, solved.road.find_meter(control[-1]))
    now = summarise(criterion.figure, drawn[criterion.figure]).expanded_uncertainty
    u = now / outlook.estimate_u(weights) * outlook.foresee(weights)
    enough = np.flatnonzero(u <= criterion.needed_u) + 1
    needed = int(enough[0]) if len(enough) else None
    prospects = tuple(
        results.Prospect(points=n, expanded_uncertainty=float(u[n - 1]), is_decided=n == needed)
        for n in sorted({*_PROSPECTS, needed or len(u)})
        if n <= (needed or len(u))
    )
    return replace(criterion, needed_points=needed, prospects=prospects)


def compare_control(solved: Solved) -> tuple[results.ControlResult, ...]:
    """Compare each control point with the map that is made without it."""
    places, rows, used, field = solved[4:]
    row_of = {int(rows.places[row]): row for row in np.flatnonzero(rows.is_reading).tolist()}
    left_at = {row: n for n, row in enumerate(np.flatnonzero(used).tolist())}
    found = []
    for n, each in enumerate(solved.road.control, start=len(solved.points)):
        row = row_of.get(n)
        state: results.PointState = "left_out" if row is None else "differs"
        difference = u = None
        if row in left_at:
            state = "agrees" if places.seen[n] else "not_seen"
            difference, u = float(field.left[left_at[row]]), float(field.left_u[left_at[row]])
        elif each.quantity == "illuminance":
            difference = each.ln_mean - float(field.mean[n])
            u = math.hypot(math.sqrt(field.covariance[n, n]), each.own_u)
        found.append(
            results.ControlResult(
                **{name: getattr(each, name) for name in ("name", "x_m", "y_m", "quantity")},
                value=math.exp(each.ln_mean),
                without_it=None if difference is None else math.exp(each.ln_mean - difference),
                without_it_u_rel=u,
                difference_rel=None if difference is None else math.expm1(difference),
                state=state,
                reason=each.left_out or "",
            )
        )
    return tuple(found)


def report_points(solved: Solved) -> tuple[results.PointResult, ...]:
    places, field = solved.places, solved.field
    return tuple(
        results.PointResult(
            **asdict(each),
            illuminance_lx=math.exp(field.mean[n]),
            u_rel=math.sqrt(field.covariance[n, n]),
            luminance_cd_m2=math.exp(places.ln_luminance[n]) if places.seen[n] else None,
            is_hidden=not places.seen[n],
        )
        for n, each in enumerate(solved.points)
    )


def report_scales(solved: Solved) -> tuple[results.ScaleResult, ...]:
    """Return factor and slope of each pavement with what was expected of them."""
    rows, surfaces, found = solved.rows, solved.places.surfaces[solved.rows.places], []
    mean, covariance = solved.field.levels
    slope = [name for name, effect in rows.shared.items() for _ in range(effect.shape[1])].index("angle")
    for surface in np.unique(surfaces[~rows.is_reading]).tolist():
        ours = (surfaces == surface) & ~rows.is_reading
        # ln E - ln L is less what a luminance of this pavement contains, but for the angle
        weights = np.concatenate(
            [(source not in _UNEVEN) * -effect[ours].mean(axis=0) for source, effect in rows.shared.items()]
        )
        factor = math.exp(weights @ mean)
        found.append(
            results.ScaleResult(
                surface=surface,
                factor=factor,
                factor_u=factor * math.sqrt(weights @ covariance @ weights),
                expected_u=float(np.linalg.norm(weights)),
                slope=ANGLE_U * float(mean[slope]),
                slope_u=ANGLE_U * math.sqrt(covariance[slope, slope]),
            )
        )
    return tuple(found)


def describe_grid(solved: Solved) -> results.GridResult:
    ours, places = [solved.points[n] for n in solved.judged], solved.places
    along, across = (find_distance(getattr(p, axis) for p in ours) or 1.0 for axis in ("x_m", "y_m"))
    return results.GridResult(
        points=len(ours),
        hidden=int(np.sum(~places.seen[solved.judged])),
        along=len({each.x_m for each in ours}),
        along_m=along,
        across_m=across,
        place_u_m=float(places.place_u_m[solved.judged].max()),
        place_limit_m=min(along, across) / 3.0,
        view_deg=float(places.view_deg[solved.judged].max()),
    )


def share_out(solved: Solved, weights: Array) -> tuple[results.Share, ...]:
    """Return what each source contributes to a weighted sum of ln E."""
    variances: dict[str, float] = {}
    for source, errors in solved.field.errors.items():
        name = _NAMES.get(source, source)
        variances[name] = variances.get(name, 0.0) + float(np.sum((weights @ errors[solved.judged]) ** 2))
    total = sum(variances.values()) or 1.0
    return tuple(
        results.Share(source=source, u_rel=math.sqrt(variance), variance_share=variance / total)
        for source, variance in sorted(variances.items(), key=lambda each: -each[1])
    )


def flag_road(
    solved: Solved,
    control: Sequence[results.ControlResult],
    scales: Sequence[results.ScaleResult],
    grid: results.GridResult,
) -> tuple[Raised, ...]:
    return (
        *_flag_conditions(solved),
        *_flag_grid(grid),
        *_flag_points(solved, control),
        *_flag_scales(solved, scales),
    )


def _flag_conditions(found: Solved) -> Iterator[Raised]:
    conditions, scale = found.road.conditions, found.scale
    if conditions.surface != "dry":
        yield codes.ROAD_NOT_DRY.at("", f"Stated of the road: {conditions.surface or 'nothing'}.")
    kinds = scale.lamp_kind, conditions.lamp_kind
    if kinds[0] and kinds[1] and kinds[0] != kinds[1]:
        named = [LABELS[kind] for kind in kinds if kind]
        yield codes.ROAD_LAMPS_DIFFER.at("", f"K: {named[0]}; road: {named[1]}.")
    if scale.falls_off:
        yield codes.ROAD_FALLOFF_ASSUMED.at("", "cos⁴ to the power of 0.5 ± 0.5 is assumed.")
    if found.road.requirement.confirmed is None:
        yield codes.ROAD_RULE_UNCONFIRMED.at("", f"{found.road.requirement.rule}.")


def _flag_grid(grid: results.GridResult) -> Iterator[Raised]:
    if grid.view_deg > STEEPEST_DEG:
        yield codes.ROAD_VIEW_STEEP.at("", f"Up to {grid.view_deg:.0f} degrees.")
    if grid.place_u_m > grid.place_limit_m:
        yield codes.ROAD_PLACE_UNSURE.at("", f"{grid.place_u_m:.2f} m; at most {grid.place_limit_m:.2f} m.")
    if grid.hidden > _HIDDEN_SHARE * grid.points:
        yield codes.ROAD_POINTS_HIDDEN.at("", f"{grid.hidden} of {grid.points} points.")


def _flag_points(found: Solved, control: Sequence[results.ControlResult]) -> Iterator[Raised]:
    for each in control:
        if each.state == "differs" and each.without_it is not None:
            u = each.without_it_u_rel or 0.0
            detail = f"{each.value:.3g} read, {each.without_it:.3g} by the map, which is known to {u:.1%}."
            yield codes.ROAD_POINT_DIFFERS.at(f"point {each.name}", detail)
    rows = found.rows
    used = rows.places[found.used & rows.is_reading]
    if len(used) < FEWEST_POINTS:
        yield codes.ROAD_POINTS_FEW.at("", f"{len(used)} control points are used.")
        return
    (low, high), xy = found.road.site.field_m, found.places.ground.xy_m
    lit = xy[: len(found.points)]
    for axis, name, ends in ((0, "along", (low, high)), (1, "across", (lit[:, 1].min(), lit[:, 1].max()))):
        middle = sum(ends) / 2.0
        if np.all(xy[used, axis] < middle) or np.all(xy[used, axis] > middle):
            yield codes.ROAD_POINTS_ONE_SIDED.at("", f"All are on one side of the middle {name}.")
    meters = map(found.road.find_meter, found.road.control)
    for meter in sorted({each.meter for each in meters if each.u_rel is None}):
        yield codes.ROAD_METER_UNCERTIFIED.at(f"meter {meter}", "5 % are assumed.")
    if found.scale.meter is not None and found.scale.meter.u_rel is None:
        yield codes.ROAD_METER_UNCERTIFIED.at("K", "5 % are assumed of the meter behind it.")


def _flag_scales(found: Solved, scales: Sequence[results.ScaleResult]) -> Iterator[Raised]:
    rows, read = found.rows, found.used & found.rows.is_reading
    for each in scales:
        surprise = np.sqrt(max(each.expected_u**2 - (each.factor_u / each.factor) ** 2, 1e-12))
        if abs(np.log(each.factor)) > _FAR * surprise:
            detail = f"Factor {each.factor:.2f} ± {each.factor_u:.2f}, expected 1.00 ± {each.expected_u:.2f}."
            yield codes.ROAD_SCALE_UNLIKELY.at(each.surface, detail)
    groups = found.places.lamps
    if groups.max() > 0:
        for group in sorted(set(groups.tolist()) - set(groups[rows.places[read]].tolist())):
            yield codes.ROAD_LAMPS_UNREAD.at("", f"No control point lies under lamps of group {group + 1}.")
    ratios = (found.field.left / found.field.left_u)[rows.is_reading[found.used]]
    if len(ratios) >= FEWEST_POINTS and (scatter := float(np.sqrt(np.mean(ratios**2)))) > _SCATTERS:
        yield codes.ROAD_SCATTERS.at("", f"{scatter:.1f} times as much as their uncertainty.")
