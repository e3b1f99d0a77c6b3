"""A lit surface seen in perspective: its cells in the image, their luminances and their uniformity."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Raised, shared
from radiometry.fitting.evidence import FieldCorrection, Quantity
from radiometry.fitting.sources import EXPECTED_DOF, FLICKER, SCATTER
from radiometry.frame import Frame, roi
from radiometry.frame.exposure import Exposure
from radiometry.frame.grid import MAX_CELLS_A_SIDE, Grid, find_homography, map_plane
from radiometry.frame.statistics import ChannelStatistics, Signal, measure_signal
from radiometry.luminance import codes, maps, method, pixels, results
from radiometry.luminance.application import AppliedLuminance, Effect, apply_to_signal, find_k
from radiometry.luminance.corrections import apply_corrections
from radiometry.records import Record
from radiometry.vignetting.lens import Lens, LensShare

Array = NDArray[np.float64]
Corners = Sequence[tuple[float, float]] | Array
Read = tuple[Signal, LensShare | None]

_OF_CELLS = {
    shared.SATURATED: "Saturated",
    shared.BELOW_DETECTION: "Below detection",
    codes.OUTSIDE_SIGNALS: "Outside the calibrated signals",
}
LEAST_SCATTER_REL: Final = 0.01
"""What repeated frames are expected to scatter at least, until more of them show that they do not."""

# Degrees of freedom of the size that flicker is expected to have: its depth ends where the light goes out
_FLICKER_DOF: Final = 8.0
_OF_REPEATS: Final = (FLICKER, pixels.SCATTER)
_LOCAL: Final = frozenset({FLICKER})  # sources that may err in each cell on its own (see `judge_uniformity`)

_DRAWS: Final = 500
_SEED: Final = 0
_SCALES: Final = (1.2, 1.5)
_POWER: Final = 1.2
_FEWEST: Final = 6  # cells, of which the scatter shows whether one lies apart

LEAST_CELL_PX = 4.0  # width of a cell below which the lens's blur and the rim's half pixels are much of it

# of the frame's diagonal: from 17 mm to 215 mm of a 35 mm camera
_FOCAL_LENGTHS = np.geomspace(0.4, 5.0, 60)
# Distortion of an uncorrected lens and a road's crown, beside the corners' own uncertainty.
_ANGLE_DEG, _RATIO_LN = 5.0, math.log(1.1)
_ERRORS = 3.0
_GREENS = ("G1", "G2", "G")


class Surface(Record):
    """A grid's cells and figures. ``cells`` : rows of columns; ``cell_model`` : "projective"."""

    cell_model: str
    cells: tuple[tuple[Quantity, ...], ...]
    l_av_cd_m2: Quantity
    l_min_cd_m2: Quantity
    l_max_cd_m2: Quantity
    u_o: Quantity | None
    u_l: tuple[Quantity | None, ...]
    average_to_min: Quantity | None
    max_to_min: Quantity | None
    illuminance_lx: Quantity | None


class Cells(Record):
    """Luminances of a grid's cells, and the effect of each source of error on them."""

    values_cd_m2: Array  # (rows, columns)
    noise_cd_m2: Array  # (rows, columns), independent between two cells
    # one standard uncertainty of each source that errs alike in all cells, (sources, rows, columns)
    shared_cd_m2: Array
    # the same of sources that may err alike in all cells, or in each cell on its own
    local_cd_m2: Array


def lay_grid(grid: Grid) -> tuple[tuple[roi.Polygon, ...], ...]:
    """Divide the image of a surface into the images of its equal cells.

    A camera maps a plane to a plane by a homography [1]. With h from the unit square to the corners::

        (x, y, 1) ~ h (u, v, 1),   u = column / columns, v = row / rows                                (1)

    Lines stay lines, so each cell is the quadrilateral of its four lattice points. Bilinear cells would be
    equal fractions of the IMAGE's edges: in perspective the far cells would cover more of the surface than
    the near ones, and averages over cells would give the far end too little weight. Lens distortion is not
    corrected.

    [1] R. Hartley, A. Zisserman, Multiple View Geometry in Computer Vision, Cambridge 2004, section 2.3,
    doi:10.1017/CBO9780511811685
    """
    points = lay_lattice(grid)
    return tuple(
        tuple(
            roi.Polygon.from_points(
                [points[row, col], points[row, col + 1], points[row + 1, col + 1], points[row + 1, col]]
            )
            for col in range(grid.columns)
        )
        for row in range(grid.rows)
    )


