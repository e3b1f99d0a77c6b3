"""Parameters and results of a fit, ready for JSON; what does not exist is None."""

from dataclasses import dataclass, field
from typing import Any, Final, Literal

from radiometry.findings import Raised
from radiometry.fitting.evidence import Exclusion, FrameEvidence, Quantity
from radiometry.geometry.camera import CameraModel
from radiometry.geometry.features import Features, LateralColour
from radiometry.geometry.target import Target
from radiometry.specification.certificate import KeyFigure, of_quantity
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.specification.stored import LATER, meaning

CHART: Final = "chart"
Window = Literal["fixed", "fitted"]
RadialTerms = Literal[0, 1, 2, 3]

FrameRow = FrameEvidence[Features]


@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of a geometry fit."""

    pixel_pitch_um: float | None = parameter(
        None,
        label="Pixel pitch",
        description="Distance of neighbouring pixels; without it nothing is reported in millimetres and "
        "micrometres.",
        unit="um",
        default_text="the camera's, where it is registered",
        example=3.28,
        bounds="[0.1, 100]",
    )
    corner_window: Window = parameter(
        "fixed",
        label="Window of the corner search",
        description="For a checkerboard: fixed as OpenCV's own sample places corners, or fitted to keep "
        "clear of neighbours where they are closer than 28 pixels.",
        labels={"fixed": "Fixed", "fitted": "Fitted to the spacing"},
    )
    fix_aspect_ratio: bool = parameter(
        default=True,
        label="Square pixels",
        description="fx = fy; if free, the two differ by their noise.",
    )
    radial_terms: RadialTerms = parameter(
        3,
        label="Radial terms",
        description="How many of k1, k2, k3 are free; the others are 0.",
        labels={0: "None", 1: "k1", 2: "k1, k2", 3: "k1, k2, k3"},
    )
    tangential: bool = parameter(
        default=True,
        label="Tangential terms",
        description="p1 and p2 are free; otherwise they are 0.",
    )
    reject_above_px: float | None = parameter(
        2.0,
        label="Rejection limit of a view",
        description="A view with a larger rms residual is rejected, the worst first, and the others are "
        "fitted again; `none` keeps every view.",
        unit="px",
        none_allowed=True,
        bounds="(0, 1000]",
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Check every parameter against its range and choices."""
        check_parameters(self)


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """One parameter of the camera; the standard uncertainty of one that was not free is 0."""

    name: str
    value: float
    standard_uncertainty: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class Point:
    """One picture in the fit."""

    frame: str
    used: bool = field(metadata=meaning("True if the fit used it."))
    left_out: str = field(metadata=meaning('"" for one that was used, else the reason.'))
    corners: int = field(metadata=meaning("Number of corners."))
    rms_px: float | None = field(
        default=None,
        metadata=meaning(
            "Rms and largest of the distances between its corners and the model [px]; for a view that was "
            "rejected, from the camera that the others determine."
        ),
    )
    largest_px: float | None = field(
        default=None,
        metadata=meaning(
            "Rms and largest of the distances between its corners and the model [px]; for a view that was "
            "rejected, from the camera that the others determine."
        ),
    )
    tilt_deg: float | None = field(
        default=None, metadata=meaning("Angle between the board's normal and the optical axis [deg].")
    )
    distance_mm: float | None = field(default=None, metadata=meaning("Distance of its first corner [mm]."))
    spacing_px: float | None = field(
        default=None, metadata=meaning("Shortest distance between neighbouring corners [px].")
    )
    edge_rise_px: float | None = field(
        default=None, metadata=meaning("10 to 90 % rise of the squares' edges [px].")
    )


@dataclass(frozen=True, kw_only=True)
class CurvePoint:
    """Radial distortion at one distance from the principal point; negative is towards it (barrel)."""

    radius_px: float = field(metadata=meaning("Radius at which this lens shows it [px]."))
    ideal_radius_px: float = field(
        metadata=meaning("Radius at which a lens without distortion would show it [px].")
    )
    distortion_px: float = field(metadata=meaning("`radius_px` less `ideal_radius_px` [px]."))
    standard_uncertainty_px: float
    distortion_um: float | None = field(metadata=meaning("The same [um]; None without a pixel pitch."))
    standard_uncertainty_um: float | None
    extrapolated: bool = field(metadata=meaning("True if further out than any corner that was used."))


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Coverage of the frame by corners."""

    counts: tuple[tuple[int, ...], ...] = field(
        metadata=meaning("Corners in each cell of a grid, (row, col).")
    )
    share: float = field(metadata=meaning("Fraction of cells with a corner."))
    radius_share: float = field(
        metadata=meaning(
            "Covered fraction of the distance from the principal point to the farthest corner of the frame."
        )
    )


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Geometry calibration."""

    model: str
    target: Target = field(metadata=meaning("Board that was photographed."))
    corner_window: Window = field(metadata=meaning("Window in which corners were placed."))
    pixel_pitch_um: float | None = field(
        metadata=meaning("Distance of neighbouring pixels [um]; None if unknown.")
    )
    camera: CameraModel
    coefficients: tuple[Coefficient, ...] = field(
        metadata=meaning("Coefficients of which `list_coefficients` returns the values.")
    )
    covariance: tuple[tuple[float, ...], ...] = field(
        metadata=meaning("Covariance of `camera.PARAMETERS`, (9, 9).")
    )
    rms_px: float = field(metadata=meaning("Rms residual [px]."))
    views: int = field(metadata=meaning("Number of views and of corners."))
    corners: int = field(metadata=meaning("Number of views and of corners."))
    degrees_of_freedom: int
    principal_distance_mm: Quantity | None = field(
        metadata=meaning("Principal distance [mm]; None without a pixel pitch.")
    )
    offset_row: Quantity = field(
        metadata=meaning("Offset of the principal point from the middle of the frame.")
    )
    offset_col: Quantity = field(
        metadata=meaning("Offset of the principal point from the middle of the frame.")
    )
    offset_row_um: Quantity | None = field(metadata=meaning("The same [um]; None without a pixel pitch."))
    offset_col_um: Quantity | None = field(metadata=meaning("The same [um]; None without a pixel pitch."))
    curve: tuple[CurvePoint, ...] = field(metadata=meaning("Radial distortion."))
    coverage: Coverage = field(metadata=meaning("Coverage of the frame by corners."))
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]
    lateral_colour: tuple[LateralColour, ...] | None = field(
        default=None,
        metadata=meaning(
            "Displacement of red and blue against green; None where the pictures have no colours."
        )
        | LATER,
    )


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    """Return the focal length, in mm where the pixel pitch is known, and the principal point."""
    named = {each["name"]: each for each in result["coefficients"]}
    focal = result.get("principal_distance_mm") or named["fx_px"]
    return (
        *of_quantity("Lens", "Focal length", focal),
        *of_quantity("Principal point", "Column", named.get("cx_px")),
        *of_quantity("Principal point", "Row", named.get("cy_px")),
        *of_quantity("All views", "Error of a corner, rms", named.get("rms_px")),
    )
