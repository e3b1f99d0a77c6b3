"""Observations of a road: luminances of its points over all frames, and readings at control points."""

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radiometry.road import codes
from radiometry.road.field import ANGLE_U, Ground, Rows, lay_ground, light_evenly
from radiometry.road.grid import GridPoint, find_distance, holds, outline_points
from radiometry.road.site import UNCERTIFIED_U, ControlPoint, Reading, Road, Scale, Site

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


class Seen(NamedTuple):
    """Luminance of one place, over all frames."""

    ln_luminance: float
    own_u: float
    frames: tuple[str, ...]
    place_u_m: float
    view_deg: float
    ln_colour: float | None  # of R/G
    ln_falloff: float  # of cos^4


def average_frames(readings: Sequence[Reading]) -> dict[str, Seen]:
    """Average the luminances of each place over the frames that see it."""
    of_place: dict[str, list[Reading]] = defaultdict(list)
    for each in readings:
        if each.luminance_cd_m2 > 0.0:
            of_place[each.place].append(each)
    return {place: _average(found) for place, found in of_place.items()}


def _average(found: Sequence[Reading]) -> Seen:
    colours = [math.log(each.colour[0]) for each in found if each.colour is not None]
    falloffs = 4.0 * np.log(np.cos(np.radians([each.off_axis_deg for each in found])))
    return Seen(
        ln_luminance=float(np.mean([math.log(each.luminance_cd_m2) for each in found])),
        own_u=math.sqrt(sum(each.u_rel**2 for each in found)) / len(found),
        frames=tuple(each.frame for each in found),
        place_u_m=max(each.place_u_m for each in found),
        view_deg=max(each.view_deg for each in found),
        ln_colour=float(np.mean(colours)) if colours else None,
        ln_falloff=float(falloffs.mean()),
    )


class Cells(NamedTuple):
    """Grid points and control points, and the rectangles over which their luminances are averaged."""

    names: tuple[str, ...]
    parts: tuple[str, ...]
    xy_m: Array  # (n, 2)
    sides_m: Array  # (n, 2)
    #: Mean over the rectangle, over its middle, of the light of lamps that shine alike, (n,)
    brighter: Array


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
    xy = np.array([(p.x_m, p.y_m) for p in points] + [(c.x_m, c.y_m) for c in road.control], np.float64)
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
    names = (*(p.name for p in points), *(c.name for c in road.control))
    return Cells(names, tuple(parts), xy, sides, brighter)


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

    names: tuple[str, ...]
    ground: Ground
    surfaces: tuple[str, ...]
    seen: tuple[Seen | None, ...]
    lamps: NDArray[np.intp]  # group of lamps by colour


def gather(road: Road, points: Sequence[GridPoint], readings: Sequence[Reading]) -> Places:
    seen, hidden, cells = average_frames(readings), set(road.hidden), lay_cells(road, points)
    known = tuple(None if name in hidden else seen.get(name) for name in cells.names)
    if sum(each is not None for each in known[: len(points)]) < len(points) / 2:
        raise codes.ROAD_NOT_SEEN.refuse("Less than half of the points of the grid are seen.")
    return Places(
        names=cells.names,
        ground=lay_ground(road.site, cells.xy_m),
        surfaces=tuple(road.site.find_surface(part) for part in cells.parts),
        seen=known,
        lamps=split_lamps([None if each is None else each.ln_colour for each in known]),
    )


def make_rows(road: Road, places: Places, scale: Scale) -> Rows:
    """Return the observations: luminances of all places that are seen, then the readings that are used."""
    at = [n for n, each in enumerate(places.seen) if each is not None]
    seen = [each for each in places.seen if each is not None]
    first = len(places.names) - len(road.control)
    read = [(first + n, each) for n, each in enumerate(road.control) if each.left_out is None]
    rho = road.conditions.reflectance or _USUAL_RHO
    flat = math.log(rho / math.pi)
    is_luminance = np.array([each.quantity == "luminance" for _, each in read], np.bool_)
    index = np.array(at + [n for n, _ in read], np.intp)
    is_reading = np.arange(len(index)) >= len(at)
    sees = np.concatenate([np.ones(len(at), np.bool_), is_luminance])
    falloff = _FALLOFF if scale.falls_off else 0.0
    values = [each.ln_luminance - falloff * each.ln_falloff for each in seen]
    values += [each.ln_mean for _, each in read]
    meters = tuple(sorted({each.meter for _, each in read} | ({scale.meter.meter} if scale.meter else set())))
    return Rows(
        values=np.array(values) - np.where(sees, flat, 0.0),
        places=index,
        sees_pavement=sees,
        is_reading=is_reading,
        own_u=np.array(
            [math.hypot(each.own_u, _LN_SLOPE_PER_M * each.place_u_m) for each in seen]
            + [each.own_u for _, each in read]
        ),
        meters=meters,
        shared=_share_errors(road, places, scale, index, sees, [each for _, each in read], meters),
    )


def _share_errors(
    road: Road,
    places: Places,
    scale: Scale,
    index: Indices,
    sees: NDArray[np.bool_],
    read: Sequence[ControlPoint],
    meters: Sequence[str],
) -> dict[str, Array]:
    """Return the effect of one standard uncertainty of each error that rows share, (rows, levels)."""
    count = len(index) - len(read)
    by_camera = (np.arange(len(index)) < count).astype(np.float64)
    frames = sorted({frame for each in places.seen if each is not None for frame in each.frames})
    of_frames = np.zeros((len(index), len(frames)))
    for row, each in enumerate(each for each in places.seen if each is not None):
        for frame in each.frames:
            of_frames[row, frames.index(frame)] = scale.frame_u_rel / len(each.frames)
    stated = {each.meter: each.assumed_u_rel for each in road.meters}
    of_meters = np.zeros((len(index), len(meters)))
    if scale.meter:
        of_meters[:count, meters.index(scale.meter.meter)] = scale.meter.assumed_u_rel
    for row, point in enumerate(read, start=count):
        of_meters[row, meters.index(point.meter)] = stated.get(point.meter, UNCERTIFIED_U)
    conditions = road.conditions
    rho_u = conditions.reflectance_u_rel if conditions.reflectance else _USUAL_RHO_U
    pavements = sorted(set(places.surfaces))
    of_pavement = np.array([[places.surfaces[n] == each for each in pavements] for n in index], np.float64)
    groups = range(int(places.lamps.max()) + 1)
    of_lamps = np.array([[places.lamps[n] == each for each in groups] for n in index], np.float64)
    return {
        "camera": scale.u_rel * by_camera[:, None],
        "frames": of_frames,
        "lamp spectrum": scale.spectral_u_rel * by_camera[:, None] * of_lamps,
        "meter": of_meters,
        "reflectance": -rho_u * sees[:, None] * of_pavement,
        "angle": -ANGLE_U * (sees * places.ground.angles[index])[:, None],
        **({"falloff": _find_falloff(places, len(index))} if scale.falls_off else {}),
    }


def _find_falloff(places: Places, rows: int) -> Array:
    errors = [_FALLOFF_U * each.ln_falloff for each in places.seen if each is not None]
    return np.pad(errors, (0, rows - len(errors)))[:, None]


def split_lamps(ln_colours: Sequence[float | None]) -> Indices:
    """Return the group of lamps of each place by its ln R/G: 0, or 1 where two unlike lamps light a field."""
    known = np.array(sorted(each for each in ln_colours if each is not None))
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
    middle = (known[cut - 1] + known[cut]) / 2.0
    return np.array([int(each is not None and each > middle) for each in ln_colours], np.intp)
