"""What one frame says of its edges and stars: plain numbers, ready for JSON."""

from dataclasses import dataclass

CURVE_STEP_CYCLES_PER_PIXEL = 0.01
"""Of every stored response, which runs from 0 to 1 cycles per pixel: one grid for all edges of all frames."""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A number and its standard uncertainty."""

    value: float
    standard_uncertainty: float


@dataclass(frozen=True, kw_only=True)
class EdgeResponse:
    """The response of one channel at one edge. Lengths are in pixels of the whole sensor, normal to the edge.

    ``orientation`` : vertical: the edge crosses the rows; horizontal: it crosses the columns
    ``angle_deg`` : between the edge and the columns (vertical) or rows (horizontal), unsigned
    ``lines``, ``periods`` : lines of the channel that count, and how often the edge passes a whole pixel in
        them
    ``departure_px`` : largest distance of the edge from a straight line
    ``contrast`` : (bright - dark) / (bright + dark); ``noise_rel`` : a pixel's noise, of the step
    ``mtf``, ``mtf_u`` : at 0, 0.01, ..., 1 cycles per pixel; ``mtf50`` : None where it is above 1
    ``overshoot``, ``undershoot`` : beyond the bright and the dark side, of the step
    """

    channel: str
    orientation: str
    angle_deg: float
    lines: int
    periods: float
    departure_px: float
    contrast: float
    noise_rel: float
    mtf: tuple[float, ...]
    mtf_u: tuple[float, ...]
    mtf50: Estimate | None
    mtf_nyquist: Estimate | None
    rise_px: Estimate | None
    lsf_fwhm_px: Estimate | None
    overshoot: Estimate | None
    undershoot: Estimate | None


@dataclass(frozen=True, kw_only=True)
class Contrasts:
    """A star's contrast by frequency, 1 far outside; ``direction_deg`` : None for all directions together.

    ``direction_deg`` : of the sector's middle, from x (right) towards y (down). Its spokes run that way, so
        the response is the one across it
    """

    direction_deg: float | None
    contrast: tuple[float, ...]
    contrast_u: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class StarResponse:
    """The response of one channel at one star.

    ``centre_row_px``, ``centre_col_px`` : pixel indices, the first pixel's centre being 0
    ``frequency`` : [cycles per pixel], rising, one for each contrast of every curve
    ``modulation`` : (bright - dark) / (bright + dark) of the fundamental far outside
    """

    channel: str
    cycles: int
    centre_row_px: float
    centre_col_px: float
    outer_radius_px: float
    modulation: float
    frequency: tuple[float, ...]
    whole: Contrasts
    sectors: tuple[Contrasts, ...]


@dataclass(frozen=True, kw_only=True)
class Refusal:
    """Why a channel of a region gives nothing: the error's code and its sentence."""

    channel: str
    code: str
    message: str


@dataclass(frozen=True, kw_only=True)
class RegionResponse:
    """One region, its middle at ``row_px``, ``col_px``: edges or stars by channel, and channels without."""

    name: str
    row_px: float
    col_px: float
    edges: tuple[EdgeResponse, ...]
    stars: tuple[StarResponse, ...]
    refused: tuple[Refusal, ...]


@dataclass(frozen=True, kw_only=True)
class Features:
    """All regions of a frame; ``kind`` : of the target."""

    kind: str
    height_px: int
    width_px: int
    rendered: bool
    regions: tuple[RegionResponse, ...]
