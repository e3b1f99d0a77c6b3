"""Plan of a flight: places of control points that reach a wanted uncertainty, and times without flicker."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radiometry.road.field import USUAL, Field, Rows, light_evenly, solve_field
from radiometry.road.grid import GridPoint, lay_points
from radiometry.road.observations import gather, make_rows
from radiometry.road.reporting import find_judged
from radiometry.road.results import ExposureTime, Plan, PlannedPoint
from radiometry.road.rules import find_rule
from radiometry.road.site import Reading, Road, Scale
from radiometry.spectral.lamps import LampKind, find_modulation

Array = NDArray[np.float64]

MOST_POINTS, FEWEST_POINTS = 40, 4
K95 = 2.0
_METER_U, _POINT_U, _NOISE_U = 0.02, 0.03, 0.005
_TIMES = (125, 120, 100, 60, 50, 30, 25, 20, 15, 10, 8, 5, 4)
# Readings around one point of the grid, and how far apart [m]
_MOST_EACH, _APART_M = 3, 1.5
_AVOIDED, _NEGLIGIBLE = 4, 1e-3


def weigh_figures(light: Array) -> dict[str, Array]:
    """Return the change of ln of each figure with ln E of its points."""
    average, lowest = light / light.sum(), (np.arange(len(light)) == light.argmin()).astype(np.float64)
    return {"e_av": average, "e_min": lowest, "u_0": lowest - average, "average_to_min": average - lowest}


class Outlook:
    """Covariance of ln E at judged points, and what further readings there would leave of it."""

    def __init__(
        self, field: Field, rows: Rows, judged: NDArray[np.intp], *, meter: str, meter_u: float
    ) -> None:
        shared = np.concatenate([field.errors[source][judged] for source in rows.shared], axis=1)
        light = field.covariance[np.ix_(judged, judged)]
        self.covariance = np.block([[light, shared], [shared.T, field.levels[1]]])
        names = [(source, n) for source, effect in rows.shared.items() for n in range(effect.shape[1])]
        if meter in rows.meters:
            of_meter = len(judged) + names.index(("meter", rows.meters.index(meter)))
        else:
            of_meter = len(self.covariance)
            self.covariance = np.pad(self.covariance, (0, 1))
            self.covariance[of_meter, of_meter] = 1.0
        self.readings = np.eye(len(judged), len(self.covariance))
        self.readings[:, of_meter] = meter_u
        self.counts = np.zeros(len(judged), np.intp)

    def estimate_u(self, weights: Array) -> float:
        """Return the standard uncertainty of a weighted sum of ln E."""
        count = len(weights)
        return math.sqrt(max(float(weights @ self.covariance[:count, :count] @ weights), 0.0))

    def add_best(self, weights: Array) -> int:
        """Read the point that lowers the uncertainty of a weighted sum most; return which."""
        seen = self.covariance @ self.readings.T
        variances = np.sum(self.readings.T * seen, axis=0) + _POINT_U**2
        gains = (weights @ seen[: len(weights)]) ** 2 / variances
        best = int(np.argmax(np.where(self.counts < _MOST_EACH, gains, -1.0)))
        self.counts[best] += 1
        self.covariance -= np.outer(seen[:, best], seen[:, best]) / variances[best]
        return best


def count_points(outlook: Outlook, weights: Array, wanted_u: float) -> int | None:
    """Return the number of further points that lower an uncertainty so far; None if 40 do not."""
    for count in range(1, MOST_POINTS + 1):
        outlook.add_best(weights)
        if outlook.estimate_u(weights) <= wanted_u:
            return count
    return None


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
    rows, field = _foresee(road, points, dict(zip((p.name for p in points), light.tolist(), strict=True)))
    meter = next(iter(road.meters), None)
    u = _METER_U if meter is None else meter.assumed_u_rel
    outlook = Outlook(field, rows, judged, meter=meter.meter if meter else "", meter_u=u)
    weights = weigh_figures(light[judged])
    wanted = {"e_av": e_av_u_rel / K95, "u_0": u_0_u_rel / K95}
    chosen: list[int] = []
    while True:
        missing = {name: outlook.estimate_u(weights[name]) / limit for name, limit in wanted.items()}
        is_reached = max(missing.values()) <= 1.0
        if len(chosen) >= FEWEST_POINTS and (is_reached or len(chosen) >= MOST_POINTS):
            break
        chosen.append(outlook.add_best(weights[max(missing, key=lambda name: missing[name])]))
    reached = {name: K95 * outlook.estimate_u(weights[name]) for name in wanted}
    chosen.append(outlook.add_best(weights["e_av"]))
    spare = _place(points[judged[chosen[-1]]], chosen[:-1].count(chosen[-1]))
    placed = sorted(_place(points[judged[n]], chosen[:at].count(n)) for at, n in enumerate(chosen[:-1]))
    times = list_times(road.conditions.mains_frequency_hz, road.conditions.lamp_kind)
    return Plan(
        points=tuple(
            PlannedPoint(name=f"P{n}", x_m=x, y_m=y, is_spare=n == len(chosen))
            for n, (x, y) in enumerate([*placed, spare], start=1)
        ),
        e_av_u_rel=reached["e_av"],
        u_0_u_rel=reached["u_0"],
        is_reached=is_reached,
        times=tuple(sorted((e for e in times if e.error_rel <= _NEGLIGIBLE), key=lambda each: each.time_s)),
        avoid=tuple(each for each in times if each.error_rel > _NEGLIGIBLE)[:_AVOIDED],
    )


def _place(point: GridPoint, before: int) -> tuple[float, float]:
    """Return the place of a reading at a point, beside those that are there already."""
    return round(point.x_m + (0.0, _APART_M, -_APART_M)[before], 1), round(point.y_m, 1)


def list_times(mains_hz: float | None, kind: LampKind | None) -> tuple[ExposureTime, ...]:
    """Return usual exposure times with the largest error by flicker of twice the mains, the largest first.

    m |sin(pi f t)| / (pi f t) for the largest modulation m of the kind of lamp; 50 or 60 Hz where the mains
    is not stated.
    """
    depth = find_modulation(kind, None)[1]
    mains = (50.0, 60.0) if mains_hz is None else (mains_hz,)
    found = []
    for each in _TIMES:
        turns = [2.0 * math.pi * hz / each for hz in mains]
        error = max(depth * abs(math.sin(turn)) / turn if turn else 0.0 for turn in turns)
        found.append(ExposureTime(time_s=1.0 / each, error_rel=error))
    return tuple(sorted(found, key=lambda each: -each.error_rel))


def _foresee(road: Road, points: Sequence[GridPoint], light: Mapping[str, float]) -> tuple[Rows, Field]:
    """Solve for a road without readings, seen once."""
    bare = replace(road, control=(), hidden=())
    seen = [
        Reading(place=n, frame="", luminance_cd_m2=e, u_rel=_NOISE_U, view_deg=0.0, place_u_m=0.0)
        for n, e in light.items()
    ]
    places = gather(bare, points, seen)
    rows = make_rows(bare, places, Scale(u_rel=0.025))
    model = replace(USUAL, patches_rel=road.conditions.patches_u_rel)
    return rows, solve_field(places.ground, rows, model)
