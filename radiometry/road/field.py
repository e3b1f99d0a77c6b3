"""Field of ln E: one generalised least squares of luminances and meter readings, with kriging between them.

Of places x with light f = ln E, pavement of luminance factor rho and patches p, and light that arrives at
gamma from the vertical [1, 2]::

    ln L(x) - ln(rho_0 / pi) = f(x) - r - b1 (1 - cos gamma) + p(x) + camera + spectrum + meter of K + own
    ln E_j                   = f(x_j) + meter + own
    ln L_j                   = f(x_j) + ln(rho_0 / pi) - r - b1 (1 - cos gamma_j) + p(x_j) + meter + own

f is a Gaussian process about a free mean and a free multiple of ln E of lamps that shine alike in all
directions: what is left is smoother and smaller than the light itself. r, b1 and all errors have mean 0 and
the variances that are stated of them. A meter that is behind K and at the points is one error. Patches are
not light: the field is without them. Its lengths, its size and the scatter of patches are those of the
largest marginal likelihood of the luminances alone, so that no reading of a meter can change them.

[1] C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, sections 2.7
and 5.4
[2] JCGM 102:2011, doi:10.59161/JCGM102-2011
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.records import Record
from radiometry.road.results import Model

Array = NDArray[np.float64]

ANGLE_U = 0.2
_MEAN_U, _TREND_U = 10.0, 1.0
USUAL = Model(patches_rel=0.05, along_m=5.0, across_m=5.0, sigma=0.5)
# of the ln of along, across, sigma and patches
_WIDE = np.array([1.0, 1.0, 1.0, 1.0])
_MODELS, _STEP = 24, 0.05
_BOUNDS = tuple(zip(np.log([1.5, 1.5, 0.05, 0.005]), np.log([30.0, 60.0, 3.0, 0.4]), strict=True))


class Rows(Record):
    """Observations: luminances first, then meter readings; `places` are those of the field that they see."""

    values: Array  # (rows,), as the equations above
    places: NDArray[np.intp]  # (rows,), index of the place of each
    sees_pavement: NDArray[np.bool_]  # (rows,), of luminances, also of a meter
    is_reading: NDArray[np.bool_]  # (rows,), of a meter
    own_u: Array  # (rows,)
    meters: tuple[str, ...]  # the levels of "meter"
    #: Effects of one standard uncertainty of each other error, (rows, levels), by source
    shared: Mapping[str, Array]


class Field(NamedTuple):
    """Posterior of ln E at all places."""

    mean: Array
    covariance: Array
    #: Errors of the mean by one standard uncertainty of each source, (places, levels)
    errors: Mapping[str, Array]
    #: Posterior mean of all levels of all sources in their order, in their standard uncertainties, and its
    #: covariance
    levels: tuple[Array, Array]
    #: Of each row: what is left against its prediction from all others, and the uncertainty of that
    left: Array
    left_u: Array


def fit_models(xy_m: Array, trend: Array, rows: Rows, *, patches: float) -> tuple[Model, ...]:
    """Fit lengths, size and patches of the field to the luminances alone.

    The first model is the most likely one. The others are drawn from its Laplace approximation, and again by
    their likelihood over that of the approximation: figures then know how well the field is known.
    """
    alone = select_rows(rows, ~rows.is_reading)
    fixed, usual = _cover(alone), np.log([USUAL.along_m, USUAL.across_m, USUAL.sigma, patches])

    def cost(ln: Array) -> float:
        covariance = fixed + _vary(_read(ln), xy_m[alone.places], trend[alone.places])
        covariance[np.diag_indices_from(covariance)] += math.exp(2.0 * ln[3])
        low = np.linalg.cholesky(covariance)
        white = scipy.linalg.solve_triangular(low, alone.values, lower=True)
        prior = float(np.sum(((ln - usual) / _WIDE) ** 2)) / 2.0
        return float(white @ white) / 2.0 + float(np.sum(np.log(np.diag(low)))) + prior

    starts = [usual, usual + np.array([0.5, 0.5, 0.0, -0.5]), usual - np.array([0.5, 0.5, 0.0, 0.0])]
    found = [scipy.optimize.minimize(cost, start, method="L-BFGS-B", bounds=_BOUNDS) for start in starts]
    best = min(found, key=lambda each: float(each.fun))
    return _read(best.x), *(_read(each) for each in _draw_models(cost, best.x))


def _draw_models(cost: Callable[[Array], float], best: Array) -> Array:
    """Draw from the density exp(-cost) about its maximum, (models, parameters)."""
    steps = _STEP * np.eye(len(best))
    curve = np.array(
        [
            [cost(best + a + b) - cost(best + a - b) - cost(best - a + b) + cost(best - a - b) for b in steps]
            for a in steps
        ]
    ) / (4.0 * _STEP**2)
    values, vectors = np.linalg.eigh(curve)
    random = np.random.default_rng(0)
    normal = random.standard_normal((_MODELS, len(best)))
    drawn = np.clip(best + normal / np.sqrt(np.maximum(values, 1.0)) @ vectors.T, *np.array(_BOUNDS).T)
    ln = np.sum(normal**2, axis=1) / 2.0 - [cost(each) for each in drawn]
    likely = np.exp(ln - ln.max())
    return np.asarray(drawn[random.choice(_MODELS, _MODELS, p=likely / likely.sum())])


def select_rows(rows: Rows, kept: NDArray[np.bool_]) -> Rows:
    """Return some of the rows."""
    own = {
        name: getattr(rows, name)[kept]
        for name in ("values", "places", "sees_pavement", "is_reading", "own_u")
    }
    return replace(rows, **own, shared={source: effect[kept] for source, effect in rows.shared.items()})


def solve_field(xy_m: Array, trend: Array, rows: Rows, model: Model) -> Field:
    """Solve for ln E at all places, with the contribution of every source to its error."""
    patches = np.zeros((len(rows.values), len(xy_m)))
    patches[np.flatnonzero(rows.sees_pavement), rows.places[rows.sees_pavement]] = model.patches_rel
    of_rows = {
        **rows.shared,
        "patches": patches,
        "points": np.diag(np.where(rows.is_reading, rows.own_u, 0.0)),
        "noise": np.diag(np.where(rows.is_reading, 0.0, rows.own_u)),
    }
    light = _vary(model, xy_m, trend)
    seen = light[:, rows.places]
    covariance = seen[rows.places] + sum(effect @ effect.T for effect in of_rows.values())
    inverse = np.linalg.inv(covariance)
    gain = seen @ inverse
    errors = {source: -gain @ effect for source, effect in of_rows.items()}
    left = inverse @ rows.values / np.diag(inverse)
    shared = np.concatenate(list(rows.shared.values()), axis=1)
    of_levels = shared.T @ inverse
    pull = np.eye(len(xy_m)) - _spread(gain, rows.places, len(xy_m))
    errors["field"] = pull @ np.linalg.cholesky(light + 1e-9 * np.eye(len(xy_m)))
    return Field(
        mean=gain @ rows.values,
        covariance=light - gain @ seen.T,
        errors=errors,
        levels=(of_levels @ rows.values, np.eye(shared.shape[1]) - of_levels @ shared),
        left=left,
        left_u=1.0 / np.sqrt(np.diag(inverse)),
    )


def _spread(gain: Array, places: NDArray[np.intp], count: int) -> Array:
    """Return the weight of each place's light in the estimates, (places, places)."""
    weights = np.zeros((len(gain), count))
    np.add.at(weights.T, places, gain.T)
    return weights


