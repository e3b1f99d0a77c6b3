"""Parts of a result: points, control points, scales, grid and budget of a solved field."""

import math
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from radiometry.road import codes
from radiometry.road.field import ANGLE_U, Field, Rows
from radiometry.road.grid import GridPoint, find_distance
from radiometry.road.observations import Places
from radiometry.road.results import (
    ControlResult,
    GridResult,
    PointResult,
    PointState,
    ScaleResult,
    Share,
)
from radiometry.road.site import LANES, Road

Array = NDArray[np.float64]

# Sources that a reader sees as one
_NAMES = {
    "patches": "pavement",
    "field": "pavement",
    "noise": "camera",
    "frames": "camera",
    "falloff": "lens",
}
_UNEVEN = ("angle", "falloff", "frames")


def find_judged(road: Road, points: Sequence[GridPoint]) -> NDArray[np.intp]:
    """Return the points of the part that the requirement judges."""
    lanes, part = {each.name for each in road.site.lanes}, road.requirement.part
    parts = lanes if part == LANES else {part}
    judged = np.array([n for n, each in enumerate(points) if each.part in parts], np.intp)
    if not len(judged):
        raise codes.SITE_INVALID.refuse(f"The site has no {part}.")
    return judged


def compare_control(
    road: Road, places: Places, rows: Rows, field: Field, used: NDArray[np.bool_]
) -> tuple[ControlResult, ...]:
    """Compare each control point with the map that is made without it."""
    first = len(places.names) - len(road.control)
    row_of = {int(rows.places[row]): row for row in np.flatnonzero(rows.is_reading).tolist()}
    left_at = {row: n for n, row in enumerate(np.flatnonzero(used).tolist())}
    found = []
    for n, each in enumerate(road.control, start=first):
        row, seen = row_of.get(n), places.seen[n]
        state: PointState = "left_out" if row is None else "differs"
        difference = u = None
        if row is not None and row in left_at:
            state = "not_seen" if seen is None else "agrees"
            difference, u = float(field.left[left_at[row]]), float(field.left_u[left_at[row]])
        elif each.quantity == "illuminance":
            difference = each.ln_mean - float(field.mean[n])
            u = math.hypot(math.sqrt(field.covariance[n, n]), each.own_u)
        found.append(
            ControlResult(
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


def report_points(points: Sequence[GridPoint], places: Places, field: Field) -> tuple[PointResult, ...]:
    return tuple(
        PointResult(
            **asdict(each),
            illuminance_lx=math.exp(field.mean[n]),
            u_rel=math.sqrt(field.covariance[n, n]),
            luminance_cd_m2=None if (seen := places.seen[n]) is None else math.exp(seen.ln_luminance),
            is_hidden=places.seen[n] is None,
        )
        for n, each in enumerate(points)
    )


def report_scales(places: Places, rows: Rows, field: Field) -> tuple[ScaleResult, ...]:
    """Return factor and slope of each pavement with what was expected of them."""
    surfaces, found = np.array(places.surfaces)[rows.places], []
    for surface in sorted(set(places.surfaces)):
        ours = np.flatnonzero((surfaces == surface) & ~rows.is_reading)
        if not len(ours):
            continue
        # ln E - ln L is less what a luminance of this pavement contains, but for the angle
        weights = np.concatenate(
            [
                np.zeros(effect.shape[1]) if source in _UNEVEN else -effect[ours].mean(axis=0)
                for source, effect in rows.shared.items()
            ]
        )
        mean, covariance = field.levels
        before = [name for name, effect in rows.shared.items() for _ in range(effect.shape[1])]
        slope = before.index("angle")
        found.append(
            ScaleResult(
                surface=surface,
                factor=math.exp(weights @ mean),
                factor_u=math.exp(weights @ mean) * math.sqrt(weights @ covariance @ weights),
                expected_u=float(np.linalg.norm(weights)),
                slope=ANGLE_U * float(mean[slope]),
                slope_u=ANGLE_U * math.sqrt(covariance[slope, slope]),
            )
        )
    return tuple(found)


def describe_grid(points: Sequence[GridPoint], judged: NDArray[np.intp], places: Places) -> GridResult:
    ours = [points[n] for n in judged]
    along, across = (find_distance(getattr(p, axis) for p in ours) or 1.0 for axis in ("x_m", "y_m"))
    seen = [found for n in judged if (found := places.seen[n]) is not None]
    return GridResult(
        points=len(ours),
        hidden=len(ours) - len(seen),
        along=len({each.x_m for each in ours}),
        along_m=along,
        across_m=across,
        place_u_m=max((each.place_u_m for each in seen), default=0.0),
        place_limit_m=min(along, across) / 3.0,
        view_deg=max((each.view_deg for each in seen), default=0.0),
    )


def share_out(field: Field, judged: NDArray[np.intp], weights: Array) -> tuple[Share, ...]:
    """Return what each source contributes to a weighted sum of ln E."""
    variances: dict[str, float] = {}
    for source, errors in field.errors.items():
        name = _NAMES.get(source, source)
        variances[name] = variances.get(name, 0.0) + float(np.sum((weights @ errors[judged]) ** 2))
    total = sum(variances.values()) or 1.0
    return tuple(
        Share(source=source, u_rel=math.sqrt(variance), variance_share=variance / total)
        for source, variance in sorted(variances.items(), key=lambda each: -each[1])
    )
