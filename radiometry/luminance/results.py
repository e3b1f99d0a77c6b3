"""What comes out of a luminance fit: plain numbers, ready for JSON; what does not exist is None."""

from dataclasses import dataclass, field

from radiometry.findings import Raised
from radiometry.fitting.evidence import BudgetEntry, Quantity
from radiometry.specification.stored import LATER

K_UNIT = "DN*m2/(cd*s)"


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """The luminance calibration of one ISO value: all that `apply` needs, in plain fields.

    ``parameters``, ``covariance`` : of ``model``, named by ``parameter_names``; the meter's calibration is
        not in ``covariance``, it stands in ``meter_calibration_u_rel``
    ``luminance_k`` : the model's K; its standard uncertainty holds everything, also the meter's calibration
    ``*_range`` : (lowest, highest) of the points used, ``signal_range_dn`` of N - D, not divided by V;
    ``exposure_times_s`` : each time that was used
    ``vignetting`` : content hash of the vignetting version that K holds with, None: without any
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
    effective_dof: float | None  # None: infinite
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


@dataclass(frozen=True, kw_only=True)
class ModelFit:
    """One model fitted to the points of one ISO value.

    ``covariance`` includes the Birge ratio; ``aicc`` is comparable between the models of one ISO value
    ``left_out_max_rel``, ``left_out_rms_rel`` : error in L of each scene predicted from the others
    ``meter_repeatability_rel`` : given or estimated
    ``frame_scatter_rel`` : between frames, estimated; ``stated_chi_squared`` : without it; None: not needed
    """

    model: str
    parameter_names: tuple[str, ...]
    parameters: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    r_squared: float | None
    aicc: float | None
    chi_squared: float | None  # None: semilog, whose uncertainty is its own scatter
    dof: int
    birge_ratio: float
    effective_dof: float | None
    meter_repeatability_rel: float | None
    left_out_max_rel: float | None
    left_out_rms_rel: float | None
    frame_scatter_rel: float | None = field(default=None, metadata=LATER)
    stated_chi_squared: float | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class Point:
    """One light frame in the fit. ``left_out`` is "" for a point that was used, else the reason.

    ``adjusted_signal_dn`` : (N - D) / V, ``lens_share`` V; without vignetting N - D, and no share
    ``weight`` : in K: adjusted signal times weight, summed, is K; 0 when left out
    ``residual_rel`` : (L_fit - L_meter) / L_meter
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


@dataclass(frozen=True, kw_only=True)
class SceneSummary:
    """The meter readings of a scene; ``rho_e_pi_cd_m2`` where rho and an illuminance are given."""

    scene: str
    readings: int
    luminance_cd_m2: float
    spread_rel: float
    illuminance_lx: float | None
    illuminance_spread_rel: float | None
    rho_e_pi_cd_m2: float | None


@dataclass(frozen=True, kw_only=True)
class IsoFit:
    """Everything about one ISO value."""

    coefficient: Coefficient
    models: tuple[ModelFit, ...]
    budget: tuple[BudgetEntry, ...]
    chi_squared_per_dof: float | None
    birge_ratio: float
    expected_k: float
    largest_residual_rel: float
    passed: bool


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A luminance calibration: one coefficient per ISO value, every point, every flag, and the verdict."""

    iso_fits: tuple[IsoFit, ...]
    points: tuple[Point, ...]
    scenes: tuple[SceneSummary, ...]
    flags: tuple[Raised, ...]
    tolerance_rel: float
    passed: bool


@dataclass(frozen=True, kw_only=True)
class Effect:
    """What one standard uncertainty of one independent source does to a luminance [cd/m2], with its sign.

    ``shared`` : the same error is in every luminance of the frame, so it can cancel in a ratio and never
        averages down; else it is this luminance's own noise
    """

    source: str
    shared: bool
    effect_cd_m2: float


@dataclass(frozen=True, kw_only=True)
class AppliedLuminance:
    """The luminance of a region in a frame, with its uncertainty, and what to know about it.

    ``adjusted_signal_dn`` : (N - D) / V, ``lens_share`` V; without vignetting N - D
    ``effects`` : sum of squares is the variance; of one frame's luminances the shared ones come in one order
    """

    luminance_cd_m2: Quantity
    signal_dn: float
    adjusted_signal_dn: float
    rhs: float
    effects: tuple[Effect, ...]
    flags: tuple[Raised, ...]
    lens_share: Quantity | None = None
