"""What comes out of a geometry fit: plain numbers, ready for JSON; what does not exist is None."""

from dataclasses import dataclass

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity
from radiometry.geometry.camera import CameraModel
from radiometry.geometry.rows import Window
from radiometry.geometry.target import Target


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """One parameter of the camera; the standard uncertainty of one that was not free is 0."""

    name: str
    value: float
    standard_uncertainty: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class Point:
    """One picture in the fit. ``left_out`` is "" for one that was used, else the reason.

    ``rms_px``, ``largest_px`` : of the distances between its corners and the model; of a view that was
        rejected, against the camera that the others give
    ``tilt_deg`` : between the board's normal and the optical axis; ``distance_mm`` : of its first corner
    ``edge_rise_px`` : 10 to 90 % rise of the squares' edges
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
    """The radial distortion at one distance from the principal point; negative is towards it (barrel).

    ``ideal_radius_px`` : where a lens without distortion would show it; ``radius_px`` : where this one does
    ``distortion_px`` : the second less the first; ``distortion_um`` : None without a pixel pitch
    ``extrapolated`` : further out than any corner that was used
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
    """Where in the frame corners were seen.

    ``counts`` : corners in each cell of a grid, (row, col); ``share`` : of cells with a corner
    ``radius_share`` : of the way from the principal point to the farthest corner of the frame
    """

    counts: tuple[tuple[int, ...], ...]
    share: float
    radius_share: float


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A geometry calibration.

    ``coefficients`` : as `list_coefficients` gives them; ``covariance`` : (9, 9) of `camera.PARAMETERS`
    ``offset_row``, ``offset_col`` : of the principal point from the middle of the frame
    ``principal_distance_mm``, ``offset_*_um`` : None without a pixel pitch
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
