"""What comes out of a vignetting fit: plain numbers, ready for JSON; what does not exist is None."""

from dataclasses import dataclass
from typing import Literal

from radiometry.findings import Raised
from radiometry.frame.packing import Packed

EQUATION = "signal above dark = even light * (1 + k1 r^2 + k2 r^4 + k3 r^6)"


@dataclass(frozen=True, kw_only=True)
class Conventions:
    """What the numbers mean, since programs differ: stored with every fit."""

    equation: str = EQUATION
    correction: Literal["divide"] = "divide"
    radius_unit: Literal["half_diagonal"] = "half_diagonal"
    pixel_origin: Literal["centre of the first pixel"] = "centre of the first pixel"
    corner: Literal["farthest from the centre"] = "farthest from the centre"
    covariance_of: tuple[str, ...] = ("k1", "k2", "k3", "centre_row_px", "centre_col_px")


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """The falloff of one f-number and channel: all that an application needs, in plain fields.

    V = 1 + k1 r^2 + k2 r^4 + k3 r^6, r the distance from the centre over ``radius_px``, half of the diagonal
    of the frame of ``height_px`` by ``width_px``. ``covariance`` : of k1, k2, k3, centre row, centre column
    ``model_u_rel`` : by how much the flat departs from the curve beyond noise; alike at neighbouring places
    ``corner_falloff`` : 1 - V at the corner farthest from the centre
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
        """The three coefficients of the curve."""
        return self.k1, self.k2, self.k3

    @property
    def centre_px(self) -> tuple[float, float]:
        """Row and column of the centre."""
        return self.centre_row_px, self.centre_col_px


@dataclass(frozen=True, kw_only=True)
class Spot:
    """A block that is darker (or brighter) than those around it, by ``depth_rel`` of the fitted light."""

    row_px: float
    col_px: float
    depth_rel: float


@dataclass(frozen=True, kw_only=True)
class ChannelFit:
    """Everything about one f-number and channel.

    ``mean_corner_falloff`` : over the four corners; ``largest_falloff`` : anywhere in the frame
    ``residual_rms_rel`` : of the blocks that count, relative to the fitted light
    ``gradient_rel`` : of the light across the frame, largest less smallest, with its standard uncertainty;
        ``gradient_fitted`` says whether the coefficients are those of the fit with it
    ``residuals`` : (row, col) of blocks, (light - fitted) / fitted; NaN where a block did not count
    ``dark_u_rel`` : standard uncertainty of the dark level over the light at the centre; the covariance of k
        holds it, but not that of versions from before it was looked at
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


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """From which f-number on the falloff, the largest anywhere and in any channel, is below a limit.

    ``lowest_f_number`` : the lowest that is below; ``from_f_number`` : the lowest from which on all are; None
    where there is none. ``is_sure`` : twice the uncertainty changes neither
    """

    falloff: float
    lowest_f_number: float | None
    from_f_number: float | None
    is_sure: bool


@dataclass(frozen=True, kw_only=True)
class Point:
    """One frame in the fit. ``left_out`` is "" for one that was used, else the reason.

    ``signal_share`` : median light of the weakest channel, of its span from black to white
    ``gradient_rel`` : of the light, in the strongest channel; ``spots`` : left out of the fit
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
    """The result of a campaign; ``cfa`` : the frames' pattern, "grey" or "rgb"."""

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
        """Of every f-number and channel."""
        return tuple(fit.coefficient for fit in self.channel_fits)
