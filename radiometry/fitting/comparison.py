"""Comparison of quantities, also of such as share errors."""

import math
from collections.abc import Collection, Mapping
from typing import Literal

from radiometry.fitting.evidence import Quantity
from radiometry.records import Record, about

PERCENT = "%"


class Comparison(Record):
    """A new value compared with an old one of the same unit."""

    difference: Quantity = about("new - old.")
    change: Quantity | None = about("new / old - 1 [%]; None if the old value is 0.")
    in_standard_uncertainties: float | None = about(
        "abs(difference) / u(difference); None if both values are exact."
    )


class MeasuredChange(Record):
    """Change of a measured luminance or reflectance under another calibration."""

    change: Quantity | None  #: new / old - 1 [%]; None if it cannot be computed
    #: "signal" if both calibrations were applied to the measured signal, dark signals included. "k_ratio" for
    #: K_old / K_new - 1, used where only the coefficients are known; it is right for signals far above dark.
    basis: Literal["signal", "k_ratio"] | None
    why: str | None  #: None if there is a change; otherwise the sentence that states why there is none

    @classmethod
    def untold(cls, why: str) -> "MeasuredChange":
        """Return no change, with the sentence that states why."""
        return cls(change=None, basis=None, why=why)


def compare_quantities(old: Quantity, new: Quantity, *, common_u_rel: float = 0.0) -> Comparison:
    """Compare two values that may share one relative error, as two K by the same meter do.

    From the law of propagation with the covariance m^2 new old [1]::

        u(new - old)^2 = u_new^2 + u_old^2 - 2 new old m^2
        u(new / old)^2 = (new / old)^2 ((u_new / new)^2 + (u_old / old)^2 - 2 m^2)

    m scales both values alike: it cancels in the ratio, and in the difference up to m (new - old).

    [1] JCGM 100:2008, 5.2.2, doi:10.59161/JCGM100-2008E

    Parameters
    ----------
    old, new : Quantity
        Values with standard uncertainties, in the same unit.
    common_u_rel : float, default: 0.0
        Relative standard uncertainty m of the error that both values share; already
        included in both uncertainties.

    Returns
    -------
    Comparison
        Difference and relative change, each with its standard uncertainty.
    """
    covariance = common_u_rel**2 * new.value * old.value
    variance = new.standard_uncertainty**2 + old.standard_uncertainty**2 - 2.0 * covariance
    slope = _divide(new, old)
    squares = new.standard_uncertainty**2 + (slope * old.standard_uncertainty) ** 2
    squares -= 2.0 * slope * covariance
    return _conclude(old, new, math.sqrt(max(0.0, variance)), math.sqrt(max(0.0, squares)))


DARK = "dark signal"
NOISE = "pixel noise"
STRAY = "stray light"
FOCUS = "focus distance"
# Sources that do not scale with a luminance, but are subtracted from it
SUBTRACTED = frozenset({DARK, STRAY})
_OF_VALUE_ALONE = frozenset({*SUBTRACTED, NOISE})


class Budgeted(Record):
    """A measured value with the effect of one standard uncertainty of each source on it."""

    value: float  #: Measured value
    unit: str  #: Unit of the value and of the effects
    effects: Mapping[str, float]  #: Effect by source, with the sign of the value's sensitivity


def sign_effects(value: float, uncertainties: Mapping[str, float]) -> dict[str, float]:
    """Return the signed effects of a budget's uncertainties on a luminance.

    All sources scale the value except dark and stray light, which are subtracted.
    From L = (N - D) f^2 / (K t S): dL/dD < 0 for any L, the others have the sign of L.

    Parameters
    ----------
    value : float
        Measured value.
    uncertainties : mapping of str to float
        Standard uncertainty by source, in the value's unit.

    Returns
    -------
    dict of str to float
        Signed effect by source.
    """
    return {
        source: -u if source in SUBTRACTED else math.copysign(u, value) for source, u in uncertainties.items()
    }


def scale_effects(mean: Budgeted, value: float, standard_uncertainty: float) -> Budgeted:
    """Return the effects of a frame's mean on one cell of the frame.

    Parameters
    ----------
    mean : Budgeted
        Mean of the frame with its effects.
    value, standard_uncertainty : float
        Value of the cell and its standard uncertainty, in the unit of the mean.

    Returns
    -------
    Budgeted
        The effects scaled with the value, those of dark and stray light unchanged. The remaining
        uncertainty of the cell is its own noise.
    """
    factor = value / mean.value if mean.value else 0.0
    effects = {
        source: effect if source in _OF_VALUE_ALONE else effect * factor
        for source, effect in mean.effects.items()
        if source != NOISE
    }
    rest = standard_uncertainty**2 - math.fsum(effect**2 for effect in effects.values())
    return Budgeted(value=value, unit=mean.unit, effects={**effects, NOISE: math.sqrt(max(0.0, rest))})


def compare_measured(old: Budgeted, new: Budgeted, *, common: Collection[str]) -> Comparison:
    """Compare two measured values of which some sources have the same error in both.

    Correlated inputs are treated as independent effects [1]::

        u(new - old)^2 = sum over common (e_new - e_old)^2 + sum over others (e_new^2 + e_old^2)
        u(new / old)^2 = the same of e_new / old - e_old new / old^2

    A common error that scales both values, as that of K, cancels in the ratio, and
    in the difference up to its share of new - old.

    [1] JCGM 100:2008, 5.2.2 and F.1.2.3, doi:10.59161/JCGM100-2008E

    Parameters
    ----------
    old, new : Budgeted
        Values with signed effects, in the same unit.
    common : collection of str
        Sources whose error is the same in both.

    Returns
    -------
    Comparison
        Difference and relative change, each with its standard uncertainty.
    """
    slope = _divide(new, old)
    of_old = {source: slope * effect for source, effect in old.effects.items()}
    return _conclude(
        old, new, _spread(old.effects, new.effects, common), _spread(of_old, new.effects, common)
    )


def _divide(new: Quantity | Budgeted, old: Quantity | Budgeted) -> float:
    return new.value / old.value if old.value else 0.0


def _conclude(old: Quantity | Budgeted, new: Quantity | Budgeted, u: float, u_at_old: float) -> Comparison:
    """Return the comparison; ``u_at_old`` is that of new - old (new / old), as if the ratio were exact."""
    difference = new.value - old.value
    change = None
    if old.value != 0.0:
        change = Quantity(100.0 * difference / old.value, 100.0 * u_at_old / abs(old.value), PERCENT)
    return Comparison(
        difference=Quantity(difference, u, new.unit),
        change=change,
        in_standard_uncertainties=abs(difference) / u if u > 0.0 else None,
    )


def _spread(old: Mapping[str, float], new: Mapping[str, float], common: Collection[str]) -> float:
    total = 0.0
    for source in {*old, *new}:
        before, after = old.get(source, 0.0), new.get(source, 0.0)
        total += (after - before) ** 2 if source in common else after**2 + before**2
    return math.sqrt(total)
