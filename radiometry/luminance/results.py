"""Results of a luminance fit, ready for JSON; what does not exist is None."""

import math
from dataclasses import dataclass, field, replace

from radiometry.findings import Raised
from radiometry.fitting.evidence import BudgetEntry, Quantity
from radiometry.luminance.conditions import CalibrationConditions
from radiometry.specification.stored import LATER

K_UNIT = "DN*m2/(cd*s)"


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


@dataclass(frozen=True, kw_only=True)
class ModelFit:
    """One model fitted to the points of one ISO value.

    Attributes
    ----------
    model : str
        Name of the model.
    parameter_names : tuple of str
        Names of its parameters.
    parameters : tuple of float
        Values of its parameters.
    covariance : tuple of tuple of float
        Covariance of `parameters`, Birge ratio included.
    r_squared : float or None
        Coefficient of determination of the signals in DN.
    aicc : float or None
        Akaike's criterion, corrected for few points; comparable between the models
        of one ISO value.
    chi_squared : float or None
        None for semilog, whose uncertainty is its own scatter.
    dof : int
        Points minus parameters.
    birge_ratio : float
        Birge ratio.
    effective_dof : float or None
        Effective degrees of freedom; None if infinite.
    meter_repeatability_rel : float or None
        Relative standard uncertainty of one meter reading, given or estimated.
    left_out_max_rel, left_out_rms_rel : float or None
        Largest and rms leave-one-scene-out error in L.
    frame_scatter_rel : float or None
        Estimated relative scatter between frames; None if not needed.
    stated_chi_squared : float or None
        chi^2 without that scatter; None if not needed.
    f_number_u_rel : float or None
        Relative standard uncertainty of a nominal f-number, given or estimated.
    """

    model: str
    parameter_names: tuple[str, ...]
    parameters: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    r_squared: float | None
    aicc: float | None
    chi_squared: float | None
    dof: int
    birge_ratio: float
    effective_dof: float | None
    meter_repeatability_rel: float | None
    left_out_max_rel: float | None
    left_out_rms_rel: float | None
    frame_scatter_rel: float | None = field(default=None, metadata=LATER)
    stated_chi_squared: float | None = field(default=None, metadata=LATER)
    f_number_u_rel: float | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class Point:
    """One light frame in the fit.

    Attributes
    ----------
    frame : str
        Name of the frame.
    scene : str
        Name of the scene.
    iso : float
        ISO value.
    exposure_time_s : float
        Exposure time [s].
    f_number : float
        F-number.
    used : bool
        True if the point was used.
    left_out : str
        "" for a point that was used, else the reason.
    luminance_cd_m2 : float or None
        Meter reading of the scene [cd/m2], at the time of the frame where the
        readings show how the lamp drifted.
    rhs : float or None
        Right-hand side X.
    signal_dn, signal_standard_uncertainty_dn : float
        Signal N and its standard uncertainty [DN].
    saturated_share : float
        Saturated fraction of the samples, 0 to 1.
    dark_signal_dn : float
        Dark signal D [DN].
    adjusted_signal_dn : float
        (N - D) / V [DN]; N - D without vignetting correction.
    fitted_signal_dn : float or None
        Signal above dark of the curve at X and the f-number [DN].
    fitted_luminance_cd_m2 : float or None
        Luminance of the curve at the signal [cd/m2].
    residual_rel : float or None
        (L_fit - L_meter) / L_meter, with K at the point's f-number.
    weight : float
        Weight in K: adjusted signal times weight, summed, is K; 0 if left out.
    lens_share : Quantity or None
        Relative illumination V; None without vignetting correction.
    robust_weight : float or None
        Weight of the point's scatter in a robust fit: about 1, near 0 for an outlier;
        None in a fit by least squares.
    x_factor : float or None
        Light at the f-number relative to the nominal one; None where there is no K at
        f-numbers.
    """

    frame: str
    scene: str
    iso: float
    exposure_time_s: float
    f_number: float
    used: bool
    left_out: str
    luminance_cd_m2: float | None
    rhs: float | None
    signal_dn: float
    signal_standard_uncertainty_dn: float
    saturated_share: float
    dark_signal_dn: float
    adjusted_signal_dn: float
    fitted_signal_dn: float | None
    fitted_luminance_cd_m2: float | None
    residual_rel: float | None
    weight: float
    lens_share: Quantity | None = field(default=None, metadata=LATER)
    robust_weight: float | None = field(default=None, metadata=LATER)
    x_factor: float | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class SceneSummary:
    """Meter readings of a scene.

    Attributes
    ----------
    scene : str
        Name of the scene.
    readings : int
        Number of luminance readings.
    luminance_cd_m2 : float
        Mean of the luminance readings [cd/m2].
    spread_rel : float
        (largest - smallest) / mean of the luminance readings.
    illuminance_lx : float or None
        Mean of the illuminance readings [lx].
    illuminance_spread_rel : float or None
        (largest - smallest) / mean of the illuminance readings.
    rho_e_pi_cd_m2 : float or None
        rho E / pi [cd/m2], if rho and an illuminance are given.
    """

    scene: str
    readings: int
    luminance_cd_m2: float
    spread_rel: float
    illuminance_lx: float | None
    illuminance_spread_rel: float | None
    rho_e_pi_cd_m2: float | None


