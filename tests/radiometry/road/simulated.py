"""Roads by other means than the product's: luminaires of a table of intensities, pavements with patches, a
camera and a lux meter, each with errors that are known.

    I(C, gamma)   a table every 5 degrees, a spline between them
    E             = sum of I cos^3 gamma / H^2 over the luminaires
    L             = rho / pi (1 + b1' (1 - cos gamma)) E, each lamp on its own, times the patch of the place;
                    patches are squares of .3 to 2 m
"""

import dataclasses
import math

import numpy as np
from scipy.interpolate import RectBivariateSpline

from radiometry.road.evaluation import evaluate_road
from radiometry.road.grid import GridPoint, lay_points
from radiometry.road.observations import Sight, lay_cells
from radiometry.road.rules import find_rule
from radiometry.road.site import (
    Conditions,
    ControlPoint,
    Criterion,
    Meter,
    Requirement,
    Road,
    Row,
    Scale,
    Site,
    Strip,
)

EN = "EN 13201-2:2015"
# luminance factors at nadir, from dark asphalt to light concrete
PAVEMENTS = (0.07, 0.085, 0.10, 0.115, 0.13, 0.15, 0.18, 0.22)
LUX = {"quantity": "illuminance", "unit": "lx", "meter_id": "lux"}
SCALE = Scale(u_rel=0.015, meter=Meter(meter="K-meter", u_rel=0.02), spectral_u_rel=0.1)


@dataclasses.dataclass
class Luminaire:
    """Intensities of a street luminaire, (C, gamma) every 5 degrees [cd]; C = 0 along the road."""

    table: np.ndarray

    def __post_init__(self):
        c, gamma = (np.arange(0.0, 5.0 * n, 5.0) for n in self.table.shape)
        self.curve = RectBivariateSpline(c, gamma, self.table)

    @classmethod
    def draw(cls, random, lumen=33200.0):
        """A wing to both sides along, thrown somewhat across, cut off towards the horizon."""
        c, gamma = np.radians(np.arange(0, 365, 5))[:, None], np.radians(np.arange(0, 95, 5))[None]
        peak, width = np.radians(random.uniform(48, 64)), np.radians(random.uniform(14, 22))
        aim = np.radians(random.uniform(10, 25))
        # C beyond 180 degrees is behind the luminaire
        along = np.maximum(np.cos(c - aim), np.cos(np.pi - c - aim)).clip(0) ** random.uniform(1.5, 4)
        wings = along * np.exp(-(((gamma - peak) / width) ** 2))
        behind = np.where(np.sin(c) < -1e-9, random.uniform(0.3, 0.6), 1.0)
        below = random.uniform(0.5, 1.0) * np.cos(gamma) ** 0.5
        shape = (wings + below) * behind / (1 + np.exp((gamma - np.radians(78)) / 0.04))
        solid = np.radians(5) ** 2 * np.sin(gamma)
        return cls(shape * lumen * random.uniform(0.6, 0.8) / np.sum(shape[:-1] * solid))

    def shine(self, x, y, height, *, turned):
        """Illuminance at places from below the lamp, and cos gamma; `turned` lamps stand on the far side."""
        y = -y if turned else y
        away = np.hypot(x, y)
        gamma = np.degrees(np.arctan2(away, height))
        c = np.degrees(np.arctan2(y, x)) % 360
        intensity = self.curve(c, gamma, grid=False)
        cosine = height / np.hypot(away, height)
        return intensity * cosine**3 / height**2, cosine


@dataclasses.dataclass
class Truth:
    """A road with its true light."""

    site: Site
    luminaire: Luminaire
    rho: float
    b1: float
    patches: float
    lamp: float = 1.0  # shown over true luminance, by the lamp's spectrum

    def light(self, xy):
        """E [lx] and the luminance of a pavement without patches [cd/m2]."""
        e, luminance = np.zeros(len(xy)), np.zeros(len(xy))
        middle = np.mean([s.y_m + s.width_m / 2 for s in self.site.lanes])
        for row in self.site.rows:
            for n in range(-8, 10):
                x = xy[:, 0] - row.first_x_m - n * row.spacing_m
                part, cosine = self.luminaire.shine(
                    x, xy[:, 1] - row.y_m, row.height_m, turned=row.y_m > middle
                )
                e += part
                luminance += part * self.rho / math.pi * np.exp(-self.b1 * (1 - cosine))
        return e, luminance


def draw_road(random, *, patches=0.05, b1=None, lamp=1.0):
    height = random.uniform(7, 10)
    spacing = round(height * random.uniform(3.2, 4.5))
    kind = random.choice(["one side", "opposite", "staggered"])
    rows = [Row(y_m=-1.0, height_m=height, spacing_m=spacing)]
    if kind != "one side":
        first = 0.0 if kind == "opposite" else spacing / 2
        rows.append(Row(y_m=8.0, height_m=height, spacing_m=spacing, first_x_m=first))
    lanes = tuple(Strip(name=str(n + 1), kind="lane", y_m=3.5 * n, width_m=3.5) for n in range(2))
    site = Site(rows=tuple(rows), strips=lanes)
    b1 = random.uniform(-0.3, 0.3) if b1 is None else b1
    return Truth(site, Luminaire.draw(random), random.choice(PAVEMENTS), b1, patches, lamp)


