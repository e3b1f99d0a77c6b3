"""Results of a sharpness fit: plain numbers, ready for JSON; what does not exist is None."""

from dataclasses import dataclass, field

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity
from radiometry.specification.stored import LATER


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """One coefficient of one position and channel.

    Attributes
    ----------
    name : str
        Name of the coefficient.
    quantity : Quantity
        Value with uncertainty.
    repeatability : float or None
        Standard deviation of single frames; None for one frame.
    effective_dof : float or None, default: None
        Effective degrees of freedom of the standard uncertainty, at most 1e6; None in versions from before
        they were evaluated.
    """

    name: str
    quantity: Quantity
    repeatability: float | None
    effective_dof: float | None = None


@dataclass(frozen=True, kw_only=True)
class Curve:
    """Response: mean over the frames, with its standard uncertainty.

    Attributes
    ----------
    direction_deg : float or None
        Direction of a star's sector [deg], else None.
    frequency : tuple of float
        Frequencies [cycles per pixel].
    response, response_u : tuple of float
        Response and its standard uncertainty.
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

    Attributes
    ----------
    kind : str
        Kind of the target.
    position : str
        Name of the position.
    channel : str
        Name of the channel.
    f_number : float or None
        F-number.
    row_px, col_px : float
        Position [px].
    radius_rel : float
        Distance from the frame's middle, 1 at its corners.
    frames : int
        Number of frames.
    orientation, angle_deg, departure_px : str, float, float or None
        Orientation, angle [deg] and departure [px] of edges; None for stars.
    cycles : int or None
        Cycles of stars; None for edges.
    coefficients : tuple of Coefficient
        Coefficients of one version.
    curves : tuple of Curve
        Responses.
    directions : tuple of Direction
        Resolving power of each sector.
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
        """Return a coefficient by its name.

        Parameters
        ----------
        name : str
            Name of the coefficient.

        Returns
        -------
        Coefficient or None
            None if this position has no coefficient of this name.
        """
        return next((each for each in self.coefficients if each.name == name), None)


@dataclass(frozen=True, kw_only=True)
class Falloff:
    """Position compared with the middle of the frame.

    Attributes
    ----------
    position : str
        Name of the position.
    radius_rel : float
        Distance from the frame's middle, 1 at its corners.
    ratio : Quantity
        Ratio to the middle, 1 where it is as sharp.
    """

    position: str
    radius_rel: float
    ratio: Quantity


@dataclass(frozen=True, kw_only=True)
class FalloffTable:
    """Decrease of sharpness towards the corners, per channel and f-number.

    Attributes
    ----------
    kind : str
        Kind of the target.
    channel : str
        Name of the channel.
    f_number : float or None
        F-number.
    figure : str
        Coefficient that is compared.
    centre : tuple of str
        Positions that make up the middle.
    corners : tuple of str
        Positions that make up the corners.
    rows : tuple of Falloff
        Falloff of each position.
    corner_falloff : Quantity or None
        1 - (mean of the corners) / (mean of the middle); None without corners.
    corner_falloff_dof : float or None, default: None
        Its effective degrees of freedom, as of a coefficient.
    """

    kind: str
    channel: str
    f_number: float | None
    figure: str
    centre: tuple[str, ...]
    corners: tuple[str, ...]
    rows: tuple[Falloff, ...]
    corner_falloff: Quantity | None
    corner_falloff_dof: float | None = None


@dataclass(frozen=True, kw_only=True)
class Point:
    """One channel of one region of one frame.

    Attributes
    ----------
    frame : str
        Name of the frame.
    position : str
        Name of the position.
    channel : str
        Name of the channel.
    f_number : float or None
        F-number.
    used : bool
        True if the fit used it.
    left_out : str
        "" for one that was used, else the reason.
    figure, value, standard_uncertainty : str, float or None, float or None
        Coefficient that is compared, its value and its standard uncertainty.
    residual_rel : float or None
        Relative difference from the mean of its position.
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
class EdgeColour:
    """Displacement of one colour against green at one position; what does not exist is None.

    Attributes
    ----------
    channels : str
        Pair of channels, such as "R-G".
    position : str
        Name of the position.
    f_number : float or None
        F-number.
    radius_px, radius_rel : float
        Distance of the edge from the middle of the frame [px], and 1 at its corners.
    shift : Quantity
        Displacement along the edge's normal, positive away from the middle of the frame.
    radial : Quantity or None
        Radial displacement of which `shift` is the part along the normal, positive is outwards; None within a
        tenth of the half diagonal, and where the normal is more than 60 degrees off the radius.
    frames : int
        Number of frames.
    effective_dof : float
        Effective degrees of freedom of both.
    """

    channels: str
    position: str
    f_number: float | None
    radius_px: float
    radius_rel: float
    shift: Quantity
    radial: Quantity | None
    frames: int
    effective_dof: float


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A sharpness calibration."""

    positions: tuple[PositionFit, ...]
    falloff: tuple[FalloffTable, ...]
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]
    lateral_colour: tuple[EdgeColour, ...] | None = field(default=None, metadata=LATER)
