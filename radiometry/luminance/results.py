"""Results of a luminance fit, ready for JSON; what does not exist is None."""

import math
from dataclasses import replace

from radiometry.findings import Raised
from radiometry.fitting.evidence import BudgetEntry, Quantity
from radiometry.luminance.rows import CalibrationConditions
from radiometry.records import Record, about, later

Rows = tuple[tuple[float, ...], ...]


class ErrorSplit(Record):
    """Covariance of a fit by what causes it: a frame's own settings meet the same errors.

    Of the model's parameters, and for one aperture of ln X as a last row.
    """

    fit: Rows = about("By all sources but f-numbers and exposure times.")
    f_numbers: Rows = about("By the errors of all f-numbers.")
    exposure_times: Rows = about(
        "Effect of one standard uncertainty of each exposure time, as in `exposure_times_s`."
    )


class Aperture(Record):
    """K at one f-number of an ISO value: the true f-number differs from the nominal one, always alike."""

    f_number: float
    scenes: int
    frames: int
    luminance_k: float = about("In the unit of the ISO value's K.")
    luminance_k_standard_uncertainty: float
    expanded_uncertainty: float = about("For a coverage probability of 95 %.")
    coverage_factor: float
    effective_dof: float | None = about("None if infinite.")
    x_factor: float = about("Light at this f-number relative to the nominal one, predicted.")
    errors: ErrorSplit = about("Errors of the parameters and of ln `x_factor`.")


class Coefficient(Record):
    """Luminance calibration of one ISO value: all that `apply` needs, in plain fields."""

    iso: float
    model: str
    channel: str
    exposure_basis: str = about('"nominal" or "apex".')
    luminance_k: float = about("The model's K, in `luminance_k_unit`.")
    luminance_k_standard_uncertainty: float = about("Includes everything, also the meter's calibration.")
    luminance_k_unit: str
    expanded_uncertainty: float = about("Of K, for a coverage probability of 95 %.")
    coverage_factor: float
    effective_dof: float | None = about("None if infinite.")
    dark_signal_dn: float = about("Dark signal at `dark_time_s` [DN].")
    dark_signal_standard_uncertainty_dn: float
    black_level_dn: float = about("Mean of the points used [DN].")
    white_level_dn: float = about("Lowest of the points used [DN].")
    parameter_names: tuple[str, ...]
    parameters: tuple[float, ...]
    covariance: Rows = about("Of `parameters`, without the meter's calibration.")
    meter_calibration_u_rel: float
    f_number_u_rel: float = about("Relative standard uncertainty of an f-number that was not calibrated.")
    exposure_time_u_rel: float
    exposure_times_s: tuple[float, ...] = about("Each exposure time that was used [s].")
    f_number_range: tuple[float, float] = about("Lowest and highest of the points used.")
    signal_range_dn: tuple[float, float] = about(
        "Lowest and highest N - D of the points used, not divided by V [DN]."
    )
    rhs_range: tuple[float, float] = about("Lowest and highest X of the points used.")
    vignetting: str | None = later("Content hash of the vignetting version; None without any.")
    conditions: CalibrationConditions | None = later("None if the campaign states none of them.")
    dark_time_s: float | None = later(
        "None in older versions, whose dark signal does not depend on the exposure time."
    )
    dark_rate_dn_per_s: float | None = later("Growth of the dark signal with the exposure time.")
    dark_rate_standard_uncertainty_dn_per_s: float | None = later()
    errors: ErrorSplit | None = later("None for semilog, and for older versions.")
    frame_scatter_rel: float | None = later(
        "Relative standard deviation between frames of one light, which each later frame has too."
    )
    frame_scatter_dof: float | None = later("Degrees of freedom of that; None if infinite.")
    apertures: tuple[Aperture, ...] | None = later("K at each f-number used, rising; None where `errors` is.")

    def at(self, time_s: float) -> "Coefficient":
        """Return the coefficient with the dark signal of an exposure time, on the calibration's basis."""
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


