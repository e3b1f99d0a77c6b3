"""What comes out of a sharpness fit: plain numbers, ready for JSON; what does not exist is None."""

from dataclasses import dataclass

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """One figure of one position and channel.

    ``repeatability`` : standard deviation of single frames, None of one frame
    """

    name: str
    quantity: Quantity
    repeatability: float | None


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A response: mean over the frames, with its standard uncertainty.

    ``direction_deg`` : of a star's sector, else None; ``frequency`` : [cycles per pixel]
    """

    direction_deg: float | None
    frequency: tuple[float, ...]
    response: tuple[float, ...]
    response_u: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Direction:
    """The resolving power of a star's sector; None where it is resolved up to the last ring."""

    direction_deg: float
    resolving_power: Quantity | None


@dataclass(frozen=True, kw_only=True)
class PositionFit:
    """One channel of one position at one f-number.

    ``radius_rel`` : of the position, from the frame's middle, 1 at its corners
    ``orientation``, ``angle_deg``, ``departure_px`` : of edges; None for stars
    ``cycles`` : of stars; None for edges
    """

    kind: str
    position: str
    channel: str
    f_number: float | None
    row_px: float
    col_px: float
    radius_rel: float
    frames: int
    orientation: str | None
    angle_deg: float | None
    departure_px: float | None
    cycles: int | None
    coefficients: tuple[Coefficient, ...]
    curves: tuple[Curve, ...]
    directions: tuple[Direction, ...]

    def find(self, name: str) -> Coefficient | None:
        """Give a coefficient by its name, None where this position has none."""
        return next((each for each in self.coefficients if each.name == name), None)


@dataclass(frozen=True, kw_only=True)
class Falloff:
    """A position against the middle of the frame: ``ratio`` is 1 where it is as sharp."""

    position: str
    radius_rel: float
    ratio: Quantity


@dataclass(frozen=True, kw_only=True)
class FalloffTable:
    """How sharpness falls towards the corners, per channel and f-number.

    ``figure`` : the coefficient that is compared; ``centre`` : positions that make up the middle
    ``corner_falloff`` : 1 - (mean of the corners) / (mean of the middle); None without corners
    """

    kind: str
    channel: str
    f_number: float | None
    figure: str
    centre: tuple[str, ...]
    corners: tuple[str, ...]
    rows: tuple[Falloff, ...]
    corner_falloff: Quantity | None


@dataclass(frozen=True, kw_only=True)
class Point:
    """One channel of one region of one frame. ``left_out`` is "" for one that was used, else the reason.

    ``figure``, ``value`` : what is compared; ``residual_rel`` : against the mean of its position
    """

    frame: str
    position: str
    channel: str
    f_number: float | None
    used: bool
    left_out: str
    figure: str
    value: float | None
    standard_uncertainty: float | None
    residual_rel: float | None


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A sharpness calibration."""

    positions: tuple[PositionFit, ...]
    falloff: tuple[FalloffTable, ...]
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]
