"""Application of a version to later frames, by what a measurement makes of a frame.

Store and worker choose the way of a measurement by the class of the application. Each field that is callable
is the function of that name in the method's package, where it is documented.
"""

from collections.abc import Callable, Mapping
from typing import Any, Literal, Protocol

from radiometry.frame.roi import Polygon
from radiometry.records import Record

Function = Callable[..., Any]
# How a panel was found: by its code, by the camera's own statement, or in another band of the capture
FoundBy = Literal["code", "reflect_area", "other_band"]


class FoundRegion(Protocol):
    """Region or serial number, or both, that a method found in a frame automatically."""

    @property
    def region(self) -> Polygon | None:
        """Region in the frame [px]; None if none is certain."""

    @property
    def serial(self) -> str | None:
        """Serial number of what was found; None if it was not read in the image."""

    @property
    def by(self) -> FoundBy:
        """How it was found."""

    def read_albedo(self, wavelength_nm: float | None) -> float | None:
        """Return the reflectance that was read with the serial number; None if there was none."""


class Correction(Record):
    """Correction of the signals of another method by a version of this one."""

    lens: Function  #: `(*, coefficients, f_number)`, the correction at an f-number
    #: `(coefficients, polygon, *, channels, f_number) -> Quantity`, the divisor of a region's signal
    average_over_polygon: Function


class Summary(Record):
    """A stored result of a measurement in the words and figures that answers, series and comparisons need."""

    signal: str  # The channel, the band, the index or the planes
    measured: str  # What was measured: only the same can be compared
    figures: Mapping[str, Any]  # By the names of the answer
    column: str | None  # What its columns in a series are named after; None has none
    vignetting: str = "file"  # What vignetting was corrected with


class Application(Record):
    """Application of a version of a method to a later frame."""

    summarise: Callable[[Mapping[str, Any]], Summary]
    quantity: str  # Quantity of the map that is made of a frame, and its unit
    unit: str
    # Options of a measurement that this method takes, beside region and products
    options: tuple[str, ...] = ()
    # Frozen dataclass of what a measurement states of its surroundings, each field a parameter
    conditions: type[Any] | None = None
    needs_exposure: bool = True  # True if a frame without exposure cannot be measured


class SurfaceApplication(Application):
    """Measurement of a lit surface: a region, the cells of a grid, and a map of one scale."""

    name_channels: Function
    choose_coefficient: Function
    request: Function
    correction: Function
    outline: Function
    #: `(grid, *, height_px, width_px) -> flags`, what is wrong with a grid before it is measured
    check_grid: Function
    find_window: Function
    find_map_scale: Function
    needs_scale: Function
    measure: Function
    compute_map: Function
    change: Function
    #: `(coefficients, *, iso) -> float`, the standard uncertainty of the headline coefficient at an f-number
    #: that was not calibrated, in its unit
    foresee: Function
    unforeseen: str  #: Code of the flag of such an f-number
    rim_px: int  #: Pixels around a block that `compute_map` needs


class BandApplication(Application):
    """Measurement of one band of a capture, or of an index of its bands."""

    read_formula: Function
    align_band: Function
    flag_alignment: Function
    move_regions: Function
    displace_region: Function
    find_scale_of_frame: Function
    extract_features: Function
    apply: Function
    measure_region: Function
    measure_index: Function
    band_map: Function
    compute_index: Function
    map_uncertainty: Function
    radiance_unit: str  #: Unit of a band's radiance
    require_radiance: Function
    measure_radiance: Function
    scale_pixels: Function
    find_place: Function  #: `(header, conditions) -> Place`, where the pixels of a frame lie on the ground
    change: Function


class PictureApplication(Application):
    """A whole frame as another camera would have taken it; nothing is measured in it."""

    require_size: Function
    undistort_frame: Function
    needs_exposure: bool = False
