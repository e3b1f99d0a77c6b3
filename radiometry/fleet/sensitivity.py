"""Effect of a difference of a coefficient on the result: per cent of light, or pixels."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from radiometry.fleet.determinations import Key
from radiometry.fleet.results import Tolerance
from radiometry.methods import get_method

__all__ = ["PERCENT", "find_sensitivity", "main_unit"]

Kind = Literal["relative", "absolute"]

PERCENT = "%"

# Measures of a fit's quality, which are listed with the coefficients and applied to no image
NOT_SHARED = frozenset({"rms_px"})

# A fraction of a mean is meaningful if the mean is more than this many of its standard errors from 0
CLEAR_OF_ZERO = 3.0


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """Sensitivity coefficient of a parameter: cost = factor * difference."""

    kind: Kind  # relative: tolerances are fractions (0.04), costs in %; absolute: both in `unit`
    unit: str  # Of the cost
    of: str  # The affected quantity, for sentences
    factor: float

    def accept(self, tolerance: float) -> Tolerance:
        """Return a tolerance in the unit of the cost."""
        limit = 100.0 * tolerance if self.kind == "relative" else tolerance
        return Tolerance(limit=limit, unit=self.unit, kind=self.kind, of=self.of)


def main_unit(method: str) -> str:
    """Return the unit of a tolerance that applies to all coefficients of a method.

    Parameters
    ----------
    method : str
        Name of the method.
    """
    return get_method(method).tolerance_unit


def find_sensitivity(method: str, key: Key, means: Mapping[str, float], *, mean: float) -> Sensitivity:
    """Find the effect of a difference of a parameter on the result.

    Parameters
    ----------
    method : str
        Name of the method.
    key : Key
        The parameter.
    means : mapping of str to float
        The fleet's mean of each parameter by name.
    mean : float
        The mean of this one.

    Notes
    -----
    To first order in the difference, from the models' own equations:

    - luminance_k, reflectance_k: L and R are inverse to K; for a camera whose K is d above the shared one,
      L_shared / L - 1 = d / K, in %.
    - corner_falloff, k1..k3 of vignetting: the change of V in the corner, where r = 1, in % of the signal.
    - k1..k3, p1, p2 of geometry: displacement of the image point in the frame's corner, in px,
      k_m: f r^(2m+1);  p1: f |(2xy, r^2 + 2y^2)|;  p2: f |(r^2 + 2x^2, 2xy)|,  x = cx / fx, y = cy / fy.
    - names that end in _px or _dn: the difference itself.
    - all others: the difference in % of their mean.

    Each is taken alone. k1..k3 of one fit compensate each other, so that their costs are upper limits; for
    vignetting, corner_falloff is decisive.
    """
    kinds = {each.name: each for each in get_method(method).coefficients}
    effect = kinds[key.name].effect if key.name in kinds else None
    if effect is not None and effect.factor is not None:
        # a fraction that is stated in % is not multiplied again
        factor = 1.0 if key.unit == effect.unit else effect.factor(means)
        relative = effect.unit == PERCENT
        return Sensitivity(
            kind="relative" if relative else "absolute", unit=effect.unit, of=effect.of, factor=factor
        )
    for ending, unit in (("_px", "px"), ("_dn", "DN")):
        if key.name.endswith(ending):
            return Sensitivity(kind="absolute", unit=unit, of=f"of {key.name}", factor=1.0)
    factor = 100.0 / abs(mean) if mean else math.nan
    return Sensitivity(
        kind="relative", unit=PERCENT, of=effect.of if effect else f"of {key.name}", factor=factor
    )


def is_clear_of_zero(sensitivity: Sensitivity, mean: float, standard_error: float) -> bool:
    """Return True if the factor is meaningful: a fraction of a mean that may be 0 is not."""
    if sensitivity.kind == "absolute":
        return math.isfinite(sensitivity.factor)
    return math.isfinite(sensitivity.factor) and abs(mean) > CLEAR_OF_ZERO * standard_error
