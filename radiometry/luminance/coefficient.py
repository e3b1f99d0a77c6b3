"""Luminance calibration of one ISO value: all that measuring with it needs."""

import math
from dataclasses import dataclass, field, replace

from radiometry.luminance.conditions import CalibrationConditions
from radiometry.specification.stored import LATER

Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, kw_only=True)
class ErrorSplit:
    """Errors of a calibration by what causes them: those of a frame's own settings meet the same ones.

    Attributes
    ----------
    fit, f_numbers : tuple of tuple of float
        Covariance of the model's parameters, and for one aperture of ln X as a last
        row, by the errors of all f-numbers and by all other sources but the exposure
        times.
    exposure_times : tuple of tuple of float
        Effect on each of them of one standard uncertainty of each exposure time, in
        the order of `Coefficient.exposure_times_s`.
    """

    fit: Rows
    f_numbers: Rows
    exposure_times: Rows


@dataclass(frozen=True, kw_only=True)
class Aperture:
    """K at one f-number of an ISO value: the true f-number differs from the nominal one, always alike.

    Attributes
    ----------
    f_number : float
        Nominal f-number.
    scenes, frames : int
        Numbers of scenes and of frames at this f-number.
    luminance_k, luminance_k_standard_uncertainty : float
        K at this f-number and its standard uncertainty, in the unit of the ISO
        value's K.
    expanded_uncertainty, coverage_factor : float
        Expanded uncertainty for a coverage probability of 95 %, and its factor k.
    effective_dof : float or None
        Effective degrees of freedom; None if infinite.
    x_factor : float
        Light of a frame at this f-number relative to the nominal one, predicted.
    errors : ErrorSplit
        Errors of the parameters and of ln `x_factor`.
    """

    f_number: float
    scenes: int
    frames: int
    luminance_k: float
    luminance_k_standard_uncertainty: float
    expanded_uncertainty: float
    coverage_factor: float
    effective_dof: float | None
    x_factor: float
    errors: ErrorSplit


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """Luminance calibration of one ISO value: all that `apply` needs, in plain fields.

    Attributes
    ----------
    iso : float
        ISO value.
    model : str
        Name of the fitted model.
    channel : str
        Channel of the signal.
    exposure_basis : str
        "nominal" or "apex".
    luminance_k : float
        The model's K, in `luminance_k_unit`.
    luminance_k_standard_uncertainty : float
        Its standard uncertainty; includes everything, also the meter's calibration.
    luminance_k_unit : str
        Unit of K.
    expanded_uncertainty : float
        Expanded uncertainty of K for a coverage probability of 95 %.
    coverage_factor : float
        Coverage factor k of the expanded uncertainty.
    effective_dof : float or None
        Effective degrees of freedom; None if infinite.
    dark_signal_dn, dark_signal_standard_uncertainty_dn : float
        Dark signal at `dark_time_s` and its standard uncertainty [DN].
    black_level_dn, white_level_dn : float
        Mean black level and lowest white level of the points used [DN].
    parameter_names : tuple of str
        Names of the model's parameters.
    parameters : tuple of float
        Values of the model's parameters.
    covariance : tuple of tuple of float
        Covariance of `parameters`, without the meter's calibration.
    meter_calibration_u_rel : float
        Relative standard uncertainty of the meter's calibration.
    f_number_u_rel : float
        Relative standard uncertainty of an f-number that was not calibrated.
    exposure_time_u_rel : float
        Relative standard uncertainty of the exposure time.
    exposure_times_s : tuple of float
        Each exposure time that was used [s].
    f_number_range : tuple[float, float]
        Lowest and highest f-number of the points used.
    signal_range_dn : tuple[float, float]
        Lowest and highest N - D of the points used, not divided by V [DN].
    rhs_range : tuple[float, float]
        Lowest and highest X of the points used.
    vignetting : str or None
        Content hash of the vignetting version that K holds with; None without any.
    conditions : CalibrationConditions or None
        Lamp, response, colour and distance; None if the campaign states none of them.
    dark_time_s, dark_rate_dn_per_s, dark_rate_standard_uncertainty_dn_per_s : float or None
        Exposure time at which `dark_signal_dn` holds [s], and the rate at which the
        dark signal grows with it, with its standard uncertainty [DN/s]; None in
        older versions, whose dark signal does not depend on time.
    errors : ErrorSplit or None
        Errors of the parameters; None for semilog, and for older versions.
    apertures : tuple of Aperture or None
        K at each f-number of the points used, rising; None where `errors` is.
    """

    iso: float
    model: str
    channel: str
    exposure_basis: str
    luminance_k: float
    luminance_k_standard_uncertainty: float
    luminance_k_unit: str
    expanded_uncertainty: float
    coverage_factor: float
    effective_dof: float | None
    dark_signal_dn: float
    dark_signal_standard_uncertainty_dn: float
    black_level_dn: float
    white_level_dn: float
    parameter_names: tuple[str, ...]
    parameters: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    meter_calibration_u_rel: float
    f_number_u_rel: float
    exposure_time_u_rel: float
    exposure_times_s: tuple[float, ...]
    f_number_range: tuple[float, float]
    signal_range_dn: tuple[float, float]
    rhs_range: tuple[float, float]
    vignetting: str | None = field(default=None, metadata=LATER)
    conditions: CalibrationConditions | None = field(default=None, metadata=LATER)
    dark_time_s: float | None = field(default=None, metadata=LATER)
    dark_rate_dn_per_s: float | None = field(default=None, metadata=LATER)
    dark_rate_standard_uncertainty_dn_per_s: float | None = field(default=None, metadata=LATER)
    errors: ErrorSplit | None = field(default=None, metadata=LATER)
    apertures: tuple[Aperture, ...] | None = field(default=None, metadata=LATER)

    def at(self, time_s: float) -> "Coefficient":
        """Return the coefficient with the dark signal of an exposure time.

        Parameters
        ----------
        time_s : float
            Exposure time [s], on the calibration's basis.

        Returns
        -------
        Coefficient
            `dark_signal_dn` and its standard uncertainty are those at `time_s`.
        """
        if self.dark_time_s is None:
            return self
        apart_s = time_s - self.dark_time_s
        rate_u = self.dark_rate_standard_uncertainty_dn_per_s or 0.0
        return replace(
            self,
            dark_time_s=time_s,
            dark_signal_dn=self.dark_signal_dn + apart_s * (self.dark_rate_dn_per_s or 0.0),
            dark_signal_standard_uncertainty_dn=math.hypot(
                self.dark_signal_standard_uncertainty_dn, apart_s * rate_u
            ),
        )