def outline(grid: Grid) -> roi.Polygon:
    """Return the quadrilateral of the surface itself."""
    _require_convex(grid.corners)
    return roi.Polygon.from_points(grid.corners)


def lay_lattice(grid: Grid) -> Array:
    """Compute the images of the lattice points between the cells of a grid."""
    if not (1 <= grid.rows <= MAX_CELLS_A_SIDE and 1 <= grid.columns <= MAX_CELLS_A_SIDE):
        raise codes.GRID_INVALID.reject(
            f"A grid has 1 to {MAX_CELLS_A_SIDE} rows and as many columns of cells."
        )
    _require_convex(grid.corners)
    along, down = np.arange(grid.columns + 1) / grid.columns, np.arange(grid.rows + 1) / grid.rows
    points = map_plane(find_homography(grid.corners), np.stack(np.meshgrid(along, down), axis=-1))
    # the given corners, free of rounding: a corner on the frame's border must not leave it
    for (row, col), corner in zip(((0, 0), (0, -1), (-1, -1), (-1, 0)), grid.corners, strict=True):
        points[row, col] = corner
    return points


def _require_convex(corners: Sequence[tuple[float, float]]) -> None:
    """Refuse corners that cannot be the image of a rectangle in front of the camera."""
    points = np.array(corners, np.float64)
    if points.shape != (4, 2) or not np.all(np.abs(points) <= roi.MAX_COORDINATE_PX):
        raise codes.GRID_INVALID.reject("A grid has four corners [x, y] in pixels.")
    edges = np.roll(points, -1, axis=0) - points
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    if not (np.all(turns > 0) or np.all(turns < 0)):
        raise codes.GRID_INVALID.reject(
            "The grid's corners are not those of a surface seen in perspective: give them in order around it "
            "(top-left, top-right, bottom-right, bottom-left), no three on one line."
        )


def check_grid(grid: Grid, *, height_px: int, width_px: int) -> tuple[Raised, ...]:
    """Return the flags of a grid's corners, before anything is measured.

    With h1 and h2 the first two columns of the homography from the unit square, about the frame's centre, and
    w = diag(1/f^2, 1/f^2, 1) for the focal length f [px], angle and ratio of the sides are [1]::

        cos angle = h1' w h2 / sqrt(h1' w h1  h2' w h2),   ratio = sqrt(h1' w h1 / h2' w h2)

    The focal length is not known: the one is taken, between 0.4 and 5 times the frame's diagonal, that makes
    the best rectangle of the corners. Corners that are flagged are therefore those of no camera's rectangle,
    by more than 5 degrees or 10 % and three standard uncertainties of the corners; others may still be wrong.

    [1] Z. Zhang, IEEE Trans. Pattern Anal. 22, 1330 (2000), section 2.3, doi:10.1109/34.888718
    """
    points = lay_lattice(grid)
    flags = _judge_shape(grid, math.hypot(height_px, width_px), (width_px / 2.0, height_px / 2.0))
    if _is_mirrored(grid.corners):
        detail = "Row 1 is on the other side of the surface than the corners' names say."
        flags.append(codes.GRID_MIRRORED.at("grid", detail))
    width = _measure_narrowest(points)
    if width < LEAST_CELL_PX:
        flags.append(codes.CELLS_SMALL.at("grid", f"The narrowest cell is {width:.1f} px wide."))
    return tuple(flags)


