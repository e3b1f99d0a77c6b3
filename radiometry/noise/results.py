"""Results of a noise fit: plain numbers, ready for JSON; what does not exist is None."""

from dataclasses import dataclass, field

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity
from radiometry.noise.transfer import SaturationOrigin

TRANSFER_EQUATION = "var_y - var_dark = K (mu_y - mu_dark)"


@dataclass(frozen=True, kw_only=True)
class LevelResult:
    """Lit stack in the photon transfer, the SNR curve and the linearity.

    Attributes
    ----------
    role : str
        Role of the frame.
    scene : str
        Scene of the frame.
    f_number : float
        F-number.
    exposure_time_s : float
        Exposure time [s].
    frames : int
        Number of frames.
    signal_dn : float
        Mean above that of its dark frames [DN].
    light_dn : float
        Mean above the dark signal of its own time [DN].
    excess_dn2, excess_u_dn2 : float or None
        Temporal variance above that of the dark frames, and its standard uncertainty
        [DN^2]; None if a single frame shows no noise.
    snr, snr_standard_uncertainty : float or None
        Light over temporal noise, and its standard uncertainty; None if a single frame
        shows no noise.
    residual_dn2 : float or None
        Excess - K signal [DN^2].
    deviation_rel : float or None
        Relative deviation from the straight line of the linearity.
    left_out : str
        Reason why it is not in the photon transfer; "" if it is.
    """

    role: str
    scene: str
    f_number: float
    exposure_time_s: float
    frames: int
    signal_dn: float
    light_dn: float
    excess_dn2: float | None
    excess_u_dn2: float | None
    snr: float | None
    snr_standard_uncertainty: float | None
    residual_dn2: float | None
    deviation_rel: float | None
    left_out: str


@dataclass(frozen=True, kw_only=True)
class TransferFigures:
    """Coefficients of the photon transfer, by the names of EMVA 1288.

    Attributes
    ----------
    system_gain_dn_per_e : Quantity
        System gain K [DN/e-].
    read_noise_e : Quantity
        Temporal dark noise without rounding [e-].
    sensitivity_threshold_e : Quantity
        Sensitivity threshold mu_e.min [e-].
    saturation_dn : Quantity
        Saturation above dark [DN].
    saturation_origin : SaturationOrigin
        How the saturation was found.
    full_well_e : Quantity
        Saturation capacity mu_e.sat [e-].
    snr_max : Quantity
        Largest signal-to-noise ratio, sqrt(mu_e.sat).
    dynamic_range, dynamic_range_db, dynamic_range_stops : Quantity
        Dynamic range mu_e.sat / mu_e.min as a ratio, in dB and in stops.
    dsnu_e : Quantity
        DSNU [e-].
    levels_used : int
        Number of levels in the line.
    birge_ratio, chi_squared : float
        Birge ratio and chi squared of their scatter about the line.
    """

    system_gain_dn_per_e: Quantity
    read_noise_e: Quantity
    sensitivity_threshold_e: Quantity
    saturation_dn: Quantity
    saturation_origin: SaturationOrigin
    full_well_e: Quantity
    snr_max: Quantity
    dynamic_range: Quantity
    dynamic_range_db: Quantity
    dynamic_range_stops: Quantity
    dsnu_e: Quantity
    levels_used: int
    birge_ratio: float
    chi_squared: float


@dataclass(frozen=True, kw_only=True)
class LinearityFigures:
    """Linearity error of one channel at one ISO value.

    Attributes
    ----------
    error_rel : Quantity
        Mean of the absolute deviations LE.
    lowest_rel, highest_rel : float
        Extreme deviations, LE_min and LE_max of release 3.0.
    levels_used : int
        Number of levels on the line.
    """

    error_rel: Quantity
    lowest_rel: float
    highest_rel: float
    levels_used: int


@dataclass(frozen=True, kw_only=True)
class DarkCurrentFigures:
    """Dark current, in electrons if K is known.

    Attributes
    ----------
    dark_current_dn_per_s : Quantity
        Dark current from the mean [DN/s].
    dark_current_e_per_s : Quantity or None
        Dark current from the mean [e-/s]; None if K is not known.
    from_variance_e_per_s : Quantity or None
        Dark current from the variance [e-/s], which a camera that subtracts its dark
        current cannot hide; None if it is not known.
    """

    dark_current_dn_per_s: Quantity
    dark_current_e_per_s: Quantity | None
    from_variance_e_per_s: Quantity | None


@dataclass(frozen=True, kw_only=True)
class ChannelFit:
    """Results of one channel at one ISO value.

    Attributes
    ----------
    iso : float
        ISO value.
    channel : str
        Name of the channel.
    dark_signal_dn : float
        Dark signal of the shortest dark frames [DN].
    read_noise_dn : Quantity
        Read noise [DN].
    dsnu_dn : Quantity
        DSNU [DN].
    prnu_rel : Quantity or None
        PRNU, relative.
    transfer : TransferFigures or None
        Coefficients of the photon transfer.
    linearity : LinearityFigures or None
        Linearity error.
    dark_current : DarkCurrentFigures or None
        Dark current.
    levels : tuple of LevelResult
        Levels of the photon transfer.
    effective_dof : dict of str to float, default: {}
        Effective degrees of freedom of the uncertainties, by coefficient, at most 1e6;
        empty in versions from before they were evaluated.
    """

    iso: float
    channel: str
    dark_signal_dn: float
    read_noise_dn: Quantity
    dsnu_dn: Quantity
    prnu_rel: Quantity | None
    transfer: TransferFigures | None
    linearity: LinearityFigures | None
    dark_current: DarkCurrentFigures | None
    levels: tuple[LevelResult, ...]
    effective_dof: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Point:
    """One channel of one frame.

    Attributes
    ----------
    frame : str
        Name of the frame.
    channel : str
        Name of the channel.
    role : str
        Role of the frame.
    scene : str or None
        Scene of the frame.
    iso : float or None
        ISO value.
    f_number : float or None
        F-number.
    exposure_time_s : float or None
        Exposure time [s].
    mean_dn : float or None
        Mean of the samples [DN].
    clipped_share : float or None
        Fraction of samples at or above the white level.
    frames_of_setting : int
        Number of frames that share its role, scene, ISO, time and f-number, itself
        included.
    used : bool
        True if the fit used it.
    left_out : str
        Reason why it was not used; "" if it was.
    """

    frame: str
    channel: str
    role: str
    scene: str | None
    iso: float | None
    f_number: float | None
    exposure_time_s: float | None
    mean_dn: float | None
    clipped_share: float | None
    frames_of_setting: int
    used: bool
    left_out: str


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A noise calibration: every channel at every ISO value, every point, every flag."""

    channel_fits: tuple[ChannelFit, ...]
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]
