"""Change of a measured luminance with another calibration."""

import math
from collections.abc import Sequence

from radiometry.fitting import models
from radiometry.fitting.comparison import PERCENT, MeasuredChange
from radiometry.fitting.evidence import Quantity
from radiometry.frame.exposure import Exposure
from radiometry.luminance.application import find_aperture
from radiometry.luminance.coefficient import Aperture, Coefficient


def change_luminance(
    old: Sequence[Coefficient],
    new: Sequence[Coefficient],
    *,
    exposure: Exposure,
    signal_dn: float | None,
    lens_share: float = 1.0,
    common_u_rel: float = 0.0,
) -> MeasuredChange:
    """Compute how a luminance measured with `old` would change if it were measured with `new`.

    Parameters
    ----------
    old, new : sequence of Coefficient
        Coefficients of both versions, one per ISO value.
    exposure : Exposure
        Exposure of the measured frame.
    signal_dn : float or None
        Measured signal N, black included [DN]; None if it was not stored.
    lens_share : float, default: 1.0
        Relative illumination V by which N - D was divided. Versions that differ in
        vignetting cannot be compared.
    common_u_rel : float, default: 0.0
        Relative standard uncertainty of the meter's calibration if both versions
        depend on the same one.

    Returns
    -------
    MeasuredChange
        The change in %, or the reason why there is none.

    Notes
    -----
    With X from the model at N - D [1]_::

        L = X f^2 / (t S)        change = L_new / L_old - 1

    The error of N is the same in both versions and cancels for signals above dark.

    References
    ----------
    .. [1] JCGM 100:2008, 5.2.2, doi:10.59161/JCGM100-2008E
    """
    before, after = _at_iso(old, exposure.iso), _at_iso(new, exposure.iso)
    if before is None or after is None:
        lacking = "The version used" if before is None else "The version that would take its place"
        return MeasuredChange.untold(f"{lacking} holds no coefficient for ISO {exposure.iso:g}.")
    for was, becomes, why in (
        (
            before.channel,
            after.channel,
            f"One version takes the {before.channel} signal, the other {after.channel}.",
        ),
        (
            before.vignetting,
            after.vignetting,
            "The versions are corrected with different vignetting, or one of them with none.",
        ),
        (
            before.conditions,
            after.conditions,
            "The versions state different lamps, responses or distances: measure again to correct for them.",
        ),
    ):
        if was != becomes:
            return MeasuredChange.untold(why)
    if signal_dn is None:
        if {before.model, after.model} != {"proportional"}:
            return MeasuredChange.untold(
                "The measured signal was not kept; K alone tells the change for proportional models."
            )
        ratio = _k(before, exposure).luminance_k / _k(after, exposure).luminance_k
    else:
        ratio = _ratio(before, after, exposure, signal_dn, lens_share)
    if not math.isfinite(ratio):
        return MeasuredChange.untold("The signal is so near the dark signal that a ratio says nothing.")
    squares = [_k_u_rel(_k(each, exposure)) ** 2 for each in (before, after)]
    u_rel = math.sqrt(max(0.0, math.fsum(squares) - 2.0 * common_u_rel**2))
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
    dark_dn = coefficient.at(settings.exposure_time_s).dark_signal_dn
    adjusted_dn = (signal_dn - dark_dn) / lens_share
    aperture = find_aperture(coefficient, settings)
    rhs = models.invert(coefficient.model, coefficient.parameters, adjusted_dn)
    rhs /= aperture.x_factor if aperture else 1.0
    return rhs * settings.f_number**2 / (settings.exposure_time_s * settings.iso)


def _k(coefficient: Coefficient, exposure: Exposure) -> Coefficient | Aperture:
    """Return what has the K of the frame: its f-number if that was calibrated, else the ISO value."""
    return find_aperture(coefficient, exposure.on_basis(coefficient.exposure_basis)) or coefficient


def _k_u_rel(held: Coefficient | Aperture) -> float:
    return held.luminance_k_standard_uncertainty / abs(held.luminance_k)


def _at_iso(coefficients: Sequence[Coefficient], iso: float) -> Coefficient | None:
    return next((coefficient for coefficient in coefficients if coefficient.iso == iso), None)
