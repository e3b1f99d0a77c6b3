"""Comparison of two calibrations of one camera, and of the measurements that they would give."""

import math
from dataclasses import dataclass
from typing import Literal

from radiometry.fitting.evidence import Quantity

PERCENT = "%"


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A new value compared with an old one of the same unit.

    Attributes
    ----------
    difference : Quantity
        new - old.
    change : Quantity or None
        new / old - 1 [%]; None if the old value is 0.
    in_standard_uncertainties : float or None
        abs(difference) / u(difference); None if both values are exact.
    """

    difference: Quantity
    change: Quantity | None
    in_standard_uncertainties: float | None


@dataclass(frozen=True, kw_only=True)
class MeasuredChange:
    """Change of a measured luminance or reflectance under another calibration.

    Attributes
    ----------
    change : Quantity or None
        new / old - 1 [%]; None if it cannot be computed.
    basis : {"signal", "k_ratio"} or None
        "signal" if both calibrations were applied to the measured signal, dark
        signals included. "k_ratio" for K_old / K_new - 1, used where only the
        coefficients are known; it is right for signals far above dark.
    why : str or None
        None if there is a change; otherwise the sentence that states why there is
        none.
    """

    change: Quantity | None
    basis: Literal["signal", "k_ratio"] | None
    why: str | None

    @classmethod
    def untold(cls, why: str) -> "MeasuredChange":
        """Return no change, with the sentence that states why.

        Parameters
        ----------
        why : str
            Sentence for a person.

        Returns
        -------
        MeasuredChange
            A record whose `change` and `basis` are None.
        """
        return cls(change=None, basis=None, why=why)


def compare_quantities(old: Quantity, new: Quantity, *, common_u_rel: float = 0.0) -> Comparison:
    """Compare two values that may share one relative error, as two K by the same meter do.

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

    Notes
    -----
    From the law of propagation with the covariance m^2 new old [1]_::

        u(new - old)^2 = u_new^2 + u_old^2 - 2 new old m^2
        u(new / old)^2 = (new / old)^2 ((u_new / new)^2 + (u_old / old)^2 - 2 m^2)

    m scales both values alike: it cancels in the ratio, and in the difference up to
    m (new - old).

    References
    ----------
    .. [1] JCGM 100:2008, 5.2.2, doi:10.59161/JCGM100-2008E
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
