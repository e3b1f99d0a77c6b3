"""Two calibrations of one camera against each other, and what the second would make of a measurement."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from radiometry.fitting import models
from radiometry.fitting.evidence import Quantity
from radiometry.frame.exposure import Exposure
from radiometry.luminance.results import Coefficient

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


def change_luminance(
    old: Sequence[Coefficient],
    new: Sequence[Coefficient],
    *,
    exposure: Exposure,
    signal_dn: float | None,
    lens_share: float = 1.0,
    common_u_rel: float = 0.0,
) -> MeasuredChange:
    """Give the change of a luminance that was measured with ``old`` if it had been measured with ``new``.

        L = X f^2 / (t S), X from the model at N - D       change = L_new / L_old - 1

    Takes
      signal_dn : N, black included [DN], as it was measured; None where it was not kept
      lens_share : V, by which N - D was divided; versions that differ in vignetting cannot be compared
      common_u_rel : of the meter's calibration where both versions hang on the same one
    Source: JCGM 100:2008, 5.2.2; the error of N is the same in both and cancels for signals above dark
    """
    before, after = _at_iso(old, exposure.iso), _at_iso(new, exposure.iso)
    if before is None or after is None:
        lacking = "The version used" if before is None else "The version that would take its place"
        return MeasuredChange.untold(f"{lacking} holds no coefficient for ISO {exposure.iso:g}.")
    if before.channel != after.channel:
        return MeasuredChange.untold(
            f"One version takes the {before.channel} signal, the other {after.channel}."
        )
    if before.vignetting != after.vignetting:
        return MeasuredChange.untold(
            "The versions are corrected with different vignetting, or one of them with none."
        )
    if signal_dn is None:
        if {before.model, after.model} != {"proportional"}:
            return MeasuredChange.untold(
                "The measured signal was not kept; K alone tells the change for proportional models."
            )
        ratio = before.luminance_k / after.luminance_k
    else:
        ratio = _ratio(before, after, exposure, signal_dn, lens_share)
    if not math.isfinite(ratio):
        return MeasuredChange.untold("The signal is so near the dark signal that a ratio says nothing.")
    u_rel = math.sqrt(max(0.0, _k_u_rel(before) ** 2 + _k_u_rel(after) ** 2 - 2.0 * common_u_rel**2))
    change = Quantity(
        value=100.0 * (ratio - 1.0), standard_uncertainty=100.0 * abs(ratio) * u_rel, unit=PERCENT
    )
    return MeasuredChange(change=change, basis="k_ratio" if signal_dn is None else "signal", why=None)


def _ratio(
    before: Coefficient, after: Coefficient, exposure: Exposure, signal_dn: float, lens_share: float
) -> float:
    was, becomes = (_luminance(each, exposure, signal_dn, lens_share) for each in (before, after))
    return becomes / was if was > 0.0 else math.nan


def _luminance(coefficient: Coefficient, exposure: Exposure, signal_dn: float, lens_share: float) -> float:
    settings = exposure.on_basis(coefficient.exposure_basis)
    adjusted_dn = (signal_dn - coefficient.dark_signal_dn) / lens_share
    rhs = models.invert(coefficient.model, coefficient.parameters, adjusted_dn)
    return rhs * settings.f_number**2 / (settings.exposure_time_s * settings.iso)


def _k_u_rel(coefficient: Coefficient) -> float:
    return coefficient.luminance_k_standard_uncertainty / abs(coefficient.luminance_k)


def _at_iso(coefficients: Sequence[Coefficient], iso: float) -> Coefficient | None:
    return next((coefficient for coefficient in coefficients if coefficient.iso == iso), None)
