"""Edges and stars of one frame: plain numbers, ready for JSON."""

from dataclasses import dataclass, field

from radiometry.specification.stored import LATER

# Of every stored response, which runs from 0 to 1 cycles per pixel: one grid for all edges of all frames
CURVE_STEP_CYCLES_PER_PIXEL = 0.01


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A number and its standard uncertainty."""

    value: float
    standard_uncertainty: float


@dataclass(frozen=True, kw_only=True)
class EdgePlace:
    """Place of an edge in one channel."""

    normal: tuple[float, float]  # Unit normal (row, col), to the right or downwards
    # Mean place along the normal from the middle of the region, and its standard uncertainty [px]
    place_px: float
    place_u_px: float
    dof: float  # Degrees of freedom of the latter


@dataclass(frozen=True, kw_only=True)
class EdgeResponse:
    """Response of one channel at one edge; lengths are in pixels of the whole sensor, normal to the edge."""

    channel: str
    orientation: str  # "vertical": the edge crosses the rows; "horizontal": it crosses the columns
    angle_deg: float  # Angle between the edge and the columns (vertical) or rows (horizontal), unsigned [deg]
    lines: int  # Lines of the channel that count, and how often the edge passes a whole pixel in them
    periods: float
    departure_px: float  # Largest distance of the edge from a straight line [px]
    contrast: float  # (bright - dark) / (bright + dark)
    noise_rel: float  # Noise of a pixel, as a fraction of the step
    mtf: tuple[float, ...]  # MTF and its standard uncertainty at 0, 0.01, ..., 1 cycles per pixel
    mtf_u: tuple[float, ...]
    mtf50: Estimate | None  # Frequency at which the MTF is 0.5 [cycles per pixel]; None where it is above 1
    mtf_nyquist: Estimate | None  # MTF at the Nyquist frequency
    rise_px: Estimate | None  # 10-90 % rise [px]
    lsf_fwhm_px: Estimate | None  # Full width at half maximum of the line spread function [px]
    overshoot: Estimate | None  # Excess beyond the bright and the dark side, as a fraction of the step
    undershoot: Estimate | None
    # Place of the edge; None in features from before it was measured
    place: EdgePlace | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class Contrasts:
    """Contrast of a star by frequency, 1 far outside."""

    # Direction of the sector's middle, from x (right) towards y (down) [deg]; None for all directions
    # together. Its spokes run that way, so the response is the one across it.
    direction_deg: float | None
    contrast: tuple[float, ...]  # Contrast and its standard uncertainty
    contrast_u: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class StarResponse:
    """Response of one channel at one star."""

    channel: str
    cycles: int  # Cycles of the star
    centre_row_px: float  # Centre, as pixel indices, the first pixel's centre being 0
    centre_col_px: float
    outer_radius_px: float  # Radius of the largest ring [px]
    modulation: float  # (bright - dark) / (bright + dark) of the fundamental far outside
    # Rising frequencies [cycles per pixel], one for each contrast of every curve
    frequency: tuple[float, ...]
    whole: Contrasts  # Contrast of all directions together
    sectors: tuple[Contrasts, ...]  # Contrast of each sector


@dataclass(frozen=True, kw_only=True)
class Refusal:
    """Reason why a channel of a region has no response: code and sentence of the error."""

    channel: str
    code: str
    message: str


@dataclass(frozen=True, kw_only=True)
class RegionResponse:
    """One region: edges or stars by channel, and channels without a response."""

    name: str  # Name of the region
    row_px: float  # Middle of the region [px]
    col_px: float
    edges: tuple[EdgeResponse, ...]  # Responses by channel
    stars: tuple[StarResponse, ...]
    refused: tuple[Refusal, ...]  # Channels without a response


@dataclass(frozen=True, kw_only=True)
class Features:
    """Responses of all regions of a frame."""

    kind: str  # Kind of the target
    height_px: int
    width_px: int
    rendered: bool  # True if the frame is rendered
    regions: tuple[RegionResponse, ...]