def _judge_shape(grid: Grid, diagonal_px: float, centre: tuple[float, float]) -> list[Raised]:
    """Return the flag of corners that no camera sees of a rectangle with these sides."""
    focal_px = _FOCAL_LENGTHS * diagonal_px
    angles, ratios = _compute_shape(grid.corners, focal_px, centre)
    aspect_ln = np.log(ratios / grid.aspect) if grid.aspect else np.zeros_like(ratios)
    misfits = np.maximum(np.abs(angles - 90.0) / _ANGLE_DEG, np.abs(aspect_ln) / _RATIO_LN)
    best = int(misfits.argmin())
    if misfits[best] <= 1.0:
        return []
    u_angle = u_ratio = 0.0
    for moved in grid.move_corners():
        angle, ratio = _compute_shape(moved, focal_px[best : best + 1], centre)
        u_angle = math.hypot(u_angle, angle[0] - angles[best])
        u_ratio = math.hypot(u_ratio, math.log(ratio[0] / ratios[best]))
    is_skew = abs(angles[best] - 90.0) > _ANGLE_DEG + _ERRORS * u_angle
    if not is_skew and abs(aspect_ln[best]) <= _RATIO_LN + _ERRORS * u_ratio:
        return []
    sides = f", sides of {ratios[best]:.3g} to 1 in place of {grid.aspect:.3g} to 1" if grid.aspect else ""
    detail = f"The most likely shape has corners of {angles[best]:.0f}° in place of 90°{sides}."
    return [codes.CORNERS_IMPLAUSIBLE.at("grid", detail)]


def _compute_shape(corners: Corners, focal_px: Array, centre: tuple[float, float]) -> tuple[Array, Array]:
    """Return the angle [deg] and the ratio of the sides for each focal length."""
    h = find_homography([(x - centre[0], y - centre[1]) for x, y in corners])
    first, second = h[:, 0], h[:, 1]

    def multiply(one: Array, other: Array) -> Array:
        product: Array = float(one[:2] @ other[:2]) / focal_px**2 + float(one[2] * other[2])
        return product

    sizes = multiply(first, first), multiply(second, second)
    cosine = multiply(first, second) / np.sqrt(sizes[0] * sizes[1])
    return np.degrees(np.arccos(cosine)), np.sqrt(sizes[0] / sizes[1])


def _is_mirrored(corners: Corners) -> bool:
    """Return True for corners that run counterclockwise on the screen."""
    x, y = np.array(corners).T
    return bool(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0.0)


def _measure_narrowest(points: Array) -> float:
    """Compute the width of the narrowest cell: its area over its longest side [px]."""
    across, along = np.diff(points, axis=0), np.diff(points, axis=1)
    longest = np.maximum(
        np.maximum(*(np.linalg.norm(side, axis=-1) for side in (along[:-1], along[1:]))),
        np.maximum(*(np.linalg.norm(side, axis=-1) for side in (across[:, :-1], across[:, 1:]))),
    )
    diagonals = points[1:, 1:] - points[:-1, :-1], points[1:, :-1] - points[:-1, 1:]
    area = 0.5 * np.abs(
        diagonals[0][..., 0] * diagonals[1][..., 1] - diagonals[0][..., 1] * diagonals[1][..., 0]
    )
    return float((area / longest).min())


def displace_cells(grid: Grid, values: Array) -> Array:
    """Compute the effect of one standard uncertainty of each marked coordinate on the cells' values.

    A corner that moves takes the middle of each cell to another place of the surface, by the homography; the
    value there differs by the gradient of the cells' values.
    """
    if grid.corner_u_px is None:
        return np.zeros((0, *values.shape))
    size = np.array([grid.columns, grid.rows])
    middles = np.stack(np.meshgrid(*((np.arange(count) + 0.5) / count for count in size)), axis=-1)
    back: Array = np.linalg.inv(find_homography(grid.corners)).astype(np.float64)
    along, down = (
        np.gradient(values, axis=axis) if values.shape[axis] > 1 else 0.0 * values for axis in (1, 0)
    )
    effects = []
    for moved in grid.move_corners():
        shift = size * (map_plane(back @ find_homography(moved), middles) - middles)
        effects.append(along * shift[..., 0] + down * shift[..., 1])
    return np.array(effects)


