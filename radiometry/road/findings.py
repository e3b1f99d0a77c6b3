"""Flags of a road: what speaks against its figures."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Raised
from radiometry.road import codes
from radiometry.road.field import Field, Rows
from radiometry.road.observations import Places
from radiometry.road.results import ControlResult, GridResult, ScaleResult
from radiometry.road.site import Road, Scale
from radiometry.spectral.lamps import LABELS

FEWEST_POINTS, STEEPEST_DEG = 4, 20.0
_FAR, _SCATTERS = 2.0, 2.5
_HIDDEN_SHARE = 0.1


class Found(NamedTuple):
    """All that flags are judged by."""

    road: Road
    scale: Scale
    places: Places
    rows: Rows
    field: Field
    used: NDArray[np.bool_]
    control: Sequence[ControlResult]
    scales: Sequence[ScaleResult]
    grid: GridResult


def flag_road(found: Found) -> tuple[Raised, ...]:
    return (*_flag_conditions(found), *_flag_grid(found), *_flag_points(found), *_flag_scales(found))


def _flag_conditions(found: Found) -> Iterator[Raised]:
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


def _flag_grid(found: Found) -> Iterator[Raised]:
    grid = found.grid
    if grid.view_deg > STEEPEST_DEG:
        yield codes.ROAD_VIEW_STEEP.at("", f"Up to {grid.view_deg:.0f} degrees.")
    if grid.place_u_m > grid.place_limit_m:
        yield codes.ROAD_PLACE_UNSURE.at("", f"{grid.place_u_m:.2f} m; at most {grid.place_limit_m:.2f} m.")
    if grid.hidden > _HIDDEN_SHARE * grid.points:
        yield codes.ROAD_POINTS_HIDDEN.at("", f"{grid.hidden} of {grid.points} points.")


def _flag_points(found: Found) -> Iterator[Raised]:
    for each in found.control:
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
    lit = xy[: len(xy) - len(found.road.control)]
    for axis, name, ends in ((0, "along", (low, high)), (1, "across", (lit[:, 1].min(), lit[:, 1].max()))):
        middle = sum(ends) / 2.0
        if np.all(xy[used, axis] < middle) or np.all(xy[used, axis] > middle):
            yield codes.ROAD_POINTS_ONE_SIDED.at("", f"All are on one side of the middle {name}.")
    meters = {each.meter: each.u_rel for each in found.road.meters}
    for meter in sorted({each.meter for each in found.road.control if meters.get(each.meter) is None}):
        yield codes.ROAD_METER_UNCERTIFIED.at(f"meter {meter}", "5 % are assumed.")
    if found.scale.meter is not None and found.scale.meter.u_rel is None:
        yield codes.ROAD_METER_UNCERTIFIED.at("K", "5 % are assumed of the meter behind it.")


def _flag_scales(found: Found) -> Iterator[Raised]:
    rows, read = found.rows, found.used & found.rows.is_reading
    for each in found.scales:
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
