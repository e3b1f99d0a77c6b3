"""Comparison of two measurements: errors that they share cancel, each one's own do not."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from radiometry.fitting.comparison import PERCENT, Comparison
from radiometry.fitting.evidence import Quantity

DARK = "dark signal"
NOISE = "pixel noise"
STRAY = "stray light"
FOCUS = "focus distance"
SUBTRACTED = frozenset({DARK, STRAY})
"""Sources that do not scale with a luminance, but are subtracted from it."""
_OF_VALUE_ALONE = frozenset({*SUBTRACTED, NOISE})


@dataclass(frozen=True, kw_only=True)
class Budgeted:
    """A measured value with the effect of one standard uncertainty of each source on it.

    Attributes
    ----------
    value : float
        Measured value.
    unit : str
        Unit of the value and of the effects.
    effects : mapping of str to float
        Effect by source, with the sign of the value's sensitivity.
    """

    value: float
    unit: str
    effects: Mapping[str, float]


def sign_effects(value: float, uncertainties: Mapping[str, float]) -> dict[str, float]:
    """Return the signed effects of a budget's uncertainties on a luminance.

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

    Notes
    -----
    All sources scale the value except dark and stray light, which are subtracted.
    From L = (N - D) f^2 / (K t S): dL/dD < 0 for any L, the others have the sign of L.
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

    Notes
    -----
    Correlated inputs are treated as independent effects [1]_::

        u(new - old)^2 = sum over common (e_new - e_old)^2 + sum over others (e_new^2 + e_old^2)
        u(new / old)^2 = the same of e_new / old - e_old new / old^2

    A common error that scales both values, as that of K, cancels in the ratio, and
    in the difference up to its share of new - old.

    References
    ----------
    .. [1] JCGM 100:2008, 5.2.2 and F.1.2.3, doi:10.59161/JCGM100-2008E
    """
    difference = new.value - old.value
    u = _spread(old.effects, new.effects, common)
    change = None
    if old.value != 0.0:
        slope = new.value / old.value
        of_old = {source: slope * effect for source, effect in old.effects.items()}
        change = Quantity(
            value=100.0 * difference / old.value,
            standard_uncertainty=100.0 * _spread(of_old, new.effects, common) / abs(old.value),
            unit=PERCENT,
        )
    return Comparison(
        difference=Quantity(value=difference, standard_uncertainty=u, unit=new.unit),
        change=change,
        in_standard_uncertainties=abs(difference) / u if u > 0.0 else None,
    )


def _spread(old: Mapping[str, float], new: Mapping[str, float], common: Collection[str]) -> float:
    total = 0.0
    for source in {*old, *new}:
        before, after = old.get(source, 0.0), new.get(source, 0.0)
        total += (after - before) ** 2 if source in common else after**2 + before**2
    return math.sqrt(total)