def judge_uniformity(
    cells: Cells, *, shown: tuple[tuple[Quantity, ...], ...] = (), reflectance: Quantity | None = None
) -> Surface:
    """Compute average, extremes and their ratios, each with its uncertainty.

    With g the gradient of a value in the cells' luminances L_i, n_i a cell's noise and e_ki the effect of
    shared source k on it [2]::

        u^2 = sum_i (g_i n_i)^2 + sum_k (sum_i g_i e_ki)^2
            + sum_l max((sum_i g_i e_li)^2, sum_i (g_i e_li)^2)

    A source that scales all luminances (K, t, f, ISO) has e_ki ~ L_i and cancels in a ratio: sum_i g_i L_i =
    0. The dark signal, which is subtracted, does not. Of a local source l it is not known whether all cells
    have its error: flicker, as lamps hang on three phases and a rolling shutter exposes row by row. The
    larger counts, so that it neither averages nor cancels. Extremes are those without noise, which has a
    gradient of its own (see `_find_extreme`).

    [1] EN 13201-3:2015 (U_o, U_l)
    [2] JCGM 100:2008, 5.1.2, and 5.2.2 for what is shared, doi:10.59161/JCGM100-2008E
    """
    values = cells.values_cd_m2
    average = float(values.mean()), np.full((2, *values.shape), 1.0 / values.size)
    noisier = _add_noise(cells)
    low, high = (_find_extreme(cells, noisier, sign=sign) for sign in (-1.0, 1.0))
    l_av = _propagate(cells, *average, "cd/m2")
    return Surface(
        cell_model="projective",
        cells=shown,
        l_av_cd_m2=l_av,
        l_min_cd_m2=_propagate(cells, *low, "cd/m2"),
        l_max_cd_m2=_propagate(cells, *high, "cd/m2"),
        u_o=_ratio(cells, low, average),
        u_l=tuple(
            _ratio(cells, *(_find_extreme(cells, noisier, sign=sign, row=row) for sign in (-1.0, 1.0)))
            for row in range(values.shape[0])
        ),
        average_to_min=_ratio(cells, average, low),
        max_to_min=_ratio(cells, high, low),
        illuminance_lx=illuminate(l_av, reflectance),
    )


def _add_noise(cells: Cells) -> Array:
    """Draw the cells with more noise (scales, draws, rows, columns), for each of `_SCALES`."""
    draws = _DRAWS // 2 if cells.noise_cd_m2.any() else 1
    half = np.random.default_rng(_SEED).standard_normal((draws, *cells.values_cd_m2.shape))
    errors = cells.noise_cd_m2 * np.concatenate([half, -half])
    return np.stack([cells.values_cd_m2 + math.sqrt(scale**2 - 1.0) * errors for scale in _SCALES])


def _find_extreme(
    cells: Cells, noisier: Array, *, sign: float, row: int | None = None
) -> tuple[float, Array]:
    """Return the smallest (sign -1) or largest cell of the surface or a row without noise, and its gradients.

    The smallest of noisy cells is too small on average: of 60 equal ones by 2.3 standard deviations. With
    m(s) its expectation at s times the noise, from draws that add noise to the measured cells [1]::

        m(0) = m(1.2) + (m(1.2) - m(1.5)) 1.2^p / (1.5^p - 1.2^p),   p = 1.2

    p is 1 for equal cells and grows as fewer cells compete. With the probability P that the smallest lies
    apart it stays as it is. The second gradient is that in the noise: how often each cell is the smallest,
    and P (1 - P) of the difference squared. The first, for what is shared, is that of the smallest measured.

    [1] J. Cook, L. Stefanski, J. Am. Stat. Assoc. 89, 1314 (1994): simulation and extrapolation,
    doi:10.1080/01621459.1994.10476871
    """
    near, far = (scale**_POWER for scale in _SCALES)
    lines = slice(None) if row is None else slice(row, row + 1)
    seen, noise = (sign * cells.values_cd_m2[lines]).ravel(), cells.noise_cd_m2[lines].ravel()
    each = sign * noisier[:, :, lines].reshape(len(_SCALES), -1, seen.size)
    best = each.max(axis=2)
    value, chances = (
        less + near / (far - near) * (less - more)
        for less, more in (best.mean(axis=1), (each == best[..., None]).mean(axis=1))
    )
    at, apart = int(seen.argmax()), _judge_apart(seen, noise)
    value = max(float(value), float(seen.mean()))
    left = float(seen[at]) - value
    value += apart * left
    weights = np.stack([np.zeros(seen.size), (1.0 - apart) * chances])
    weights[0, at] = value / seen[at] if seen[at] else 1.0
    doubt = math.sqrt(apart * (1.0 - apart)) * left / (noise[at] or 1.0)
    weights[1, at] = math.hypot(weights[1, at] + apart, doubt)
    gradients = np.zeros((2, *cells.values_cd_m2.shape))
    gradients[:, lines] = weights.reshape(2, -1, gradients.shape[2])
    return sign * value, gradients


