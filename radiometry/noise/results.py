"""Parameters and results of a noise fit, ready for JSON, and their key figures."""

from dataclasses import dataclass, field
from typing import Any, Literal

from radiometry.findings import Raised
from radiometry.fitting.evidence import Exclusion, Quantity
from radiometry.specification.certificate import KeyFigure, choose_channel, of_quantity
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.specification.stored import meaning

LIGHT, FLAT, DARK = "light", "flat", "dark"


@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of a noise fit; the defaults are those of EMVA 1288."""

    gain_range_share: float = parameter(
        0.70,
        label="Upper end of the photon transfer fit",
        description="The photon transfer is fitted up to this fraction of saturation.",
        bounds="(0, 1]",
    )
    linearity_range_share: tuple[float, float] = parameter(
        (0.05, 0.95),
        label="Range of the linearity fit",
        description="Range of the straight line of the linearity error, as fractions of saturation.",
        bounds="(0, 1]",
    )
    largest_drift_rel: float = parameter(
        0.10,
        label="Largest drift of the light",
        description="Stacks whose frames differ more in their means are left out, because their light "
        "changed.",
        bounds="(0, 1]",
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Check every parameter against its range and choices."""
        check_parameters(self)


SaturationOrigin = Literal["white_level", "variance_maximum", "white_level_assumed"]

TRANSFER_EQUATION = "var_y - var_dark = K (mu_y - mu_dark)"


@dataclass(frozen=True, kw_only=True)
class LevelResult:
    """Lit stack in the photon transfer, the SNR curve and the linearity."""

    role: str
    scene: str
    f_number: float
    exposure_time_s: float
    frames: int = field(metadata=meaning("Number of frames."))
    signal_dn: float = field(metadata=meaning("Mean above that of its dark frames [DN]."))
    light_dn: float = field(metadata=meaning("Mean above the dark signal of its own time [DN]."))
    excess_dn2: float | None = field(
        metadata=meaning(
            "Temporal variance above that of the dark frames, and its standard uncertainty [DN^2]; None if "
            "a single frame shows no noise."
        )
    )
    excess_u_dn2: float | None = field(
        metadata=meaning(
            "Temporal variance above that of the dark frames, and its standard uncertainty [DN^2]; None if "
            "a single frame shows no noise."
        )
    )
    snr: float | None = field(
        metadata=meaning("Light over temporal noise; None if a single frame shows no noise.")
    )
    snr_standard_uncertainty: float | None
    residual_dn2: float | None = field(metadata=meaning("Excess - K signal [DN^2]."))
    deviation_rel: float | None = field(
        metadata=meaning("Relative deviation from the straight line of the linearity.")
    )
    left_out: str = field(metadata=meaning('Reason why it is not in the photon transfer; "" if it is.'))


@dataclass(frozen=True, kw_only=True)
class TransferFigures:
    """Coefficients of the photon transfer, by the names of EMVA 1288."""

    system_gain_dn_per_e: Quantity = field(metadata=meaning("System gain K [DN/e-]."))
    read_noise_e: Quantity = field(metadata=meaning("Temporal dark noise without rounding [e-]."))
    sensitivity_threshold_e: Quantity = field(metadata=meaning("Sensitivity threshold mu_e.min [e-]."))
    saturation_dn: Quantity = field(metadata=meaning("Saturation above dark [DN]."))
    saturation_origin: SaturationOrigin = field(metadata=meaning("How the saturation was found."))
    full_well_e: Quantity = field(metadata=meaning("Saturation capacity mu_e.sat [e-]."))
    snr_max: Quantity = field(metadata=meaning("Largest signal-to-noise ratio, sqrt(mu_e.sat)."))
    dynamic_range: Quantity = field(
        metadata=meaning("Dynamic range mu_e.sat / mu_e.min as a ratio, in dB and in stops.")
    )
    dynamic_range_db: Quantity = field(
        metadata=meaning("Dynamic range mu_e.sat / mu_e.min as a ratio, in dB and in stops.")
    )
    dynamic_range_stops: Quantity = field(
        metadata=meaning("Dynamic range mu_e.sat / mu_e.min as a ratio, in dB and in stops.")
    )
    dsnu_e: Quantity
    levels_used: int = field(metadata=meaning("Number of levels in the line."))
    birge_ratio: float = field(
        metadata=meaning("Birge ratio and chi squared of their scatter about the line.")
    )
    chi_squared: float = field(
        metadata=meaning("Birge ratio and chi squared of their scatter about the line.")
    )


