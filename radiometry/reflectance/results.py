"""Results of a reflectance fit, ready for JSON; what does not exist is None."""

from dataclasses import dataclass, field

from radiometry.findings import Raised
from radiometry.fitting.evidence import BudgetEntry, Quantity
from radiometry.frame.light import LightBasis
from radiometry.reflectance.rows import Interpolation, Normalisation
from radiometry.reflectance.sunshine import Choice
from radiometry.reflectance.tilt import TiltParams
from radiometry.specification.stored import LATER

REFLECTANCE_UNIT = "1"


@dataclass(frozen=True, kw_only=True)
class Knot:
    """K at one panel capture.

    Attributes
    ----------
    at_s : float or None
        Mean time on the camera's clock [s]; None if it has none.
    reflectance_k : float
        K of the capture.
    u_rel : float
        Relative standard uncertainty that this capture does not share with others:
        noise, sunshine scatter and tilt.
    half_span_s : float or None
        Time from the mean to the frame furthest from it [s].
    """

    at_s: float | None
    reflectance_k: float
    u_rel: float
    half_span_s: float | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """Reflectance calibration of one band: all that `apply` needs, in plain fields.

    K = R cos(theta) I_ss / I_sq, for this camera and this sunshine sensor, and for
    the flight of the panel captures.

    Attributes
    ----------
    band : str
        Name of the band.
    reflectance_k : float
        K, in `reflectance_k_unit`.
    reflectance_k_standard_uncertainty : float
        Standard uncertainty of K from all sources.
    reflectance_k_unit : str
        Unit of K.
    expanded_uncertainty : float
        Expanded uncertainty of K for a coverage probability of 95 %.
    coverage_factor : float
        Coverage factor k of the expanded uncertainty.
    normalisation : Normalisation
        "sunshine" or "panel_only".
    sunshine_choice : Choice
        Choice among the sunshine readings.
    interpolation : Interpolation
        "constant", or "linear" if K follows the knots.
    tilt : TiltParams or None
        Assumptions of the tilt correction; None without it.
    camera_serial, sunshine_serial : str or None
        Serial numbers of camera and sunshine sensor, where the files state them.
    wavelength_nm : float or None
        Centre wavelength [nm].
    incidence_angle_deg : float
        Angle between the light and the panel's normal [deg].
    panel : str
        Name of the panel.
    panel_reflectance : float
        Reflectance of the panel.
    knots : tuple of Knot
        K of the panel captures, in time.
    shared_u_rel : float
        Relative standard uncertainty from panel, angle and evenness, the same in
        every capture.
    gain_u_rel : float
        Relative standard uncertainty of the sunshine sensor's gain, separate since
        it cancels at the same `gain_indices`.
    drift_u_rel : float
        Relative standard uncertainty from the difference of the captures, of a constant K.
    gain_indices : tuple of int
        Gain indices of the sunshine readings used; -1 - i for index i of channel 1.
    sensor_model_scale : float
        A of SensorModel, a1 of RadiometricCalibration, or SensorGainAdjustment.
    i_sq_range : tuple[float, float]
        Lowest and highest signal of the points used.
    i_ss_range : tuple[float, float] or None
        Lowest and highest sunshine reading of the points used; None for panel_only.
    panel_measured_on : tuple of str or None
        Days of the panel's measurements that were used; None if none is dated.
    drift_half_hour_rel : float or None
        Relative standard deviation of K's change in half an hour, from the assumed one and
        the differences between the captures.
    channel_ratio, channel_ratio_u_rel : float or None
        CH0 / CH1 of a Sequoia's sunshine sensor under the panel's light, for a frame whose CH0
        is saturated, and its relative standard uncertainty.
    reading_u_rel : float or None
        Relative standard uncertainty of a single sunshine reading; None if the frames had
        several, whose scatter shows it.
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
    panel_measured_on: tuple[str, ...] | None = field(default=None, metadata=LATER)
    drift_half_hour_rel: float | None = field(default=None, metadata=LATER)
    reading_u_rel: float | None = field(default=None, metadata=LATER)
    channel_ratio: float | None = field(default=None, metadata=LATER)
    channel_ratio_u_rel: float | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class Point:
    """One panel frame in the fit.

    Attributes
    ----------
    frame : str
        Name of the frame.
    band : str
        Name of the band.
    capture_id : str or None
        Identifier of the capture.
    visit : int or None
        Number of the panel capture, from 1.
    at_s : float or None
        Time on the camera's clock [s].
    used : bool
        True if the frame was used.
    left_out : str
        "" if it was used, else the reason.
    i_sq, i_sq_standard_uncertainty : float or None
        Signal of the panel and its standard uncertainty.
    gradient_rel : float or None
        Change of the signal across the region, relative to the mean.
    saturated_share : float or None
        Saturated fraction of the region, 0 to 1.
    i_ss : float or None
        Sunshine reading.
    sunshine_readings : int or None
        Number of valid sunshine readings.
    sunshine_spread_rel : float or None
        Standard deviation of the sunshine readings, relative to their mean.
    panel_reflectance : float or None
        Reflectance of the panel.
    panel_irradiance_w_m2_nm : float or None
        Irradiance on the panel [W/m2/nm], where radiance is known.
    reflectance_k : float or None
        K of this frame.
    residual_rel : float or None
        K of this frame relative to the coefficient's at its time, minus 1.
    i_ss_oriented : float or None
        Sunshine reading as the sensor was oriented.
    i_ss_basis : LightBasis or None
        Surface for which `i_ss` holds.
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
    i_ss_oriented: float | None = field(default=None, metadata=LATER)
    i_ss_basis: LightBasis | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class BandFit:
    """Result for one band.

    Attributes
    ----------
    coefficient : Coefficient
        Calibration of the band.
    budget : tuple of BudgetEntry
        Contributions to u(K).
    visits : int
        Number of panel captures.
    drift_rel : float or None
        (K_last - K_first) / K; None for one capture.
    """

    coefficient: Coefficient
    budget: tuple[BudgetEntry, ...]
    visits: int
    drift_rel: float | None


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A reflectance calibration: one coefficient per band, every point, every flag.

    Attributes
    ----------
    band_fits : tuple of BandFit
        Result for each band.
    points : tuple of Point
        Every panel frame.
    flags : tuple of Raised
        Flags of the fit.
    """

    band_fits: tuple[BandFit, ...]
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Effect of one standard uncertainty of one source on a reflectance.

    Attributes
    ----------
    source : str
        Name of the source.
    shared : bool
        True if it is the same in every region of the frame.
    effect : float
        Effect [1].
    """

    source: str
    shared: bool
    effect: float


@dataclass(frozen=True, kw_only=True)
class AppliedReflectance:
    """Reflectance of a region in a new frame, with its flags.

    Attributes
    ----------
    band : str
        Name of the band.
    reflectance : Quantity
        Reflectance with its standard uncertainty.
    i_sq : float
        Signal of the region.
    i_ss : float or None
        Sunshine reading; None for a panel-only K.
    reflectance_k : float
        K at the frame's time.
    effects : tuple of Effect
        Effects of the sources.
    flags : tuple of Raised
        Flags of the measurement.
    i_ss_oriented : float or None
        Sunshine reading as the sensor was oriented.
    i_ss_basis : LightBasis or None
        Surface for which `i_ss` holds.
    """

    band: str
    reflectance: Quantity
    i_sq: float
    i_ss: float | None
    reflectance_k: float
    effects: tuple[Effect, ...]
    flags: tuple[Raised, ...]
    i_ss_oriented: float | None = field(default=None, metadata=LATER)
    i_ss_basis: LightBasis | None = field(default=None, metadata=LATER)
