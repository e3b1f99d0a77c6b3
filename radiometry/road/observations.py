"""Observations of a road: luminances of its places over all frames, and readings at control points."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radiometry.records import Record
from radiometry.road import codes
from radiometry.road.field import ANGLE_U, Field, Ground, Rows, lay_ground, light_evenly
from radiometry.road.grid import GridPoint, find_distance, holds, outline_points
from radiometry.road.site import ControlPoint, Meter, Road, Scale, Site

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Of the pavement, where its luminance factor is not stated: dark asphalt to light concrete
_USUAL_RHO, _USUAL_RHO_U = 0.13, 0.4
_ALONG_SHARE, _ACROSS_SHARE = 2.0 / 3.0, 0.5
_STEPS = (np.arange(5) - 2.0) / 5.0  # Middles of the fifths of a side
# Of a lens whose falloff is not corrected, as a power of cos^4
_FALLOFF, _FALLOFF_U = 0.5, 0.5
_LN_SLOPE_PER_M = 0.1  # Usual slope of ln E
# Groups of lamps: least distance of their ln R/G, in itself and in what each scatters, and least share
_APART, _APART_SCATTER, _LEAST_SHARE = 0.25, 4.0, 0.1


class Cells(NamedTuple):
    """Grid points and control points, and the rectangles over which their luminances are averaged."""

    names: tuple[str, ...]
    parts: tuple[str, ...]
    xy_m: Array  # (n, 2)
    sides_m: Array  # (n, 2)
    #: Mean over the rectangle, over its middle, of the light of lamps that shine alike, (n,)
    brighter: Array


class Sight(Record):
    """Cells of a road in its frames, (frames, cells) each; the luminance is NaN where one shows none."""

    luminance_cd_m2: Array  #: Mean over the cell, over what lamps that shine alike make of it there
    u_rel: Array  #: Relative standard uncertainty of this reading's own noise
    view_deg: Array  #: Angle between the view and the vertical
    off_axis_deg: Array  #: Angle between the view and the lens's axis
    place_u_m: Array  #: Standard uncertainty of the place on the road
    red_over_green: Array  #: Colour above dark; NaN of a frame without colours


def lay_cells(road: Road, points: Sequence[GridPoint]) -> Cells:
    """Lay rectangles around grid points and control points: patches of the pavement average out in them.

    They take two thirds of a point's share along and half of it across, as far as that lies on its strip or
    area, and at least a receiver's width.

    Parameters
    ----------
    road : Road
        All that was stated.
    points : sequence of GridPoint
        Grid, as `lay_points` lays it.
    """
    middles: list[GridPoint | ControlPoint] = [*points, *road.control]
    xy = np.array([(each.x_m, each.y_m) for each in middles], np.float64)
    apart = np.sum((xy[len(points) :, None] - xy[None, : len(points)]) ** 2, axis=2)
    near = [points[n].part for n in np.argmin(apart, axis=1)]
    parts = [p.part for p in points] + [c.part or part for c, part in zip(road.control, near, strict=True)]
    found: dict[str, tuple[float, float]] = {}
    for part in set(parts):
        ours = [p for p in points if p.part == part]
        along, across = (find_distance(getattr(p, axis) for p in ours) for axis in ("x_m", "y_m"))
        found[part] = _ALONG_SHARE * along, _ACROSS_SHARE * across
    sides = np.array([found[part] for part in parts])
    sides = np.maximum(np.minimum(sides, _find_room(road.site, parts, xy, sides)), road.site.receiver_m)
    inside = np.stack(np.meshgrid(_STEPS, _STEPS), axis=-1).reshape(-1, 1, 2)
    lamps = np.array(road.site.list_lamps())
    light = np.exp(light_evenly((xy + inside * sides).reshape(-1, 2), lamps)[0]).reshape(len(inside), -1)
    brighter = light.mean(axis=0) / np.exp(light_evenly(xy, lamps)[0])
    return Cells(tuple(each.name for each in middles), tuple(parts), xy, sides, brighter)


def _find_room(site: Site, parts: Sequence[str], xy_m: Array, sides_m: Array) -> Array:
    """Return the sides of rectangles that stay on their strip; 0 of those that would leave their area."""
    strips, areas = {each.name: each for each in site.strips}, {each.name: each for each in site.areas}
    room = np.full(xy_m.shape, np.inf)
    for n, (part, corners) in enumerate(zip(parts, outline_points(xy_m, sides_m), strict=True)):
        if strip := strips.get(part):
            room[n, 1] = 2.0 * min(xy_m[n, 1] - strip.y_m, strip.y_m + strip.width_m - xy_m[n, 1])
        elif area := areas.get(part):
            outline = np.array(area.corners_m)
            room[n] = np.inf if all(holds(outline, x, y) for x, y in corners.tolist()) else 0.0
    return room


class Places(NamedTuple):
    """Grid points and control points of a road, in this order, with what was seen of each."""

    ground: Ground
    surfaces: NDArray[np.str_]
    lamps: Indices  # group of lamps by colour
    seen: NDArray[np.bool_]
    # Over all frames that show a place
    ln_luminance: Array
    own_u: Array
    ln_falloff: Array  # of cos^4
    place_u_m: Array
    view_deg: Array


def gather(road: Road, points: Sequence[GridPoint], sight: Sight) -> Places:
    """Average the luminances of each place over the frames that show it."""
    cells = lay_cells(road, points)
    shown = np.isfinite(sight.luminance_cd_m2) & ~np.isin(cells.names, road.hidden)
    seen = np.asarray(shown.any(axis=0))
    if np.sum(seen[: len(points)]) < len(points) / 2:
        raise codes.ROAD_NOT_SEEN.refuse("Less than half of the points of the grid are seen.")
    return Places(
        ground=lay_ground(road.site, cells.xy_m),
        surfaces=np.array([road.site.find_surface(part) for part in cells.parts]),
        lamps=split_lamps(_average(np.log(sight.red_over_green), shown & (sight.red_over_green > 0.0))),
        seen=seen,
        ln_luminance=_average(np.log(sight.luminance_cd_m2), shown),
        own_u=np.sqrt(_average(sight.u_rel**2, shown) / np.maximum(shown.sum(axis=0), 1)),
        ln_falloff=_average(4.0 * np.log(np.cos(np.radians(sight.off_axis_deg))), shown),
        place_u_m=np.max(sight.place_u_m, axis=0, where=shown, initial=0.0),
        view_deg=np.max(sight.view_deg, axis=0, where=shown, initial=0.0),
    )


class Solved(NamedTuple):
    """A road with the field that its observations give."""

    road: Road
    scale: Scale
    points: Sequence[GridPoint]
    judged: Indices  # of the points
    places: Places
    rows: Rows
    used: NDArray[np.bool_]  # of the rows
    field: Field


def _average(values: Array, shown: NDArray[np.bool_]) -> Array:
    """Return the mean over the frames that show each place; NaN where none does."""
    counts, total = shown.sum(axis=0), np.sum(values, axis=0, where=shown)
    return np.asarray(np.where(counts > 0, total / np.maximum(counts, 1), np.nan))


def make_rows(road: Road, places: Places, scale: Scale) -> Rows:
    """Return the observations: luminances of all places that are seen, then the readings that are used."""
    first, at = len(places.seen) - len(road.control), np.flatnonzero(places.seen)
    read = [(first + n, each) for n, each in enumerate(road.control) if each.left_out is None]
    control = [each for _, each in read]
    index = np.concatenate([at, np.array([n for n, _ in read], np.intp)])
    is_reading = np.arange(len(index)) >= len(at)
    sees = np.concatenate([places.seen[at], [each.quantity == "luminance" for each in control]]).astype(bool)
    flat = math.log((road.conditions.reflectance or _USUAL_RHO) / math.pi)
    falloff = _FALLOFF * places.ln_falloff if scale.falls_off else 0.0
    own_u = np.hypot(places.own_u, _LN_SLOPE_PER_M * places.place_u_m)[at]
    values = np.concatenate([(places.ln_luminance - falloff)[at], [each.ln_mean for each in control]])
    meters, of_meters = _share_meters(road, scale, len(at), control)
    by_camera = np.where(is_reading, 0.0, 1.0)[:, None]
    rho_u = road.conditions.reflectance_u_rel if road.conditions.reflectance else _USUAL_RHO_U
    lamps = places.lamps[index][:, None] == np.arange(places.lamps.max() + 1)
    shared = {
        "camera": scale.u_rel * by_camera,
        "lamp spectrum": scale.spectral_u_rel * by_camera * lamps,
        "meter": of_meters,
        "reflectance": -rho_u
        * sees[:, None]
        * (places.surfaces[index][:, None] == np.unique(places.surfaces)),
        "angle": -ANGLE_U * (sees * places.ground.angles[index])[:, None],
    }
    if scale.falls_off:
        shared["falloff"] = _FALLOFF_U * np.where(is_reading, 0.0, places.ln_falloff[index])[:, None]
    return Rows(
        values=values - np.where(sees, flat, 0.0),
        places=index,
        sees_pavement=sees,
        is_reading=is_reading,
        own_u=np.concatenate([own_u, [each.own_u for each in control]]),
        shared=shared,
        meters=meters,
    )


def _share_meters(
    road: Road, scale: Scale, luminances: int, control: Sequence[ControlPoint]
) -> tuple[tuple[str, ...], Array]:
    """Return the meters behind luminances and readings, and the effect of the error of each."""
    of_rows = [scale.meter or Meter(meter="", u_rel=0.0)] * luminances + [*map(road.find_meter, control)]
    meters = sorted({each.meter for each in of_rows})
    effects = [[each.assumed_u_rel * (each.meter == meter) for meter in meters] for each in of_rows]
    return tuple(meters), np.array(effects)


def split_lamps(ln_colours: Array) -> Indices:
    """Return the group of lamps of each place by its ln R/G: 0, or 1 where two unlike lamps light a field."""
    known = np.sort(ln_colours[np.isfinite(ln_colours)])
    groups = np.zeros(len(ln_colours), np.intp)
    least = max(2, math.ceil(_LEAST_SHARE * len(known)))
    if len(known) < 2 * least:
        return groups
    cuts = range(least, len(known) - least + 1)
    scatter = [known[:cut].var() * cut + known[cut:].var() * (len(known) - cut) for cut in cuts]
    cut = cuts[int(np.argmin(scatter))]
    apart = known[cut:].mean() - known[:cut].mean()
    if apart < max(_APART, _APART_SCATTER * math.sqrt(min(scatter) / len(known))):
        return groups
    return np.asarray(ln_colours > (known[cut - 1] + known[cut]) / 2.0, np.intp)