@dataclass(frozen=True, kw_only=True)
class LinearityFigures:
    """Linearity error of one channel at one ISO value."""

    error_rel: Quantity = field(metadata=meaning("Mean of the absolute deviations LE."))
    lowest_rel: float = field(metadata=meaning("Extreme deviations, LE_min and LE_max of release 3.0."))
    highest_rel: float = field(metadata=meaning("Extreme deviations, LE_min and LE_max of release 3.0."))
    levels_used: int = field(metadata=meaning("Number of levels on the line."))


@dataclass(frozen=True, kw_only=True)
class DarkCurrentFigures:
    """Dark current, in electrons if K is known."""

    dark_current_dn_per_s: Quantity = field(metadata=meaning("Dark current from the mean [DN/s]."))
    dark_current_e_per_s: Quantity | None = field(
        metadata=meaning("Dark current from the mean [e-/s]; None if K is not known.")
    )
    from_variance_e_per_s: Quantity | None = field(
        metadata=meaning(
            "Dark current from the variance [e-/s], which a camera that subtracts its dark current cannot "
            "hide; None if it is not known."
        )
    )


@dataclass(frozen=True, kw_only=True)
class ChannelFit:
    """Results of one channel at one ISO value."""

    iso: float = field(metadata=meaning("ISO value."))
    channel: str
    dark_signal_dn: float = field(metadata=meaning("Dark signal of the shortest dark frames [DN]."))
    read_noise_dn: Quantity
    dsnu_dn: Quantity
    prnu_rel: Quantity | None = field(metadata=meaning("PRNU, relative."))
    transfer: TransferFigures | None = field(metadata=meaning("Coefficients of the photon transfer."))
    linearity: LinearityFigures | None = field(metadata=meaning("Linearity error."))
    dark_current: DarkCurrentFigures | None
    levels: tuple[LevelResult, ...] = field(metadata=meaning("Levels of the photon transfer."))
    effective_dof: dict[str, float] = field(
        default_factory=dict,
        metadata=meaning(
            "Effective degrees of freedom of the uncertainties, by coefficient, at most 1e6; empty in "
            "versions from before they were evaluated."
        ),
    )


@dataclass(frozen=True, kw_only=True)
class Point:
    """One channel of one frame."""

    frame: str
    channel: str
    role: str
    scene: str | None
    iso: float | None = field(metadata=meaning("ISO value."))
    f_number: float | None
    exposure_time_s: float | None
    mean_dn: float | None = field(metadata=meaning("Mean of the samples [DN]."))
    clipped_share: float | None = field(metadata=meaning("Fraction of samples at or above the white level."))
    frames_of_setting: int = field(
        metadata=meaning(
            "Number of frames that share its role, scene, ISO, time and f-number, itself included."
        )
    )
    used: bool = field(metadata=meaning("True if the fit used it."))
    left_out: str = field(metadata=meaning('Reason why it was not used; "" if it was.'))


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A noise calibration: every channel at every ISO value, every point, every flag."""

    channel_fits: tuple[ChannelFit, ...]
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]


_FIGURES = (("full_well_e", "Full well"), ("read_noise_e", "Read noise"), ("snr_max", "Largest SNR"))


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    """Return them for each ISO value, of the channel that stands for brightness."""
    fits = result["channel_fits"]
    shown = choose_channel(fit["channel"] for fit in fits)
    return tuple(
        figure
        for fit in fits
        if fit["channel"] == shown
        for name, label in _FIGURES
        for figure in of_quantity(f"ISO {fit['iso']:g}", label, (fit.get("transfer") or {}).get(name))
    )