def _judge_apart(values: Array, noise: Array) -> float:
    """Return the probability that the largest of n values lies apart, and the next does not.

    Any of n may: the odds are exp(z^2 / 2) / n, z standard deviations above the mean of those below it.
    """
    if values.size < _FEWEST:
        return 0.0
    ordered, chances = np.sort(values), []
    for last in (-1, -2):
        below = ordered[:last]
        variance = max(float(below.var(ddof=1)), float(np.mean(noise**2))) or 1.0
        odds = math.exp(-0.5 * float(ordered[last] - below.mean()) ** 2 / variance)
        chances.append(1.0 / (1.0 + values.size * odds))
    return chances[0] * (1.0 - chances[1])


def _ratio(cells: Cells, above: tuple[float, Array], below: tuple[float, Array]) -> Quantity | None:
    """Compute a quotient: its gradients are (g_above - quotient g_below) / below."""
    if below[0] <= 0.0:
        return None
    quotient = above[0] / below[0]
    return _propagate(cells, quotient, (above[1] - quotient * below[1]) / below[0], "1")


def _propagate(cells: Cells, value: float, gradients: Array, unit: str) -> Quantity:
    gradient, of_noise = gradients
    noise = float(np.sum((of_noise * cells.noise_cd_m2) ** 2))
    shared = np.einsum("rc,krc->k", gradient, cells.shared_cd_m2)
    alike = np.einsum("rc,krc->k", gradient, cells.local_cd_m2) ** 2
    apart = np.sum((gradient * cells.local_cd_m2) ** 2, axis=(1, 2))
    local = float(np.maximum(alike, apart).sum())
    u = math.sqrt(noise + float(shared @ shared) + local)
    return Quantity(value, u, unit)


