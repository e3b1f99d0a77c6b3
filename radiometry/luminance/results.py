"""Results of a luminance fit, ready for JSON; what does not exist is None."""

from dataclasses import dataclass, field

from radiometry.findings import Raised
from radiometry.fitting.evidence import BudgetEntry, Quantity
from radiometry.luminance.coefficient import Coefficient
from radiometry.specification.stored import LATER

K_UNIT = "DN*m2/(cd*s)"


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
    min_dn, max_dn : int or None
        Smallest and largest raw value of the region in the channel of the fit [DN];
        None in versions from before they were listed.
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
    min_dn: int | None = field(default=None, metadata=LATER)
    max_dn: int | None = field(default=None, metadata=LATER)


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
