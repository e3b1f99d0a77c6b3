"""Results of a vignetting fit: plain numbers, ready for JSON; what does not exist is None."""

from dataclasses import dataclass, field
from typing import Literal

from radiometry.findings import Raised
from radiometry.frame.packing import Packed

EQUATION = "signal above dark = even light * (1 + k1 r^2 + k2 r^4 + k3 r^6)"


@dataclass(frozen=True, kw_only=True)
class Conventions:
    """Conventions of the numbers, since programs differ: stored with every fit."""

    equation: str = EQUATION
    correction: Literal["divide"] = "divide"
    radius_unit: Literal["half_diagonal"] = "half_diagonal"
    pixel_origin: Literal["centre of the first pixel"] = "centre of the first pixel"
    corner: Literal["farthest from the centre"] = "farthest from the centre"
    covariance_of: tuple[str, ...] = ("k1", "k2", "k3", "centre_row_px", "centre_col_px")


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """Falloff of one f-number and channel: all that an application needs, in plain fields.

    V = 1 + k1 r^2 + k2 r^4 + k3 r^6, r the distance from the centre over `radius_px`.

    Attributes
    ----------
    f_number : float
        F-number.
    channel : str
        Name of the channel.
    height_px, width_px : int
        Size of the frame [px].
    radius_px : float
        Half of the diagonal of the frame [px].
    centre_row_px, centre_col_px : float
        Row and column of the centre [px].
    k1, k2, k3 : float
        Coefficients of the curve.
    covariance : tuple of tuple of float
        Covariance of k1, k2, k3, centre row, centre column.
    model_u_rel : float
        Relative departure of the flat from the curve beyond noise; alike at
        neighbouring places.
    corner_falloff, corner_falloff_standard_uncertainty : float
        1 - V at the corner farthest from the centre, and its standard uncertainty.
    """

    f_number: float
    channel: str
    height_px: int
    width_px: int
    radius_px: float
    centre_row_px: float
    centre_col_px: float
    k1: float
    k2: float
    k3: float
    covariance: tuple[tuple[float, ...], ...]
    model_u_rel: float
    corner_falloff: float
    corner_falloff_standard_uncertainty: float

    @property
    def k(self) -> tuple[float, float, float]:
        """Three coefficients of the curve."""
        return self.k1, self.k2, self.k3

    @property
    def centre_px(self) -> tuple[float, float]:
        """Row and column of the centre."""
        return self.centre_row_px, self.centre_col_px


@dataclass(frozen=True, kw_only=True)
class Spot:
    """Block that is darker (or brighter) than those around it.

    Attributes
    ----------
    row_px, col_px : float
        Position [px].
    depth_rel : float
        Difference, as a fraction of the fitted light.
    """

    row_px: float
    col_px: float
    depth_rel: float


@dataclass(frozen=True, kw_only=True)
class CornerVariance:
    """Contribution of one source to the variance of the corner falloff; ``kind`` : "A" or "B"."""

    source: str
    kind: str
    variance: float


@dataclass(frozen=True, kw_only=True)
class ChannelFit:
    """Results of one f-number and channel.

    Attributes
    ----------
    coefficient : Coefficient
        Falloff.
    frames : int
        Number of flat frames.
    chi_squared : float
        Weighted sum of squared residuals.
    dof : int
        Degrees of freedom.
    birge_ratio : float
        Birge ratio.
    residual_rms_rel : float
        Rms residual of the blocks that count, relative to the fitted light.
    mean_corner_falloff : float
        Mean falloff over the four corners.
    largest_falloff : float
        Largest falloff anywhere in the frame.
    gradient_rel, gradient_standard_uncertainty_rel : float
        Gradient of the light across the frame, largest less smallest, and its standard
        uncertainty.
    gradient_fitted : bool
        True if the coefficients are those of the fit with the gradient; versions from
        before it was always kept may have dropped it.
    centre_held : bool
        True if the flats do not determine the centre.
    residuals : Packed
        (light - fitted) / fitted, (row, col) of blocks; NaN where a block did not
        count.
    block_px : int
        Side of a block [px].
    dark_u_rel : float, default: 0.0
        Standard uncertainty of the dark level over the light at the centre. The
        covariance of k includes it, but not in versions from before it was evaluated.
    corner_variances : tuple of CornerVariance, default: ()
        Budget of the corner falloff; empty in versions from before it was kept.
    effective_dof : dict of str to float, default: {}
        Effective degrees of freedom of the uncertainties, by coefficient, at most 1e6;
        empty in versions from before they were evaluated.
    """

    coefficient: Coefficient
    frames: int
    chi_squared: float
    dof: int
    birge_ratio: float
    residual_rms_rel: float
    mean_corner_falloff: float
    largest_falloff: float
    gradient_rel: float
    gradient_standard_uncertainty_rel: float
    gradient_fitted: bool
    centre_held: bool
    residuals: Packed
    block_px: int
    dark_u_rel: float = 0.0
    corner_variances: tuple[CornerVariance, ...] = ()
    effective_dof: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """F-number from which on the falloff, the largest anywhere and in any channel, is below a limit.

    Attributes
    ----------
    falloff : float
        Limit.
    lowest_f_number : float or None
        Lowest f-number that is below; None if there is none.
    from_f_number : float or None
        Lowest f-number from which on all are below; None if there is none.
    is_sure : bool
        True if twice the uncertainty changes neither.
    """

    falloff: float
    lowest_f_number: float | None
    from_f_number: float | None
    is_sure: bool


@dataclass(frozen=True, kw_only=True)
class Point:
    """One frame in the fit.

    Attributes
    ----------
    frame : str
        Name of the frame.
    role : str
        Role of the frame.
    f_number : float or None
        F-number.
    used : bool
        True if the fit used it.
    left_out : str
        "" for one that was used, else the reason.
    saturated_share : float or None, default: None
        Fraction of clipped pixels of the most clipped channel.
    signal_share : float or None, default: None
        Median light of the weakest channel, as a fraction of its span from black to
        white.
    gradient_rel, gradient_standard_uncertainty_rel : float or None, default: None
        Gradient of the light in the strongest channel, and its standard uncertainty.
    spots : tuple of Spot, default: ()
        Spots, left out of the fit.
    """

    frame: str
    role: str
    f_number: float | None
    used: bool
    left_out: str
    saturated_share: float | None = None
    signal_share: float | None = None
    gradient_rel: float | None = None
    gradient_standard_uncertainty_rel: float | None = None
    spots: tuple[Spot, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Result of a campaign.

    Attributes
    ----------
    height_px, width_px : int
        Size of the frames [px].
    cfa : str
        Pattern of the frames, "grey" or "rgb".
    channel_fits : tuple of ChannelFit
        Results of each f-number and channel.
    thresholds : tuple of Threshold
        F-numbers from which on the falloff is below a limit.
    points : tuple of Point
        Points of the fit.
    flags : tuple of Raised
        Flags of the fit.
    conventions : Conventions, default: Conventions()
        Conventions of the numbers.
    """

    height_px: int
    width_px: int
    cfa: str
    channel_fits: tuple[ChannelFit, ...]
    thresholds: tuple[Threshold, ...]
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]
    conventions: Conventions = Conventions()

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """Falloff of every f-number and channel."""
        return tuple(fit.coefficient for fit in self.channel_fits)