class CalibratedCamera(Record, kw_only=False):
    """Exposure, coefficient, lens and corrections with which every region of a frame is measured."""

    exposure: Exposure
    coefficient: results.Coefficient
    lens: Lens | None
    corrections: tuple[FieldCorrection, ...]

    frames: pixels.Scatter | None = None  # of those whose mean it converts, beyond flicker

    def convert_signal(self, signal: Signal, share: LensShare | None) -> AppliedLuminance:
        applied = apply_to_signal(signal, exposure=self.exposure, coefficient=self.coefficient, share=share)
        applied = apply_corrections(applied, self.corrections)
        return applied if self.frames is None else _add_scatter(applied, self.frames.rel, shared=True)

    def average(self, frames: Sequence[Signal]) -> "CalibratedCamera":
        """Return the camera for the mean of repeated frames, by what the signals of one region scatter.

        Expected are flicker, the scatter that the fit of K found, and what hardly any shutter and lamp fall
        short of, with the degrees of freedom of their sum by Welch and Satterthwaite; what is found is shared
        out to them as it was expected.
        """
        if len(frames) == 1:
            return self
        coefficient, root = self.coefficient, math.sqrt(len(frames))
        own = math.hypot(coefficient.frame_scatter_rel or 0.0, LEAST_SCATTER_REL)
        flicker = math.hypot(*(each.u_rel for each in self.corrections if each.source == FLICKER)) * root
        expected_rel = math.hypot(own, flicker)
        found = pixels.evaluate_scatter(
            frames,
            dark_signal_dn=coefficient.dark_signal_dn,
            expected_rel=expected_rel,
            expected_dof=expected_rel**4 / (own**4 / EXPECTED_DOF + flicker**4 / _FLICKER_DOF),
        )
        factor = found.rel / expected_rel
        return replace(
            self,
            coefficient=replace(coefficient, frame_scatter_rel=None),
            corrections=tuple(
                replace(each, u_rel=factor * each.u_rel) if each.source == FLICKER else each
                for each in self.corrections
            ),
            frames=replace(found, rel=factor * own / root),
        )

    def find_dof(self, applied: AppliedLuminance) -> float:
        """Return the degrees of freedom of a luminance's variance, by those of K and of frames' scatter [1].

        [1] JCGM 100:2008, G.4.1 (Welch and Satterthwaite), doi:10.59161/JCGM100-2008E
        """
        settings = self.exposure.on_basis(self.coefficient.exposure_basis)
        k = find_k(self.coefficient, settings)
        total = math.fsum(each.effect_cd_m2**2 for each in applied.effects)
        of_k = (applied.luminance_cd_m2.value * k.luminance_k_standard_uncertainty / k.luminance_k) ** 2
        doubt = min(of_k, total) ** 2 / (k.effective_dof or math.inf)
        if self.frames is not None:
            of_frames = math.hypot(*(add_up(applied.effects, source=each) for each in _OF_REPEATS))
            doubt += of_frames**4 / self.frames.dof
        elif self.coefficient.frame_scatter_dof:
            doubt += add_up(applied.effects, source=SCATTER) ** 4 / self.coefficient.frame_scatter_dof
        return total**2 / doubt if doubt else math.inf

    def read_signal(self, frame: Frame, polygon: roi.Polygon, *, of_grid: bool = False) -> Read:
        """Return the signal of a region, and V if vignetting is corrected."""
        statistics = method.extract(frame, polygon)
        if of_grid:
            _require_green(statistics, frame)
        signal = measure_signal(statistics, channel=self.coefficient.channel)
        if self.lens is None:
            return signal, None
        return maps.correct_signal(
            frame,
            polygon,
            signal,
            self.lens,
            channel=self.coefficient.channel,
            dark_signal_dn=self.coefficient.dark_signal_dn,
        )

    def apply_to_region(self, read: Sequence[Read], *, drift_rel: Array | None = None) -> AppliedLuminance:
        """Apply the coefficient to the mean of a region's signals.

        ``drift_rel`` is that of the whole grid; what a cell scatters beyond it is the cell's own.
        """
        signals = [signal for signal, _ in read]
        if len(read) == 1:
            return self.convert_signal(*read[0])
        # V depends on the place alone
        applied = self.convert_signal(pixels.average_signals(signals), read[0][1])
        if drift_rel is None:
            return applied
        dark_dn = self.coefficient.dark_signal_dn
        own = pixels.evaluate_scatter(signals, dark_signal_dn=dark_dn, expected_rel=0.0, drift_rel=drift_rel)
        return _add_scatter(applied, own.rel / math.sqrt(len(read)), shared=False)


def _add_scatter(applied: AppliedLuminance, rel: float, *, shared: bool) -> AppliedLuminance:
    """Add what repeated frames scatter to a luminance's effects."""
    luminance = applied.luminance_cd_m2
    effect = Effect(source=pixels.SCATTER, shared=shared, effect_cd_m2=rel * luminance.value)
    u = math.hypot(luminance.standard_uncertainty, effect.effect_cd_m2)
    return replace(
        applied,
        luminance_cd_m2=replace(luminance, standard_uncertainty=u),
        effects=(*applied.effects, effect),
    )


