"""Plan of a flight: places of control points that reach a wanted uncertainty, and times without flicker."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radiometry.road import codes
from radiometry.road.field import USUAL, Field, Rows, light_evenly, solve_field
from radiometry.road.grid import GridPoint, lay_points
from radiometry.road.observations import Sight, gather, make_rows
from radiometry.road.results import ExposureTime, Plan, PlannedPoint
from radiometry.road.rules import find_rule
from radiometry.road.site import LANES, Meter, Road, Scale
from radiometry.spectral.lamps import LampKind, find_modulation

Array = NDArray[np.float64]

MOST_POINTS, FEWEST_POINTS = 40, 4
K95 = 2.0
_METER, _POINT_U, _NOISE_U = Meter(meter="", u_rel=0.02), 0.03, 0.005
_TIMES = (125, 120, 100, 60, 50, 30, 25, 20, 15, 10, 8, 5, 4)
# Readings around one point of the grid, and how far apart [m]
_MOST_EACH, _APART_M = 3, 1.5
_AVOIDED, _NEGLIGIBLE, _ALIKE = 4, 1e-3, 1.0 - 1e-6


def find_judged(road: Road, points: Sequence[GridPoint]) -> NDArray[np.intp]:
    """Return the points of the part that the requirement judges."""
    part = road.requirement.part
    parts = {each.name for each in road.site.lanes} if part == LANES else {part}
    judged = np.array([n for n, each in enumerate(points) if each.part in parts], np.intp)
    if not len(judged):
        raise codes.SITE_INVALID.refuse(f"The site has no {part}.")
    return judged


def weigh_figures(light: Array) -> dict[str, Array]:
    """Return the change of ln of each figure with ln E of its points."""
    average, lowest = light / light.sum(), (np.arange(len(light)) == light.argmin()).astype(np.float64)
    return {"e_av": average, "e_min": lowest, "u_0": lowest - average, "average_to_min": average - lowest}


class Outlook:
    """Covariance of ln E at judged points, and what further readings there would leave of it."""

    def __init__(self, field: Field, rows: Rows, judged: NDArray[np.intp], meter: Meter) -> None:
        shared = np.concatenate([field.errors[source][judged] for source in rows.shared], axis=1)
        light = field.covariance[np.ix_(judged, judged)]
        self.covariance = np.block([[light, shared], [shared.T, field.levels[1]]])
        levels = [(source, n) for source, effect in rows.shared.items() for n in range(effect.shape[1])]
        of_meter = len(self.covariance)
        if meter.meter in rows.meters:
            of_meter = len(judged) + levels.index(("meter", rows.meters.index(meter.meter)))
        else:
            self.covariance = np.pad(self.covariance, (0, 1))
            self.covariance[of_meter, of_meter] = 1.0
        self.readings = np.eye(len(judged), len(self.covariance))
        self.readings[:, of_meter] = meter.assumed_u_rel
        self.counts = np.zeros(len(judged), np.intp)

    def estimate_u(self, weights: Array) -> float:
        """Return the standard uncertainty of a weighted sum of ln E."""
        count = len(weights)
        return math.sqrt(max(float(weights @ self.covariance[:count, :count] @ weights), 0.0))

    def add_best(self, weights: Array) -> int:
        """Read the point that lowers the uncertainty of a weighted sum most; return which."""
        seen = self.covariance @ self.readings.T
        variances = np.sum(self.readings.T * seen, axis=0) + _POINT_U**2
        gains = (weights @ seen[: len(weights)]) ** 2 / variances * (self.counts < _MOST_EACH)
        best = int(np.argmax(gains >= _ALIKE * gains.max()))  # of mirror images the first
        self.counts[best] += 1
        self.covariance -= np.outer(seen[:, best], seen[:, best]) / variances[best]
        return best

    def foresee(self, weights: Array) -> Array:
        """Return the standard uncertainty of a weighted sum of ln E after each of 40 further readings."""
        found = []
        for _ in range(MOST_POINTS):
            self.add_best(weights)
            found.append(self.estimate_u(weights))
        return np.array(found)


def plan_points(road: Road, *, e_av_u_rel: float, u_0_u_rel: float) -> Plan:
    """Plan the control points that reach wanted expanded uncertainties.

    Each further point is the one that lowers most the variance of the figure that is furthest from its wanted
    uncertainty, by the equations of `radiometry.road.field` with usual lengths, for lamps that shine alike in
    all directions; the meter is the road's first, else one of 2 %. One more is a spare.

    Parameters
    ----------
    road : Road
        All that was stated; readings are not needed.
    e_av_u_rel, u_0_u_rel : float
        Wanted expanded uncertainties of E_av and U_0, relative.
    """
    points = lay_points(road.site, find_rule(road.requirement.rule).grid)
    judged = find_judged(road, points)
    xy = np.array([(each.x_m, each.y_m) for each in points])
    light = np.exp(light_evenly(xy, np.array(road.site.list_lamps()))[0])
    outlook = Outlook(*_foresee(road, points, light), judged, next(iter(road.meters), _METER))
    weights = weigh_figures(light[judged])
    wanted = {"e_av": e_av_u_rel / K95, "u_0": u_0_u_rel / K95}
    chosen: list[int] = []
    while True:
        missing = {name: outlook.estimate_u(weights[name]) / limit for name, limit in wanted.items()}
        is_reached = max(missing.values()) <= 1.0
        if len(chosen) >= FEWEST_POINTS and (is_reached or len(chosen) >= MOST_POINTS):
            break
        chosen.append(outlook.add_best(weights[max(missing, key=lambda name: missing[name])]))
    reached = {f"{name}_u_rel": K95 * outlook.estimate_u(weights[name]) for name in wanted}
    chosen.append(outlook.add_best(weights["e_av"]))
    *places, spare = (_place(points[judged[n]], chosen[:at].count(n)) for at, n in enumerate(chosen))
    times = list_times(road.conditions.mains_frequency_hz, road.conditions.lamp_kind)
    return Plan(
        points=tuple(
            PlannedPoint(name=f"P{n}", x_m=x, y_m=y, is_spare=n == len(chosen))
            for n, (x, y) in enumerate([*sorted(places), spare], start=1)
        ),
        **reached,
        is_reached=is_reached,
        times=tuple(sorted((e for e in times if e.error_rel <= _NEGLIGIBLE), key=lambda each: each.time_s)),
        avoid=tuple(each for each in times if each.error_rel > _NEGLIGIBLE)[:_AVOIDED],
    )


def _place(point: GridPoint, before: int) -> tuple[float, float]:
    """Return the place of a reading at a point, beside those that are there already."""
    return round(point.x_m + (0.0, _APART_M, -_APART_M)[before % _MOST_EACH], 1), round(point.y_m, 1)


def list_times(mains_hz: float | None, kind: LampKind | None) -> tuple[ExposureTime, ...]:
    """Return usual exposure times with the largest error by flicker of twice the mains, the largest first.

    m |sin(pi f t)| / (pi f t) for the largest modulation m of the kind of lamp; 50 or 60 Hz where the mains
    is not stated.
    """
    depth = find_modulation(kind, None)[1]
    turns = 2.0 * np.divide.outer([50.0, 60.0] if mains_hz is None else [mains_hz], _TIMES)
    errors = depth * np.where(turns > 0.0, np.abs(np.sinc(turns)), 0.0).max(axis=0)
    found = [ExposureTime(time_s=1 / n, error_rel=e) for n, e in zip(_TIMES, errors.tolist(), strict=True)]
    return tuple(sorted(found, key=lambda each: -each.error_rel))


def _foresee(road: Road, points: Sequence[GridPoint], light: Array) -> tuple[Field, Rows]:
    """Solve for a road without readings, seen once."""
    bare, none = replace(road, control=(), hidden=()), np.zeros((1, len(light)))
    sight = Sight(
        luminance_cd_m2=light[None],
        u_rel=none + _NOISE_U,
        view_deg=none,
        off_axis_deg=none,
        place_u_m=none,
        red_over_green=none + np.nan,
    )
    places = gather(bare, points, sight)
    rows = make_rows(bare, places, Scale(u_rel=0.025))
    model = replace(USUAL, patches_rel=road.conditions.patches_u_rel)
    return solve_field(places.ground, rows, model), rows
