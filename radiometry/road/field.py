"""Field of ln E: one generalised least squares of luminances and meter readings, with kriging between them.

Of places x with light f = ln E, pavement of luminance factor rho and patches p, and light that arrives at
gamma from the vertical [1, 2]::

    ln L(x) - ln(rho_0 / pi) = f(x) - r - b1 (1 - cos gamma) + p(x) + camera + spectrum + meter of K + own
    ln E_j                   = f(x_j) + meter + own
    ln L_j                   = f(x_j) + ln(rho_0 / pi) - r - b1 (1 - cos gamma_j) + p(x_j) + meter + own

f is a Gaussian process about a free mean and a free multiple of ln E of lamps that shine alike in all
directions: what is left is smoother and smaller than the light itself, and nearly the same at places that lie
alike under their nearest luminaires. r, b1 and all errors have mean 0 and the variances that are stated of
them. A meter that is behind K and at the points is one error. Patches are not light: the field is without
them; near places share them. Lengths and sizes of the field and of patches are those of the largest marginal
likelihood of the luminances alone, so that no reading of a meter can change them.

[1] C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, sections 2.7
and 5.4
[2] JCGM 102:2011, doi:10.59161/JCGM102-2011
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.road.results import Model
from radiometry.road.site import Site

Array = NDArray[np.float64]

ANGLE_U = 0.2
_MEAN_U, _TREND_U = 10.0, 1.0
USUAL = Model(patches_rel=0.05, patch_m=0.5, along_m=5.0, across_m=7.5, sigma=0.3, unlike=0.03)
# of the ln of each, in this order
_WIDE = np.array([1.0, 0.7, 0.5, 0.5, 1.0, 0.5])
_MODELS, _STEP = 60, 0.05
_BOUNDS = tuple(
    zip(np.log([0.005, 0.1, 1.5, 1.5, 0.05, 0.005]), np.log([0.4, 3.0, 30.0, 60.0, 3.0, 0.9]), strict=True)
)
_ROWS_NEAR = 2


class Ground(NamedTuple):
    """Places on a road, as they lie under its luminaires."""

    xy_m: Array  # (n, 2)
    trend: Array  # (n,), ln E of lamps that shine alike in all directions
    angles: Array  # (n,), their mean of 1 - cos gamma
    #: Distances along and across from the nearest luminaire of each of the rows nearby, (rows, n, 2) [m]
    under: Array

    def at(self, places: NDArray[np.intp]) -> "Ground":
        return Ground(self.xy_m[places], self.trend[places], self.angles[places], self.under[:, places])


class Apart(NamedTuple):
    """How places lie to each other, whatever the model."""

    distance_m: Array  # (n, n)
    #: Squared distances along and across, (2, n, n) each: of the places, then as they lie under each pair of
    #: the rows nearby
    squares_m2: tuple[Array, ...]
    rows: int
    trend: Array  # covariance of what follows the light of lamps that shine alike


def measure_apart(ground: Ground) -> Apart:
    """Measure what the covariances of all models take."""
    pairs = [(ground.xy_m, ground.xy_m), *itertools.product(ground.under, repeat=2)]
    squares = tuple((here.T[:, :, None] - there.T[:, None, :]) ** 2 for here, there in pairs)
    trend = _TREND_U**2 * np.outer(ground.trend, ground.trend)
    return Apart(np.sqrt(squares[0].sum(axis=0)), squares, len(ground.under), trend)


class Rows(NamedTuple):
    """Observations: luminances first, then meter readings; `places` are those of the field that they see."""

    values: Array  # (rows,), as the equations above
    places: NDArray[np.intp]  # (rows,), index of the place of each
    sees_pavement: NDArray[np.bool_]  # (rows,), of luminances, also of a meter
    is_reading: NDArray[np.bool_]  # (rows,), of a meter
    own_u: Array  # (rows,)
    #: Effects of one standard uncertainty of each other error, (rows, levels), by source
    shared: Mapping[str, Array]
    meters: tuple[str, ...]  # the levels of "meter"

    def keep(self, kept: NDArray[np.bool_]) -> "Rows":
        some: dict[str, Any] = {
            name: each[kept] for name, each in self._asdict().items() if name not in {"shared", "meters"}
        }
        shared = {source: effect[kept] for source, effect in self.shared.items()}
        return self._replace(**some, shared=shared)


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


def fit_models(ground: Ground, rows: Rows, *, patches: float) -> tuple[Model, ...]:
    """Fit lengths, size and patches of the field to the luminances alone.

    The first model is the most likely one. The others are drawn from its Laplace approximation, and again by
    their likelihood over that of the approximation: figures then know how well the field is known.
    """
    alone = rows.keep(~rows.is_reading)
    fixed, apart = _cover(alone), measure_apart(ground.at(alone.places))
    usual = np.log(list(asdict(replace(USUAL, patches_rel=patches)).values()))

    def cost(ln: Array) -> tuple[float, Array]:
        """Return the logarithm of the likelihood with the prior, negative, and its gradient."""
        model = _read(ln)
        scatter, light = _scatter(model, apart), _vary(model, apart)
        low = np.linalg.cholesky(fixed + scatter[0] + light[0])
        inverse = scipy.linalg.cho_solve((low, True), np.eye(len(low)))
        left, away = inverse @ alone.values, (ln - usual) / _WIDE
        weights = (inverse - np.outer(left, left)) / 2.0
        slopes = np.array([np.sum(weights * each) for each in (*scatter[1:], *light[1:])])
        value = (alone.values @ left + away @ away) / 2.0 + np.sum(np.log(np.diag(low)))
        return float(value), slopes + away / _WIDE

    smooth, rough = np.array([-0.5, 0.0, 0.5, 0.5, 0.0, 0.0]), np.array([0.0, 0.0, -0.5, -0.5, 0.0, 0.0])
    how: dict[str, Any] = {"jac": True, "method": "L-BFGS-B", "bounds": _BOUNDS}
    found = [scipy.optimize.minimize(cost, usual + start, **how) for start in (0.0, smooth, rough)]
    best = min(found, key=lambda each: float(each.fun))
    return _read(best.x), *(_read(each) for each in _draw_models(cost, best.x))


def _draw_models(cost: Callable[[Array], tuple[float, Array]], best: Array) -> Array:
    """Draw from the density exp(-cost) about its maximum, (models, parameters)."""
    steps = _STEP * np.eye(len(best))
    curve = np.array([cost(best + step)[1] - cost(best - step)[1] for step in steps]) / (2.0 * _STEP)
    values, vectors = np.linalg.eigh((curve + curve.T) / 2.0)
    random = np.random.default_rng(0)
    normal = random.standard_normal((_MODELS, len(best)))
    drawn = np.clip(best + normal / np.sqrt(np.maximum(values, 1.0)) @ vectors.T, *np.array(_BOUNDS).T)
    ln = np.sum(normal**2, axis=1) / 2.0 - [cost(each)[0] for each in drawn]
    likely = np.exp(ln - ln.max())
    return np.asarray(drawn[random.choice(_MODELS, _MODELS, p=likely / likely.sum())])


def solve_field(ground: Ground, rows: Rows, model: Model) -> Field:
    """Solve for ln E at all places, with the contribution of every source to its error."""
    count, apart = len(ground.xy_m), measure_apart(ground)
    light, inverse, gain = _weigh(apart, rows, model)
    patches = np.linalg.cholesky(_scatter(model, apart)[0] + 1e-12 * np.eye(count))[rows.places]
    of_rows = {
        **rows.shared,
        "patches": patches * rows.sees_pavement[:, None],
        "points": np.diag(np.where(rows.is_reading, rows.own_u, 0.0)),
        "noise": np.diag(np.where(rows.is_reading, 0.0, rows.own_u)),
    }
    errors = {source: -gain @ effect for source, effect in of_rows.items()}
    pull = np.eye(count) - gain @ np.eye(count)[rows.places]
    errors["field"] = pull @ np.linalg.cholesky(light + 1e-9 * np.eye(count))
    shared = np.concatenate(list(rows.shared.values()), axis=1)
    of_levels = shared.T @ inverse
    return Field(
        mean=gain @ rows.values,
        covariance=light - gain @ light[rows.places],
        errors=errors,
        levels=(of_levels @ rows.values, np.eye(shared.shape[1]) - of_levels @ shared),
        left=inverse @ rows.values / np.diag(inverse),
        left_u=1.0 / np.sqrt(np.diag(inverse)),
    )


def _weigh(apart: Apart, rows: Rows, model: Model) -> tuple[Array, Array, Array]:
    """Return prior covariance of ln E, inverse covariance of the rows, and their weights in the estimates."""
    light, seen = _vary(model, apart)[0], rows.places
    patches = _scatter(model, apart)[0][np.ix_(seen, seen)] * np.outer(rows.sees_pavement, rows.sees_pavement)
    inverse = np.linalg.inv(light[np.ix_(seen, seen)] + patches + _cover(rows))
    return light, np.asarray(inverse), np.asarray(light[:, seen] @ inverse)


def _cover(rows: Rows) -> Array:
    """Return the covariance of what rows share, and of their own errors."""
    shared = (effect @ effect.T for effect in rows.shared.values())
    return np.asarray(np.diag(rows.own_u**2) + sum(shared, np.zeros((1, 1))))


def _scatter(model: Model, apart: Apart) -> tuple[Array, ...]:
    """Return the covariance of the pavement's patches, and its derivatives by ln of their size and length."""
    ratio = apart.distance_m / model.patch_m
    covariance = model.patches_rel**2 * np.exp(-ratio)
    return covariance, 2.0 * covariance, covariance * ratio