def _require_green(statistics: tuple[ChannelStatistics, ...], frame: Frame) -> None:
    """Refuse a cell without green pixels, which would be measured with another colour than was calibrated."""
    if "G" in frame.cfa and not any(row.channel in _GREENS for row in statistics):
        raise codes.GRID_INVALID.reject(
            "A cell of the grid holds no green pixel: take fewer rows or columns, or fly lower."
        )


def add_up(effects: Sequence[Effect], *, shared: bool | None = None, source: str | None = None) -> float:
    return math.hypot(
        *(e.effect_cd_m2 for e in effects if shared in {None, e.shared} and source in {None, e.source})
    )


def measure_surface(
    frames: Sequence[Sequence[Sequence[Read]]],
    camera: CalibratedCamera,
    grid: Grid,
    *,
    reflectance: Quantity | None,
) -> tuple[Surface, tuple[Raised, ...]]:
    """Apply the calibration to every cell as it was read in each frame, and judge them together."""
    cells = [list(zip(*lines, strict=True)) for lines in zip(*frames, strict=True)]
    drift_rel = None
    if len(frames) > 1:
        totals = pixels.add_cells([[signal for signal, _ in cell] for line in cells for cell in line])
        light = np.array([total.value_dn for total in totals]) - camera.coefficient.dark_signal_dn
        drift_rel = light / light.mean() - 1.0 if light.mean() > 0.0 else np.zeros(light.size)
        camera = camera.average(totals)
    applied = [[camera.apply_to_region(cell, drift_rel=drift_rel) for cell in line] for line in cells]
    values = np.array([[one.luminance_cd_m2.value for one in line] for line in applied])
    displaced = displace_cells(grid, values)
    shown = tuple(
        tuple(
            replace(each, standard_uncertainty=math.hypot(each.standard_uncertainty, by))
            for each, by in zip((one.luminance_cd_m2 for one in line), more, strict=True)
        )
        for line, more in zip(applied, np.linalg.norm(displaced, axis=0), strict=True)
    )
    surface = judge_uniformity(_gather(applied, values, displaced), shown=shown, reflectance=reflectance)
    return surface, _summarise_cells(applied)


def _summarise_cells(applied: Sequence[Sequence[AppliedLuminance]]) -> tuple[Raised, ...]:
    """Count the cells to which a flag applies, and name the first."""
    found = [
        (raised.flag, f"row {row}, column {col}")
        for row, line in enumerate(applied, 1)
        for col, one in enumerate(line, 1)
        for raised in one.flags
    ]
    return tuple(
        finding.at("grid", f"{what}: {len(cells)} of the cells, the first in {cells[0]}.")
        for finding, what in _OF_CELLS.items()
        if (cells := [place for flag, place in found if flag == finding.code])
    )


def _gather(applied: Sequence[Sequence[AppliedLuminance]], values: Array, displaced: Array) -> Cells:
    """Separate the cells' effects into those that they share and each one's own."""
    noise = np.array([[add_up(one.effects, shared=False) for one in line] for line in applied])
    shared, local = (
        np.moveaxis(np.array([[_list_shared(one, is_local=each) for one in line] for line in applied]), -1, 0)
        for each in (False, True)
    )
    return Cells(
        values_cd_m2=values,
        noise_cd_m2=noise,
        shared_cd_m2=np.concatenate([shared, displaced]),
        local_cd_m2=local,
    )


def _list_shared(applied: AppliedLuminance, *, is_local: bool) -> list[float]:
    return [
        each.effect_cd_m2 for each in applied.effects if each.shared and (each.source in _LOCAL) is is_local
    ]


def illuminate(luminance: Quantity, reflectance: Quantity | None) -> Quantity | None:
    """Compute E = pi L / rho [lx]."""
    if reflectance is None:
        return None
    factor = math.pi / reflectance.value
    value, u_rel = luminance.value * factor, reflectance.standard_uncertainty / reflectance.value
    return Quantity(value, math.hypot(luminance.standard_uncertainty * factor, value * u_rel), "lx")
