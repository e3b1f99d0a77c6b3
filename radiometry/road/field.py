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
    fixed, seen = _cover(alone), ground.at(alone.places)
    usual = np.log(list(asdict(replace(USUAL, patches_rel=patches)).values()))

    def cost(ln: Array) -> float:
        model = _read(ln)
        covariance = fixed + _vary(model, seen) + _scatter(model, seen)
        low = np.linalg.cholesky(covariance)
        white = scipy.linalg.solve_triangular(low, alone.values, lower=True)
        prior = float(np.sum(((ln - usual) / _WIDE) ** 2)) / 2.0
        return float(white @ white) / 2.0 + float(np.sum(np.log(np.diag(low)))) + prior

    smooth, rough = np.array([-0.5, 0.0, 0.5, 0.5, 0.0, 0.0]), np.array([0.0, 0.0, -0.5, -0.5, 0.0, 0.0])
    starts = [usual, usual + smooth, usual + rough]
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


def solve_field(ground: Ground, rows: Rows, model: Model) -> Field:
    """Solve for ln E at all places, with the contribution of every source to its error."""
    count = len(ground.xy_m)
    patches = np.linalg.cholesky(_scatter(model, ground) + 1e-12 * np.eye(count))[rows.places]
    patches[~rows.sees_pavement] = 0.0
    of_rows = {
        **rows.shared,
        "patches": patches,
        "points": np.diag(np.where(rows.is_reading, rows.own_u, 0.0)),
        "noise": np.diag(np.where(rows.is_reading, 0.0, rows.own_u)),
    }
    light = _vary(model, ground)
    seen = light[:, rows.places]
    covariance = seen[rows.places] + sum(effect @ effect.T for effect in of_rows.values())
    inverse = np.linalg.inv(covariance)
    gain = seen @ inverse
    errors = {source: -gain @ effect for source, effect in of_rows.items()}
    left = inverse @ rows.values / np.diag(inverse)
    shared = np.concatenate(list(rows.shared.values()), axis=1)
    of_levels = shared.T @ inverse
    pull = np.eye(count) - gain @ np.eye(count)[rows.places]
    errors["field"] = pull @ np.linalg.cholesky(light + 1e-9 * np.eye(count))
    return Field(
        mean=gain @ rows.values,
        covariance=light - gain @ seen.T,
        errors=errors,
        levels=(of_levels @ rows.values, np.eye(shared.shape[1]) - of_levels @ shared),
        left=left,
        left_u=1.0 / np.sqrt(np.diag(inverse)),
    )


def _cover(rows: Rows) -> Array:
    """Return the covariance of what rows share, and of their own errors."""
    shared = (effect @ effect.T for effect in rows.shared.values())
    return np.asarray(np.diag(rows.own_u**2) + sum(shared, np.zeros((1, 1))))


def _scatter(model: Model, ground: Ground) -> Array:
    """Return the covariance of the pavement's patches between places."""
    x, y = ground.xy_m.T
    apart = np.hypot(np.subtract.outer(x, x), np.subtract.outer(y, y))
    return np.asarray(model.patches_rel**2 * np.exp(-apart / model.patch_m))


def _vary(model: Model, ground: Ground) -> Array:
    """Return the prior covariance of ln E between places."""

    def resemble(here: Array, there: Array) -> Array:
        along = np.subtract.outer(here[:, 0], there[:, 0]) / model.along_m
        across = np.subtract.outer(here[:, 1], there[:, 1]) / model.across_m
        return np.asarray(np.exp(-(along**2 + across**2) / 2.0))

    # the mean over all pairs of rows, of which each place lies under both
    pairs = [resemble(here, there) for here, there in itertools.product(ground.under, repeat=2)]
    alike = sum(pairs[1:], pairs[0]) / len(ground.under)
    near = (1.0 - model.unlike) * alike + model.unlike * resemble(ground.xy_m, ground.xy_m)
    return np.asarray(_MEAN_U**2 + _TREND_U**2 * np.outer(ground.trend, ground.trend) + model.sigma**2 * near)


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


def draw_fields(fields: Sequence[Field], *, places: int, draws: int) -> Array:
    """Draw E [lx] at the first places, as often from each posterior, (draws, places)."""
    random, found = np.random.default_rng(0), []
    for field in fields:
        values, vectors = np.linalg.eigh(field.covariance[:places, :places])
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        normal = random.standard_normal((draws // len(fields), places))
        found.append(field.mean[:places] + normal @ root.T)
    return np.asarray(np.exp(np.concatenate(found)))
