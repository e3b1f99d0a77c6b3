"""What comes out of a reflectance fit: plain numbers, ready for JSON; what does not exist is None."""

from dataclasses import dataclass

from radiometry.findings import Raised
from radiometry.fitting.evidence import BudgetEntry, Quantity
from radiometry.reflectance.rows import Interpolation, Normalisation
from radiometry.reflectance.sunshine import Choice
from radiometry.reflectance.tilt import TiltParams

REFLECTANCE_UNIT = "1"


@dataclass(frozen=True, kw_only=True)
class Knot:
    """K at one visit to the panel: ``at_s`` its mean time on the camera's clock, None where it has none.

    ``u_rel`` : what this visit does not share with others: noise, sunshine scatter
    """

    at_s: float | None
    reflectance_k: float
    u_rel: float


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """The reflectance calibration of one band: all that `apply` needs, in plain fields.

    K = R cos(theta) I_ss / I_sq, for this camera and this sunshine sensor, and for the flight of the panel
    captures. ``reflectance_k_standard_uncertainty`` holds everything.

    ``knots`` : of the visits to the panel, in time; ``interpolation`` says whether K follows them
    ``shared_u_rel`` : panel, angle, evenness: the same in every visit; ``gain_u_rel`` : of the sunshine
        sensor's gain, kept apart since it cancels at the same ``gain_indices``; ``drift_u_rel`` : of a
        constant K
    ``sensor_model_scale`` : SensorModel's A, or RadiometricCalibration's a1
    ``*_range`` : (lowest, highest) of the points used; ``i_ss_range`` : None for panel_only
    """

    band: str
    reflectance_k: float
    reflectance_k_standard_uncertainty: float
    reflectance_k_unit: str
    expanded_uncertainty: float
    coverage_factor: float
    normalisation: Normalisation
    sunshine_choice: Choice
    interpolation: Interpolation
    tilt: TiltParams | None
    camera_serial: str | None
    sunshine_serial: str | None
    wavelength_nm: float | None
    incidence_angle_deg: float
    panel: str
    panel_reflectance: float
    knots: tuple[Knot, ...]
    shared_u_rel: float
    gain_u_rel: float
    drift_u_rel: float
    gain_indices: tuple[int, ...]
    sensor_model_scale: float
    i_sq_range: tuple[float, float]
    i_ss_range: tuple[float, float] | None


@dataclass(frozen=True, kw_only=True)
class Point:
    """One panel frame in the fit. ``left_out`` is "" for one that was used, else the reason.

    ``visit`` : number of the visit to the panel, from 1; ``residual_rel`` : K of this frame against the
        coefficient's at its time; ``panel_irradiance_w_m2_nm`` : on the panel, where radiance is known
    """

    frame: str
    band: str
    capture_id: str | None
    visit: int | None
    at_s: float | None
    used: bool
    left_out: str
    i_sq: float | None
    i_sq_standard_uncertainty: float | None
    gradient_rel: float | None
    saturated_share: float | None
    i_ss: float | None
    sunshine_readings: int | None
    sunshine_spread_rel: float | None
    panel_reflectance: float | None
    panel_irradiance_w_m2_nm: float | None
    reflectance_k: float | None
    residual_rel: float | None


@dataclass(frozen=True, kw_only=True)
class BandFit:
    """Everything about one band; ``drift_rel`` : (K_last - K_first) / K, None for one visit."""

    coefficient: Coefficient
    budget: tuple[BudgetEntry, ...]
    visits: int
    drift_rel: float | None


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A reflectance calibration: one coefficient per band, every point, every flag."""

    band_fits: tuple[BandFit, ...]
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]


@dataclass(frozen=True, kw_only=True)
class Effect:
    """What one standard uncertainty of one source does to a reflectance.

    ``shared`` : the same in every region of the frame
    """

    source: str
    shared: bool
    effect: float


@dataclass(frozen=True, kw_only=True)
class AppliedReflectance:
    """The reflectance of a region in a new frame, and what to know about it."""

    band: str
    reflectance: Quantity
    i_sq: float
    i_ss: float | None
    reflectance_k: float
    effects: tuple[Effect, ...]
    flags: tuple[Raised, ...]