@dataclass(frozen=True, kw_only=True)
class IsoFit:
    """Result for one ISO value.

    Attributes
    ----------
    coefficient : Coefficient
        Calibration of the ISO value.
    models : tuple of ModelFit
        Every model that was fitted.
    budget : tuple of BudgetEntry
        Contributions to u(K).
    chi_squared_per_dof : float or None
        chi^2 / dof of the chosen model; None for semilog.
    birge_ratio : float
        Birge ratio of the chosen model.
    expected_k : float
        K expected from ISO 12232.
    largest_residual_rel : float
        Largest absolute relative residual of the points used.
    passed : bool
        True if it passes by the campaign's decision rule.
    expanded_u_rel, beyond_tolerance_risk : float or None
        U of K at the f-number of the point with the largest |error| + U, relative, and
        the largest probability that the error of a point is really beyond the
        tolerance; None if the campaign states no decision rule, or K is relative only.
    """

    coefficient: Coefficient
    models: tuple[ModelFit, ...]
    budget: tuple[BudgetEntry, ...]
    chi_squared_per_dof: float | None
    birge_ratio: float
    expected_k: float
    largest_residual_rel: float
    passed: bool
    expanded_u_rel: float | None = field(default=None, metadata=LATER)
    beyond_tolerance_risk: float | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class SpectralQuality:
    """How near the camera's response is to V, and the lamp that K holds for.

    Attributes
    ----------
    lamp, camera_response : str
        Names of the library, "own table" or "not recorded".
    f1_prime : float or None
        General spectral mismatch index as a fraction; None without a response.
    """

    lamp: str
    camera_response: str
    f1_prime: float | None


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A luminance calibration: one coefficient per ISO value, every point, every flag, and the verdict.

    Attributes
    ----------
    iso_fits : tuple of IsoFit
        Result for each ISO value.
    points : tuple of Point
        Every light frame.
    scenes : tuple of SceneSummary
        Meter readings by scene.
    flags : tuple of Raised
        Flags of the fit.
    tolerance_rel : float
        Tolerance of the verdict.
    passed : bool
        True if every ISO value passed.
    spectral : SpectralQuality or None
        None if neither lamp nor response is known.
    """

    iso_fits: tuple[IsoFit, ...]
    points: tuple[Point, ...]
    scenes: tuple[SceneSummary, ...]
    flags: tuple[Raised, ...]
    tolerance_rel: float
    passed: bool
    spectral: SpectralQuality | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Effect of one standard uncertainty of one independent source on a luminance.

    Attributes
    ----------
    source : str
        Name of the source.
    shared : bool
        True if the same error is in every luminance of the frame, so that it can
        cancel in a ratio and never averages down; otherwise it is this luminance's
        own noise.
    effect_cd_m2 : float
        Effect with its sign [cd/m2].
    """

    source: str
    shared: bool
    effect_cd_m2: float


@dataclass(frozen=True, kw_only=True)
class AppliedLuminance:
    """Luminance of a region in a frame, with its uncertainty and flags.

    Attributes
    ----------
    luminance_cd_m2 : Quantity
        Luminance [cd/m2].
    signal_dn : float
        Signal N, black included [DN].
    adjusted_signal_dn : float
        (N - D) / V [DN]; N - D without vignetting correction.
    rhs : float
        Right-hand side X.
    effects : tuple of Effect
        Effects of the sources, whose sum of squares is the variance; the shared
        ones of one frame's luminances are in one order.
    flags : tuple of Raised
        Flags of the measurement.
    lens_share : Quantity or None, default: None
        Relative illumination V; None without vignetting correction.
    """

    luminance_cd_m2: Quantity
    signal_dn: float
    adjusted_signal_dn: float
    rhs: float
    effects: tuple[Effect, ...]
    flags: tuple[Raised, ...]
    lens_share: Quantity | None = None
