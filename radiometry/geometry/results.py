"""Results of a geometry fit: plain numbers, ready for JSON; what does not exist is None."""

from dataclasses import dataclass, field

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity
from radiometry.geometry.camera import CameraModel
from radiometry.geometry.colour import LateralColour
from radiometry.geometry.rows import Window
from radiometry.geometry.target import Target
from radiometry.specification.stored import LATER


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """One parameter of the camera; the standard uncertainty of one that was not free is 0."""

    name: str
    value: float
    standard_uncertainty: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class Point:
    """One picture in the fit.

    Attributes
    ----------
    frame : str
        Name of the frame.
    used : bool
        True if the fit used it.
    left_out : str
        "" for one that was used, else the reason.
    corners : int
        Number of corners.
    rms_px, largest_px : float or None, default: None
        Rms and largest of the distances between its corners and the model [px]; for a
        view that was rejected, from the camera that the others determine.
    tilt_deg : float or None, default: None
        Angle between the board's normal and the optical axis [deg].
    distance_mm : float or None, default: None
        Distance of its first corner [mm].
    spacing_px : float or None, default: None
        Shortest distance between neighbouring corners [px].
    edge_rise_px : float or None, default: None
        10 to 90 % rise of the squares' edges [px].
    """

    frame: str
    used: bool
    left_out: str
    corners: int
    rms_px: float | None = None
    largest_px: float | None = None
    tilt_deg: float | None = None
    distance_mm: float | None = None
    spacing_px: float | None = None
    edge_rise_px: float | None = None


@dataclass(frozen=True, kw_only=True)
class CurvePoint:
    """Radial distortion at one distance from the principal point; negative is towards it (barrel).

    Attributes
    ----------
    radius_px : float
        Radius at which this lens shows it [px].
    ideal_radius_px : float
        Radius at which a lens without distortion would show it [px].
    distortion_px, standard_uncertainty_px : float
        `radius_px` less `ideal_radius_px`, and its standard uncertainty [px].
    distortion_um, standard_uncertainty_um : float or None
        The same [um]; None without a pixel pitch.
    extrapolated : bool
        True if further out than any corner that was used.
    """

    radius_px: float
    ideal_radius_px: float
    distortion_px: float
    standard_uncertainty_px: float
    distortion_um: float | None
    standard_uncertainty_um: float | None
    extrapolated: bool


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Coverage of the frame by corners.

    Attributes
    ----------
    counts : tuple of tuple of int
        Corners in each cell of a grid, (row, col).
    share : float
        Fraction of cells with a corner.
    radius_share : float
        Covered fraction of the distance from the principal point to the farthest corner
        of the frame.
    """

    counts: tuple[tuple[int, ...], ...]
    share: float
    radius_share: float


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Geometry calibration.

    Attributes
    ----------
    model : str
        Name of the model.
    target : Target
        Board that was photographed.
    corner_window : Window
        Window in which corners were placed.
    pixel_pitch_um : float or None
        Distance of neighbouring pixels [um]; None if unknown.
    camera : CameraModel
        Camera.
    coefficients : tuple of Coefficient
        Coefficients of which `list_coefficients` returns the values.
    covariance : tuple of tuple of float
        Covariance of `camera.PARAMETERS`, (9, 9).
    rms_px : float
        Rms residual [px].
    views, corners : int
        Number of views and of corners.
    degrees_of_freedom : int
        Degrees of freedom.
    principal_distance_mm : Quantity or None
        Principal distance [mm]; None without a pixel pitch.
    offset_row, offset_col : Quantity
        Offset of the principal point from the middle of the frame.
    offset_row_um, offset_col_um : Quantity or None
        The same [um]; None without a pixel pitch.
    curve : tuple of CurvePoint
        Radial distortion.
    coverage : Coverage
        Coverage of the frame by corners.
    points : tuple of Point
        Points of the fit.
    flags : tuple of Raised
        Flags of the fit.
    lateral_colour : tuple of LateralColour or None
        Displacement of red and blue against green; None where the pictures have no colours.
    """

    model: str
    target: Target
    corner_window: Window
    pixel_pitch_um: float | None
    camera: CameraModel
    coefficients: tuple[Coefficient, ...]
    covariance: tuple[tuple[float, ...], ...]
    rms_px: float
    views: int
    corners: int
    degrees_of_freedom: int
    principal_distance_mm: Quantity | None
    offset_row: Quantity
    offset_col: Quantity
    offset_row_um: Quantity | None
    offset_col_um: Quantity | None
    curve: tuple[CurvePoint, ...]
    coverage: Coverage
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]
    lateral_colour: tuple[LateralColour, ...] | None = field(default=None, metadata=LATER)
