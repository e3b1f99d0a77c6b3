"""What comes out of a noise fit: plain numbers, ready for JSON; what does not exist is None."""

from dataclasses import dataclass

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity
from radiometry.noise.transfer import SaturationOrigin

TRANSFER_EQUATION = "var_y - var_dark = K (mu_y - mu_dark)"


@dataclass(frozen=True, kw_only=True)
class LevelResult:
    """A lit stack in the photon transfer, the SNR curve and the linearity.

    ``signal_dn`` : mean above that of its dark frames; ``light_dn`` : above the dark signal of its own time
    ``excess_dn2`` : temporal variance above dark's; ``snr`` : light over temporal noise; None where a single
        frame shows no noise
    ``residual_dn2`` : excess - K signal; ``deviation_rel`` : from the straight line of the linearity
    ``left_out`` : why it is not in the photon transfer, "" where it is
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
    """What the photon transfer gives, by the names of EMVA 1288.

    ``system_gain_dn_per_e`` : K; ``read_noise_e`` : temporal dark noise without rounding;
        ``sensitivity_threshold_e`` : mu_e.min; ``full_well_e`` : saturation capacity mu_e.sat;
        ``dynamic_range`` : mu_e.sat / mu_e.min; ``saturation_dn`` : above dark
    ``levels_used`` : in the line; ``birge_ratio``, ``chi_squared`` : of their scatter about it
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
    """``error_rel`` : LE, mean of absolute deviations; the extremes are LE_min and LE_max of release 3.0."""

    error_rel: Quantity
    lowest_rel: float
    highest_rel: float
    levels_used: int


@dataclass(frozen=True, kw_only=True)
class DarkCurrentFigures:
    """From the mean, in electrons where K is known; a camera that subtracts it cannot hide the variance."""

    dark_current_dn_per_s: Quantity
    dark_current_e_per_s: Quantity | None
    from_variance_e_per_s: Quantity | None


@dataclass(frozen=True, kw_only=True)
class ChannelFit:
    """All about one channel at one ISO value. ``dark_signal_dn`` : of the shortest dark frames."""

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


@dataclass(frozen=True, kw_only=True)
class Point:
    """One channel of one frame. ``left_out`` is "" for one that was used, else the reason.

    ``frames_of_setting`` : how many share its role, scene, ISO, time and f-number, itself included
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
