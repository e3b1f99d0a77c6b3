"""What comes out of measuring a frame: plain numbers, ready for JSON; what does not exist is None."""

from dataclasses import dataclass

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity


@dataclass(frozen=True, kw_only=True)
class Share:
    """One source's share of the mean's uncertainty.

    ``shared`` : the same error in every pixel of the frame, which no mean over pixels reduces
    """

    source: str
    shared: bool
    standard_uncertainty_cd_m2: float
    variance_share: float


@dataclass(frozen=True, kw_only=True)
class Percentile:
    """``percent`` of the region's pixels are not brighter than ``luminance``."""

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
    """A region's luminance with its whole budget; all numbers finite, what does not exist is None.

    ``mean`` : of the region's signal, as the calibration was made; ``shared_u_cd_m2`` and ``noise_u_cd_m2``
        are the two parts of its uncertainty
    ``smallest``, ``largest``, ``percentiles`` : of single pixels, with a single pixel's noise
    ``vignetting`` : what it was corrected with: "none", or the version's name; ``lens_share`` : then V of the
        region, of which mean = (signal - dark) / V f^2 / (K t S)
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