def _vary(model: Model, apart: Apart) -> tuple[Array, ...]:
    """Return the prior covariance of ln E, and its derivatives by ln of lengths, size and `unlike`."""
    own, *under = (
        np.exp(each[0] / (-2.0 * model.along_m**2) + each[1] / (-2.0 * model.across_m**2))
        for each in apart.squares_m2
    )
    alike = sum(under[1:], under[0]) / apart.rows
    near = model.unlike * own + (1.0 - model.unlike) * alike
    parts = model.unlike * own, *((1.0 - model.unlike) / apart.rows * each for each in under)
    along, across = (
        sum((part * each[axis] for part, each in zip(parts, apart.squares_m2, strict=True)), np.zeros(()))
        for axis in (0, 1)
    )
    slopes = along / model.along_m**2, across / model.across_m**2, 2.0 * near, model.unlike * (own - alike)
    return _MEAN_U**2 + apart.trend + model.sigma**2 * near, *(model.sigma**2 * each for each in slopes)


def _read(ln: Array) -> Model:
    return Model(**dict(zip(asdict(USUAL), np.exp(ln).tolist(), strict=True)))


def lay_ground(site: Site, xy_m: Array) -> Ground:
    """Find how places, (n, 2) [m], lie under the luminaires of a site."""
    trend, angles = light_evenly(xy_m, np.array(site.list_lamps()))
    under = []
    for row in site.rows:
        turns = (xy_m[:, 0] - row.first_x_m) / row.spacing_m
        across = (xy_m[:, 1] - row.y_m) * (1.0 if xy_m[:, 1].mean() >= row.y_m else -1.0)
        under.append(np.stack([np.abs(turns - np.round(turns)) * row.spacing_m, across], axis=1))
    found = np.stack(under)
    nearest = np.argsort(np.abs(found[:, :, 1]), axis=0, kind="stable")[:_ROWS_NEAR]
    return Ground(xy_m, trend, angles, np.take_along_axis(found, nearest[:, :, None], axis=0))


