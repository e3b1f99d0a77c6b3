"""Two calibrations of one camera against each other, and what the second would make of a measurement."""

import math
from dataclasses import dataclass
from typing import Literal

from radiometry.fitting.evidence import Quantity

PERCENT = "%"


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A new value against an old one of the same unit.

    ``difference`` : new - old; ``change`` : new / old - 1 in %, None where the old value is 0
    ``in_standard_uncertainties`` : |difference| / u(difference); None where both are exact
    """

    difference: Quantity
    change: Quantity | None
    in_standard_uncertainties: float | None


@dataclass(frozen=True, kw_only=True)
class MeasuredChange:
    """How a measured luminance or reflectance changes with another calibration, new / old - 1 in %.

    ``basis`` : "signal": both calibrations were applied to the measured signal, dark signals included;
        "k_ratio": K_old / K_new - 1, where only the coefficients are known: right for signals far above dark
    ``why`` : None with a change; else the sentence that says why there is none
    """

    change: Quantity | None
    basis: Literal["signal", "k_ratio"] | None
    why: str | None

    @classmethod
    def untold(cls, why: str) -> "MeasuredChange":
        """Give no figure, and the sentence that says why."""
        return cls(change=None, basis=None, why=why)


def compare_quantities(old: Quantity, new: Quantity, *, common_u_rel: float = 0.0) -> Comparison:
    """Compare two values that may share one relative error, as two K by the same meter do.

        u(new - old)^2 = u_new^2 + u_old^2 - 2 new old m^2
        u(new / old)^2 = (new / old)^2 ((u_new / new)^2 + (u_old / old)^2 - 2 m^2)

    m scales both values alike: it cancels in the ratio, and in the difference up to m (new - old).

    Takes
      common_u_rel : m, the standard uncertainty of the shared error, part of both given uncertainties
    Source: JCGM 100:2008, 5.2.2, with the covariance m^2 new old
    """
    covariance = common_u_rel**2 * new.value * old.value
    variance = new.standard_uncertainty**2 + old.standard_uncertainty**2 - 2.0 * covariance
    u = math.sqrt(max(0.0, variance))
    difference = new.value - old.value
    change = None
    if old.value != 0.0:
        slope = new.value / old.value
        squares = new.standard_uncertainty**2 + (slope * old.standard_uncertainty) ** 2
        squares -= 2.0 * slope * covariance
        change = Quantity(
            value=100.0 * difference / old.value,
            standard_uncertainty=100.0 * math.sqrt(max(0.0, squares)) / abs(old.value),
            unit=PERCENT,
        )
    return Comparison(
        difference=Quantity(value=difference, standard_uncertainty=u, unit=new.unit),
        change=change,
        in_standard_uncertainties=abs(difference) / u if u > 0.0 else None,
    )