def place_points(points: tuple[GridPoint, ...], count):
    """Every other one half below and half between the lamps, on both lanes."""
    x = sorted({p.x_m for p in points})
    y = sorted({p.y_m for p in points})
    near = [0, 1, len(x) - 2, len(x) - 1]
    middle = [len(x) // 2 + n for n in (-2, -1, 0, 1)]
    chosen = []
    for n in range(count):
        cols = (near, middle)[n % 2]
        chosen.append((x[cols[(n // 2) % 4]] + 0.2, y[(1, 4, 2, 5, 0, 3)[(n + n // 4) % 6]] + 0.1))
    return chosen


def survey(
    truth,
    random,
    *,
    count=8,
    scale=SCALE,
    same_meter=False,
    wrong=None,
    spectral=0.1,
    limit_at_truth=False,
    rho_u=0.15,
    noise=0.002,
    above_m=None,
):
    """The road as the worker and a person state it, what a frame shows, and E on the grid."""
    points = lay_points(truth.site, find_rule(EN).grid)
    places = place_points(points, count)
    e, _ = truth.light(np.array([(p.x_m, p.y_m) for p in points] + places))
    meter = 0.02 * random.standard_normal()
    of_k = meter if same_meter else 0.02 * random.standard_normal()
    shown = scale.u_rel * random.standard_normal() + of_k + math.log(truth.lamp)
    shown += spectral * random.standard_normal()
    read = e[len(points) :] * np.exp(meter + 0.03 * random.standard_normal(count))
    if wrong is not None:
        read[wrong] *= random.choice([0.5, 2.0])
    control = tuple(
        ControlPoint(name=f"P{n + 1}", x_m=x, y_m=y, **LUX, values=(float(v),))
        for n, ((x, y), v) in enumerate(zip(places, read, strict=True))
    )
    true = {"e_av": e[: len(points)].mean(), "u_0": e[: len(points)].min() / e[: len(points)].mean()}
    limits = [Criterion(figure=name, at_least=float(value)) for name, value in true.items()]
    stated = truth.rho * math.exp(rho_u * random.standard_normal())
    road = Road(
        site=truth.site,
        requirement=Requirement(
            rule=EN, road_class="C3", criteria=tuple(limits) if limit_at_truth else (), confirmed="me"
        ),
        conditions=Conditions(
            surface="dry", reflectance=stated, reflectance_u_rel=rho_u, mains_frequency_hz=50.0
        ),
        control=control,
        meters=(Meter(meter_id="lux", meter="lux", u_rel=0.02),),
    )
    if same_meter:
        scale = dataclasses.replace(scale, meter=Meter(meter="lux", u_rel=0.02))
    cells = lay_cells(road, points)
    seen = look(truth, cells, random) * np.exp(shown + noise * random.standard_normal(len(cells.names)))
    off_axis = np.zeros(len(seen))
    if above_m is not None:  # a lens with the falloff of cos^4, over the middle of the field
        low, high = truth.site.field_m
        off_axis = np.arctan(np.hypot(*(cells.xy_m - ((low + high) / 2.0, 3.5)).T) / above_m)
    none = np.zeros((1, len(seen)))
    sight = Sight(
        luminance_cd_m2=seen[None] * np.cos(off_axis) ** 4,
        u_rel=none + noise,
        view_deg=none + 10.0,
        off_axis_deg=none + np.degrees(off_axis),
        place_u_m=none,
        red_over_green=none + np.nan,
    )
    return road, points, sight, scale, e[: len(points)]


def look(truth, cells, random):
    """Mean luminance of each rectangle, brought to its middle as the worker does."""
    steps = (np.arange(7) - 3.0) / 7.0
    spots = cells.xy_m + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 1, 2) * cells.sides_m
    field, size_m = random.standard_normal((400, 400)), random.uniform(0.3, 2.0)
    patches = truth.patches * field[tuple(np.floor(spots / size_m).astype(int).T % 400)].T
    _, luminance = truth.light(spots.reshape(-1, 2))
    return np.mean(luminance.reshape(patches.shape) * np.exp(patches), axis=0) / cells.brighter


def measure_road(seed):
    """Error of E_av and U_0, half of its interval, whether that holds the truth, if a limit there is met."""
    random = np.random.default_rng(seed)
    truth = draw_road(random, patches=(0.05, 0.1)[seed % 2])
    road, points, sight, scale, _ = survey(truth, random, limit_at_truth=True)
    result = evaluate_road(road, points, sight, scale=scale)
    figures, found = {each.figure: each for each in result.figures}, []
    for criterion in result.criteria:
        value, figure = criterion.at_least, figures[criterion.figure]
        half, is_held = figure.expanded_uncertainty / value, figure.low <= value <= figure.high
        found.append((figure.value / value - 1.0, half, is_held, criterion.verdict == "conforms"))
    return found