def light_evenly(places_m: Array, lamps_m: Array) -> tuple[Array, Array]:
    """Compute ln E and the mean of 1 - cos gamma at places, of lamps (x, y, height) of 1 cd everywhere."""
    apart = places_m[:, None, :] - lamps_m[None, :, :2]
    cosines = lamps_m[:, 2] / np.sqrt(np.sum(apart**2, axis=2) + lamps_m[:, 2] ** 2)
    weights = cosines**3 / lamps_m[:, 2] ** 2
    light = np.sum(weights, axis=1)
    return np.log(light), np.asarray(np.sum(weights * (1.0 - cosines), axis=1) / light)


def draw_fields(ground: Ground, rows: Rows, models: Sequence[Model], *, places: int, draws: int) -> Array:
    """Draw E [lx] at the first places, as often from the posterior of each model, (draws, places)."""
    random, found, apart = np.random.default_rng(0), [], measure_apart(ground)
    for model in models:
        light, _, gain = _weigh(apart, rows, model)
        covariance = light - gain @ light[rows.places]
        values, vectors = np.linalg.eigh(covariance[:places, :places])
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        normal = random.standard_normal((draws // len(models), places))
        found.append((gain @ rows.values)[:places] + normal @ root.T)
    return np.asarray(np.exp(np.concatenate(found)))
