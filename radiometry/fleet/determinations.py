"""Determinations of coefficients by versions, their repeats, and the effects of cameras and lenses."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.records import Record, about

_HOLDS_FOR = "What the parameter holds for; None where it holds for all."


@dataclass(frozen=True, order=True, kw_only=True)
class Key:
    """Identity of a parameter: values with equal keys may be compared."""

    name: str
    unit: str
    model: str
    iso: float | None = about(_HOLDS_FOR, default=None)
    f_number: float | None = about(_HOLDS_FOR, default=None)
    band: str | None = about(_HOLDS_FOR, default=None)
    channel: str | None = about(_HOLDS_FOR, default=None)

    def __str__(self) -> str:
        """Return the name as used in a sentence: luminance_k at ISO 3200."""
        said = [
            f"ISO {self.iso:g}" if self.iso is not None else "",
            f"f/{self.f_number:g}" if self.f_number is not None else "",
            f"band {self.band}" if self.band is not None else "",
            f"channel {self.channel}" if self.channel is not None else "",
        ]
        where = ", ".join(part for part in said if part)
        return f"{self.name} at {where}" if where else self.name


_SERIALS = "Serial numbers of body and lens; None where the lens is unknown."


class Source(Record):
    """One calibration version, with its camera and campaign."""

    version: str = about("Its id.")
    camera: str = about(_SERIALS)
    lens: str | None = about(_SERIALS)
    campaign: str = about(
        "Versions of one campaign share their frames and readings, and with them their errors."
    )
    at: datetime = about("When it was determined, with its time zone.")


class Determination(Record):
    """One value of one parameter, with its standard uncertainty [the key's unit]."""

    key: Key
    value: float
    standard_uncertainty: float
    source: Source


class LeftOut(Record):
    """A version that is not used, with the reason as a sentence."""

    version: str
    why: str


def keep_repeats(sources: Sequence[Source]) -> tuple[tuple[Source, ...], tuple[LeftOut, ...]]:
    """Return the last version of each campaign: only another campaign repeats a determination.

    Two versions of one campaign are two evaluations of the same frames and readings. Their agreement is no
    evidence of repeatability; counted as two they would make it too small.

    Parameters
    ----------
    sources : sequence of Source
        In any order; the last of a campaign is the last given.

    Returns
    -------
    kept : tuple of Source
        By camera and time.
    left_out : tuple of LeftOut
        The others, with the reason.
    """
    last = {(source.camera, source.campaign): source for source in sources}
    kept = sorted(last.values(), key=lambda source: (source.camera, source.at, source.version))
    left_out = tuple(
        LeftOut(
            version=source.version,
            why=f"Version {last[source.camera, source.campaign].version} is of the same campaign and newer: "
            "evaluated twice is not repeated.",
        )
        for source in sources
        if last[source.camera, source.campaign] is not source
    )
    return tuple(kept), left_out


Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Index = NDArray[np.intp]

_ROUNDING = 1e-13


class Factor(Record):
    """Levels of one factor and the variance that they explain beyond the other factor."""

    deviations: Vector  # Of each level from the unweighted mean of all levels [unit of the values]
    contrasts: Matrix  # deviations = contrasts @ parameters
    dof: int  # k - 1
    f_statistic: float | None  # None where there is no scatter to compare with
    f_p_value: float | None
    variance: float  # Variance component [unit squared], not below 0, and its uncertainty
    variance_u: float


class Effects(Record):
    """A solved model."""

    mean: float
    mean_u: float
    factors: tuple[Factor, ...]
    unit_covariance: Matrix  # Of the parameters, per unit of `within_variance`
    within_variance: float
    dof: int
    f_statistic: float | None  # Of all factors together; None where there is no scatter to compare with
    f_p_value: float | None

    def standard_errors(self, contrasts: Matrix) -> Vector:
        squares = np.einsum("ip,pq,iq->i", contrasts, self.unit_covariance, contrasts)
        errors: Vector = np.sqrt(np.clip(squares, 0.0, None) * self.within_variance)
        return errors


def are_separable(factors: Sequence[Index]) -> bool:
    """Return True if the effects of all factors can be separated: the levels of two are linked by swaps."""
    design = np.hstack([np.ones((len(factors[0]), 1)), *(_code(labels)[0] for labels in factors)])
    return bool(np.linalg.matrix_rank(design) == design.shape[1])


def fit_effects(values: Vector, factors: Sequence[Index]) -> Effects:
    """Fit a model of one or two factors, with their variance components; numbers may be unbalanced.

    The model is y = m + a_i (+ b_j) + e with sum a = sum b = 0 and var(e) = within variance. With SS, the sum
    of squares that a factor explains beyond the other, F = (SS / (k - 1)) / MS_e, and its variance component
    is [1]::

        s_a^2 = (SS - (k - 1) MS_e) / tr(Z' M Z),   M = 1 - X (X'X)^-1 X' of the model without it

    which for one factor is (MS_a - MS_e) / n0 of the analysis of variance, n0 = (N - sum n_i^2 / N) / (k -
    1).

    [1] S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, Wiley 1992, chapters 3 and 5,
        doi:10.1002/9780470316856
    """
    codes = [_code(labels) for labels in factors]
    ones = np.ones((values.size, 1))
    design = np.hstack([ones, *(columns for columns, _ in codes)])
    offset = float(values.mean())
    centred = values - offset
    unit_covariance = np.linalg.inv(design.T @ design)
    parameters = unit_covariance @ (design.T @ centred)
    residual = centred - design @ parameters
    # what is left of equal numbers is rounding, not scatter
    residual[np.abs(residual) <= _ROUNDING * np.max(np.abs(values))] = 0.0
    rss = float(np.sum(residual**2))
    dof = values.size - design.shape[1]
    within = rss / dof if dof > 0 else 0.0
    solved, start = [], 1
    for number, (columns, levels) in enumerate(codes):
        contrasts = np.zeros((len(levels), design.shape[1]))
        contrasts[:, start : start + columns.shape[1]] = levels
        start += columns.shape[1]
        without = np.hstack([ones, *(other for at, (other, _) in enumerate(codes) if at != number)])
        solved.append(
            _explain(
                centred, factors[number], without, contrasts, parameters, rss=rss, within=within, dof=dof
            )
        )
    f_statistic, f_p_value = _test(float(np.sum(centred**2)) - rss, design.shape[1] - 1, within, dof)
    return Effects(
        mean=offset + float(parameters[0]),
        mean_u=float(np.sqrt(within * unit_covariance[0, 0])),
        factors=tuple(solved),
        unit_covariance=unit_covariance,
        within_variance=within,
        dof=dof,
        f_statistic=f_statistic,
        f_p_value=f_p_value,
    )


def _explain(
    values: Vector,
    labels: Index,
    without: Matrix,
    contrasts: Matrix,
    parameters: Vector,
    *,
    rss: float,
    within: float,
    dof: int,
) -> Factor:
    basis, _ = np.linalg.qr(without)
    levels = len(contrasts)
    indicator = (labels[:, None] == np.arange(levels)).astype(np.float64)
    spread = float(np.sum(indicator**2) - np.sum((basis.T @ indicator) ** 2))
    explained = max(0.0, float(np.sum(values**2) - np.sum((basis.T @ values) ** 2)) - rss)
    between = explained / (levels - 1)
    f_statistic, f_p_value = _test(explained, levels - 1, within, dof)
    noise = within**2 / dof if dof > 0 else 0.0
    scale = (levels - 1) / spread
    return Factor(
        deviations=contrasts @ parameters,
        contrasts=contrasts,
        dof=levels - 1,
        f_statistic=f_statistic,
        f_p_value=f_p_value,
        variance=max(0.0, scale * (between - within)),
        variance_u=scale * float(np.sqrt(2.0 * (between**2 / (levels - 1) + noise))),
    )


def _test(explained: float, levels: int, within: float, dof: int) -> tuple[float | None, float | None]:
    """Return F and the probability of a larger one, for a sum of squares with so many degrees of freedom."""
    if within <= 0.0:
        return None, None
    statistic = max(0.0, explained) / levels / within
    return statistic, float(scipy.special.fdtrc(levels, dof, statistic))


def _code(labels: Index) -> tuple[Matrix, Matrix]:
    """Return the effect-coded columns (N, k - 1), and the levels' contrasts in them (k, k - 1)."""
    levels = int(labels.max()) + 1
    contrasts = np.vstack([np.eye(levels - 1), -np.ones((1, levels - 1))])
    return contrasts[labels], contrasts


FactorName = Literal["camera", "body", "lens"]


class Grouping(Record):
    """Factors of an analysis, each with its label per determination and its levels' names."""

    names: tuple[FactorName, ...]
    labels: tuple[Index, ...]
    levels: tuple[tuple[str, ...], ...]
    # One row per camera that existed: positions of its body and lens in the levels of each factor; for the
    # one factor "camera" the position of the level
    units: tuple[tuple[int, ...], ...]
    unit_names: tuple[str, ...]
    confounded: bool  # True if lenses are known and differ, and no swaps link them


def group_cameras(rows: Sequence[Determination]) -> Grouping:
    """Group determinations by camera (a body with a lens), or by body and lens where swaps link all of them.

    A body that was calibrated with two lenses is two cameras: as one, the difference of its lenses would
    appear as a lack of repeatability. Where a body's lens is named once and at other times not, the named one
    is assumed.
    """
    pairs = _pair(rows)
    named = _name(pairs)
    cameras, camera_labels = _index([named[pair] for pair in pairs])
    one = Grouping(
        names=("camera",),
        labels=(camera_labels,),
        levels=(cameras,),
        units=tuple((index,) for index in range(len(cameras))),
        unit_names=cameras,
        confounded=False,
    )
    known = [(body, lens) for body, lens in pairs if lens is not None]
    if (
        len(known) < len(pairs)
        or len({lens for _, lens in known}) < 2
        or len({body for body, _ in known}) < 2
    ):
        return one
    bodies, body_labels = _index([body for body, _ in known])
    lenses, lens_labels = _index([lens for _, lens in known])
    if not are_separable((body_labels, lens_labels)):
        return replace(one, confounded=True)
    existing = sorted({(int(b), int(e)) for b, e in zip(body_labels, lens_labels, strict=True)})
    return Grouping(
        names=("body", "lens"),
        labels=(body_labels, lens_labels),
        levels=(bodies, lenses),
        units=tuple(existing),
        unit_names=tuple(f"{bodies[b]} with lens {lenses[e]}" for b, e in existing),
        confounded=False,
    )


def _pair(rows: Sequence[Determination]) -> list[tuple[str, str | None]]:
    lenses: dict[str, set[str]] = {}
    for row in rows:
        if row.source.lens is not None:
            lenses.setdefault(row.source.camera, set()).add(row.source.lens)

    def lens_of(source: Source) -> str | None:
        seen = lenses.get(source.camera, set())
        return next(iter(seen)) if len(seen) == 1 else source.lens

    return [(row.source.camera, lens_of(row.source)) for row in rows]


def _name(pairs: Sequence[tuple[str, str | None]]) -> dict[tuple[str, str | None], str]:
    """Return the names of cameras: the body's, with the lens where the body had several."""
    several = Counter(body for body, _ in set(pairs))
    return {
        (body, lens): body if several[body] == 1 else f"{body} with lens {lens or 'unknown'}"
        for body, lens in pairs
    }


def _index(names: Sequence[str]) -> tuple[tuple[str, ...], Index]:
    levels, labels = np.unique(np.array(names), return_inverse=True)
    return tuple(map(str, levels)), labels.astype(np.intp)