def _cover(rows: Rows) -> Array:
    """Return the covariance of what rows share, and of their own errors."""
    shared = (effect @ effect.T for effect in rows.shared.values())
    return np.asarray(np.diag(rows.own_u**2) + sum(shared, np.zeros((1, 1))))


def _vary(model: Model, xy_m: Array, trend: Array) -> Array:
    """Return the prior covariance of ln E between places."""
    apart = (xy_m[:, None, :] - xy_m[None, :, :]) / (model.along_m, model.across_m)
    near = model.sigma**2 * np.exp(-np.sum(apart**2, axis=2) / 2.0)
    return np.asarray(_MEAN_U**2 + _TREND_U**2 * np.outer(trend, trend) + near)


def _read(ln: Array) -> Model:
    along, across, sigma, patches = np.exp(ln).tolist()
    return Model(patches_rel=patches, along_m=along, across_m=across, sigma=sigma)


def light_evenly(places_m: Array, lamps_m: Array) -> tuple[Array, Array]:
    """Compute ln E and the mean of 1 - cos gamma at places, of lamps (x, y, height) of 1 cd everywhere."""
    apart = places_m[:, None, :] - lamps_m[None, :, :2]
    cosines = lamps_m[:, 2] / np.sqrt(np.sum(apart**2, axis=2) + lamps_m[:, 2] ** 2)
    weights = cosines**3 / lamps_m[:, 2] ** 2
    light = np.sum(weights, axis=1)
    return np.log(light), np.asarray(np.sum(weights * (1.0 - cosines), axis=1) / light)


def draw_fields(fields: Sequence[Field], *, places: int, draws: int) -> Array:
    """Draw E [lx] at the first places, as often from each posterior, (draws, places)."""
    random, found = np.random.default_rng(0), []
    for field in fields:
        values, vectors = np.linalg.eigh(field.covariance[:places, :places])
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        normal = random.standard_normal((draws // len(fields), places))
        found.append(field.mean[:places] + normal @ root.T)
    return np.asarray(np.exp(np.concatenate(found)))