class ModelFit(Record):
    """One model fitted to the points of one ISO value."""

    model: str
    parameter_names: tuple[str, ...]
    parameters: tuple[float, ...]
    covariance: Rows = about("Of `parameters`, Birge ratio included.")
    r_squared: float | None = about("Of the signals in DN.")
    aicc: float | None = about(
        "Akaike's criterion for few points; comparable between models of one ISO value."
    )
    chi_squared: float | None = about("None for semilog, whose uncertainty is its own scatter.")
    dof: int = about("Points minus parameters.")
    birge_ratio: float
    effective_dof: float | None = about("None if infinite.")
    meter_repeatability_rel: float | None = about(
        "Relative standard uncertainty of one meter reading, given or estimated."
    )
    left_out_max_rel: float | None = about("Largest leave-one-scene-out error in L.")
    left_out_rms_rel: float | None = about("Rms leave-one-scene-out error in L.")
    frame_scatter_rel: float | None = later("Estimated relative scatter between frames; None if not needed.")
    stated_chi_squared: float | None = later("chi^2 without that scatter; None if not needed.")
    f_number_u_rel: float | None = later("Of a nominal f-number, given or estimated.")


class Point(Record):
    """One light frame in the fit."""

    frame: str
    scene: str
    iso: float
    exposure_time_s: float
    f_number: float
    used: bool
    left_out: str = about('"" for a point that was used, else the reason.')
    luminance_cd_m2: float | None = about(
        "Meter reading, at the time of the frame where the readings show the lamp's drift."
    )
    rhs: float | None = about("Right-hand side X.")
    signal_dn: float = about("Signal N [DN].")
    signal_standard_uncertainty_dn: float
    saturated_share: float = about("Saturated fraction of the samples, 0 to 1.")
    dark_signal_dn: float = about("Dark signal D [DN].")
    adjusted_signal_dn: float = about("(N - D) / V [DN]; N - D without vignetting correction.")
    fitted_signal_dn: float | None = about("Signal above dark of the curve at X and the f-number [DN].")
    fitted_luminance_cd_m2: float | None = about("Of the curve at the signal [cd/m2].")
    residual_rel: float | None = about("(L_fit - L_meter) / L_meter, with K at the point's f-number.")
    weight: float = about("Weight in K: adjusted signal times weight, summed, is K; 0 if left out.")
    lens_share: Quantity | None = later("Relative illumination V; None without vignetting correction.")
    robust_weight: float | None = later(
        "Weight in a robust fit: about 1, near 0 for an outlier; None by least squares."
    )
    x_factor: float | None = later(
        "Light at the f-number relative to the nominal one; None without K at f-numbers."
    )
    min_dn: int | None = later("Smallest raw value of the region in the fit's channel.")
    max_dn: int | None = later("Largest raw value of the region in the fit's channel.")


class SceneSummary(Record):
    """Meter readings of a scene."""

    scene: str
    readings: int = about("Number of luminance readings.")
    luminance_cd_m2: float = about("Mean of the readings [cd/m2].")
    spread_rel: float = about("(largest - smallest) / mean of the luminance readings.")
    illuminance_lx: float | None = about("Mean of the readings [lx].")
    illuminance_spread_rel: float | None = about("(largest - smallest) / mean of the illuminance readings.")
    rho_e_pi_cd_m2: float | None = about("rho E / pi [cd/m2], if rho and an illuminance are given.")


class IsoFit(Record):
    """Result for one ISO value."""

    coefficient: Coefficient
    models: tuple[ModelFit, ...] = about("Every model that was fitted.")
    budget: tuple[BudgetEntry, ...] = about("Contributions to u(K).")
    chi_squared_per_dof: float | None = about("Of the chosen model; None for semilog.")
    birge_ratio: float = about("Of the chosen model.")
    expected_k: float = about("K expected from ISO 12232.")
    largest_residual_rel: float = about("Largest |residual| of the points used.")
    passed: bool = about("True if it passes by the campaign's decision rule.")
    expanded_u_rel: float | None = later(
        "Relative U of K at its least certain f-number; None without a decision rule, or if K is relative "
        "only."
    )
    beyond_tolerance_risk: float | None = later(
        "Probability that K at that f-number is off by more than the tolerance; None as before."
    )


class SpectralQuality(Record):
    """How near the camera's response is to V, and the lamp that K holds for."""

    lamp: str = about('Name of the library, "own table" or "not recorded".')
    camera_response: str = about('Name of the library, "own table" or "not recorded".')
    f1_prime: float | None = about("General spectral mismatch index as a fraction; None without a response.")


class Fit(Record):
    """A luminance calibration: one coefficient per ISO value, every point, every flag, and the verdict."""

    iso_fits: tuple[IsoFit, ...]
    points: tuple[Point, ...]
    scenes: tuple[SceneSummary, ...]
    flags: tuple[Raised, ...]
    tolerance_rel: float
    passed: bool = about("True if every ISO value passed.")
    spectral: SpectralQuality | None = later("None if neither lamp nor response is known.")
