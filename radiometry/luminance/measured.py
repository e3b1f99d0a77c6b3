"""Results of a measurement, ready for JSON; what does not exist is None."""

from dataclasses import dataclass

from radiometry.findings import Raised
from radiometry.fitting.evidence import FieldCorrection, Quantity


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


@dataclass(frozen=True, kw_only=True)
class Share:
    """Contribution of one source to the mean's uncertainty.

    Attributes
    ----------
    source : str
        Name of the source.
    shared : bool
        True for the same error in every pixel of the frame, which no mean over
        pixels reduces.
    standard_uncertainty_cd_m2 : float
        Contribution [cd/m2].
    variance_share : float
        Fraction of the variance, 0 to 1.
    """

    source: str
    shared: bool
    standard_uncertainty_cd_m2: float
    variance_share: float


@dataclass(frozen=True, kw_only=True)
class Percentile:
    """A percentile of the region's pixels.

    Attributes
    ----------
    percent : int
        Percentage of the pixels that are not brighter than `luminance`.
    luminance : Quantity
        Luminance at that percentile.
    """

    percent: int
    luminance: Quantity


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A grid's cells and figures. ``cells`` : rows of columns; ``cell_model`` : "projective"."""

    cell_model: str
    cells: tuple[tuple[Quantity, ...], ...]
    l_av_cd_m2: Quantity
    l_min_cd_m2: Quantity
    l_max_cd_m2: Quantity
    u_o: Quantity | None
    u_l: tuple[Quantity | None, ...]
    average_to_min: Quantity | None
    max_to_min: Quantity | None
    illuminance_lx: Quantity | None


@dataclass(frozen=True, kw_only=True)
class Measured:
    """Luminance of a region with its whole budget; all values are finite, what does not exist is None.

    Attributes
    ----------
    pixels : int
        Number of pixels.
    signal_dn, dark_signal_dn : float
        Mean signal and dark signal [DN].
    channel : str
        Channel of the signal.
    model : str
        Model of the calibration.
    exposure_basis : str
        "nominal" or "apex".
    mean : Quantity
        Luminance of the region's signal, as the calibration was made.
    shared_u_cd_m2, noise_u_cd_m2 : float
        The two parts of its uncertainty [cd/m2].
    smallest, largest : Quantity
        Extremes of single pixels, with a single pixel's noise.
    median : Quantity
        Median of the pixels, with the median's own noise.
    percentiles : tuple of Percentile
        Percentiles of single pixels, with a single pixel's noise.
    budget : tuple of Share
        Contributions to the uncertainty of the mean.
    surface : Surface or None
        Result of the grid, if one was requested.
    illuminance_lx : Quantity or None
        Illuminance [lx], if a reflectance was given.
    saturated_share : float
        Saturated fraction of the region, 0 to 1.
    vignetting : str
        "none", or the name of the version that vignetting was corrected with.
    flags : tuple of Raised
        Flags of the measurement.
    lens_share : Quantity or None, default: None
        Relative illumination V of the region, if corrected: mean = (signal - dark)
        / V f^2 / (K t S).
    corrections : tuple of FieldCorrection, default: ()
        Corrections of the field that all luminances contain, maps included.
    """

    pixels: int
    signal_dn: float
    dark_signal_dn: float
    channel: str
    model: str
    exposure_basis: str
    mean: Quantity
    shared_u_cd_m2: float
    noise_u_cd_m2: float
    smallest: Quantity
    largest: Quantity
    median: Quantity
    percentiles: tuple[Percentile, ...]
    budget: tuple[Share, ...]
    surface: Surface | None
    illuminance_lx: Quantity | None
    saturated_share: float
    vignetting: str
    flags: tuple[Raised, ...]
    lens_share: Quantity | None = None
    corrections: tuple[FieldCorrection, ...] = ()
