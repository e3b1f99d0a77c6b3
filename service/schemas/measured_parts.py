"""Parts of a measurement's answer."""

from typing import Literal

from pydantic import Field

from radiometry.fitting.evidence import FieldCorrection
from radiometry.frame.multispectral import Alignment, LightBasis
from radiometry.frame.place import Place, PlaceShare
from service.schemas.base import Answer, Quantity


class CalibrationUsed(Answer):
    id: str
    version: int
    why: str
    state: Literal["draft", "published", "superseded", "revoked"] = Field(description="As it stands now.")
    superseded_by: str | None = None
    revoked_reason: str | None = None


class FlagAnswer(Answer):
    flag: str
    where: str = Field(description='"" for the whole, "grid" for its cells, "min" for dark parts.')
    detail: str


class BudgetRow(Answer):
    """One source's share of the mean's uncertainty, in the unit of the mean."""

    source: str
    shared: bool = Field(description="The same error in every pixel: no mean over pixels reduces it.")
    standard_uncertainty_cd_m2: float | None = Field(default=None, description="Of a luminance.")
    standard_uncertainty: float | None = Field(default=None, description="Of a reflectance.")
    variance_share: float


class CorrectionAnswer(Answer, restates=FieldCorrection):
    """An error of the field: L = factor * L_shown - offset, and what is left of it in the budget."""


class ReflectedAnswer(Answer):
    """How a band's reflectance came about: R = K I_sq / (I_ss cos(incidence))."""

    band: str
    i_sq: float
    i_ss: float | None = Field(
        default=None, description="On a level surface wherever the file allows; none of a panel-only K."
    )
    i_ss_oriented: float | None = Field(default=None, description="As the sensor was oriented.")
    i_ss_basis: LightBasis | None = Field(
        default=None,
        description="What `i_ss` is: `levelled` here, `horizontal` or `compensated` by the camera, or "
        "`oriented` as the sensor was.",
    )
    reflectance_k: float = Field(description="At the time of the frame.")
    incidence_angle_deg: float
    shared_u: float = Field(description="The part of the mean's uncertainty that all pixels share.")
    noise_u: float = Field(description="The part that is the mean's own noise.")
    below_zero_share: float = Field(description="Of the region's pixels; nothing is clipped.")
    above_one_share: float


class BandAnswer(Answer):
    band: str
    i_sq: float
    i_ss: float | None = None
    i_ss_oriented: float | None = None
    i_ss_basis: LightBasis | None = None
    reflectance_k: float
    reflectance: Quantity


class IndexAnswer(Answer):
    """An index of the region's mean reflectances, that of the first band first."""

    name: str = Field(description="Name of the index, or its formula.")
    formula: str | None = Field(default=None, description="Absent of measurements of older releases.")
    bands: list[BandAnswer]


class AlignmentAnswer(Answer, restates=Alignment):
    """How a band was aligned onto the pixels of the measurement's frame."""


class PlaceShareAnswer(Answer, restates=PlaceShare):
    """One source's share of the uncertainty of a place."""


class PlaceAnswer(Answer, restates=Place, without="tie_points corners transform"):
    """Where the pixels of `map.tif` lie on level ground, as its GeoTIFF tags state it."""

    transform: list[float] | None = Field(
        default=None,
        description="[a, b, c, d, e, f] of longitude = a + b col + c row and latitude = d + e col + f row "
        "[deg], counted from the outer corner of the first pixel, as GDAL does.",
    )
    corners: list[list[float]] = Field(
        default=[],
        description="[longitude, latitude] of the frame's corners: top-left, top-right, bottom-right, "
        "bottom-left.",
    )
    budget: list[PlaceShareAnswer] = Field(default=[], description="Sources of the uncertainty.")


class UndistortedAnswer(Answer):
    """Content of `map.tif`: the whole picture as a lens without distortion would have taken it."""

    planes: list[str] = Field(
        description="`grey`: around each pixel of a mosaic its pattern's four sites weigh a quarter each; "
        "`R`, `G`, `B` of a rendered picture."
    )
    linear: bool = Field(
        description="Raw numbers [DN], black included; false: with the picture's tone curve."
    )
    height_px: int
    width_px: int
    seen_share: float = Field(description="Of the pixels that the camera saw; the others are 0.")
    parameters: dict[str, Quantity] = Field(description="The camera's, in OpenCV's notation.")


class MapCounts(Answer):
    """Counts of all pixels of the map: how many leave [0, 1], are saturated, or have no index."""

    pixels: int
    below_zero: int | None = None
    above_one: int | None = None
    saturated: int | None = None
    undefined: int | None = None


class PercentileAnswer(Answer):
    percent: int
    luminance: Quantity | None = None
    reflectance: Quantity | None = None


class LanesAnswer(Answer):
    """Lanes between two luminaires; the points of EN 13201-3 are the centres of the cells."""

    lanes: int
    lane_width_m: float
    spacing_m: float
    length_m: float
    marked: list[list[float]] = Field(description="Corners of the rectangle as they were given [px].")
    corner_u_px: float
    along_m: float = Field(description="Distance of the points along the lanes.")
    across_m: float
    points_m: list[list[list[float]]] = Field(
        description="[x, y] of each point along and across from the first corner, row by row."
    )
    point_u_m: float = Field(
        description="Largest standard uncertainty of a point's place on the road from that of the corners."
    )


class GridAnswer(Answer):
    """The cells as the surface runs, row by row."""

    corners: list[list[float]]
    rows: int
    columns: int
    corner_u_px: float | None = Field(
        default=None,
        description="Standard uncertainty of each coordinate of a corner, whose effect is part of the cells' "
        "uncertainties; absent of measurements of older releases, where it is not.",
    )
    cell_model: str = Field(description="`projective`: equal cells of the surface, not of its image.")
    cells: list[list[Quantity]]
    lanes: LanesAnswer | None = None
