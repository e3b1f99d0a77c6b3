"""What a difference in a coefficient does to somebody who uses it: per cent of light, or pixels."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from radiometry.fleet.determinations import Key
from radiometry.methods import get_method

Kind = Literal["relative", "absolute"]

PERCENT = "%"

NOT_SHARED = frozenset({"rms_px"})
"""Figures of a fit's quality: they stand among the coefficients, and nobody applies them to an image."""

CLEAR_OF_ZERO = 3.0
"""A share of a mean says something when the mean is this many of its standard errors away from 0."""


@dataclass(frozen=True, kw_only=True)
class Meaning:
    """How a parameter's difference is felt: cost = factor * difference.

    ``kind`` : relative: tolerances are shares of what is felt (0.04), costs in %; absolute: both in ``unit``
    ``unit`` : of the cost; ``of`` : what it is a cost in, for sentences
    ``factor`` : [unit per unit of the parameter]
    """

    kind: Kind
    unit: str
    of: str
    factor: float

    def limit(self, tolerance: float) -> float:
        """Give a tolerance, as it is entered, in the unit of the cost."""
        return 100.0 * tolerance if self.kind == "relative" else tolerance


def main_unit(method: str) -> str:
    """Return the unit in which one tolerance for all coefficients of a method is meant."""
    return get_method(method).tolerance_unit


def give_meaning(method: str, key: Key, means: Mapping[str, float], *, mean: float) -> Meaning:
    """Say what a difference of a parameter is felt as.

    luminance_k, reflectance_k  L and R are inverse to K: a camera whose K is d above the shared one gives
                                L_shared / L - 1 = d / K, in %
    corner_falloff, k1..k3 of vignetting  what is added to V in the corner, where r = 1, in % of the signal
    k1..k3, p1, p2 of geometry  displacement of the image point in the frame's corner, in px:
        k_m: f r^(2m+1);  p1: f |(2xy, r^2 + 2y^2)|;  p2: f |(r^2 + 2x^2, 2xy)|,  x = cx / fx, y = cy / fy
    names that end in _px or _dn  the difference itself
    all others  their difference in % of their mean

    Each counts alone. k1..k3 of one fit compensate each other, so that their costs are upper limits; of
    vignetting, corner_falloff is what decides.

    Takes
      means : the fleet's mean of each parameter by name; mean : of this one
    Source: the models' own equations, to first order in the difference
    """
    kinds = {each.name: each for each in get_method(method).coefficients}
    effect = kinds[key.name].effect if key.name in kinds else None
    if effect is not None and effect.factor is not None:
        # a fraction that is given in % is not multiplied once more
        factor = 1.0 if key.unit == effect.unit else effect.factor(means)
        relative = effect.unit == PERCENT
        return Meaning(
            kind="relative" if relative else "absolute", unit=effect.unit, of=effect.of, factor=factor
        )
    for ending, unit in (("_px", "px"), ("_dn", "DN")):
        if key.name.endswith(ending):
            return Meaning(kind="absolute", unit=unit, of=f"of {key.name}", factor=1.0)
    factor = 100.0 / abs(mean) if mean else math.nan
    return Meaning(kind="relative", unit=PERCENT, of=effect.of if effect else f"of {key.name}", factor=factor)


def is_clear_of_zero(meaning: Meaning, mean: float, standard_error: float) -> bool:
    """Tell whether the factor means anything: a share of a mean that may be 0 does not."""
    if meaning.kind == "absolute":
        return math.isfinite(meaning.factor)
    return math.isfinite(meaning.factor) and abs(mean) > CLEAR_OF_ZERO * standard_error
