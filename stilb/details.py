"""Details of cameras, campaigns, readings and measurements that a caller states, as typed dictionaries."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any, NotRequired, TypedDict

Polygon = Sequence[tuple[float, float]]
Moment = datetime | str


class LensDetails(TypedDict, total=False):
    make: str
    model: str
    serial: str


class CameraDetails(TypedDict, total=False):
    lens: LensDetails
    pixel_pitch_um: float
    sensor_width_mm: float
    note: str


class CameraChange(CameraDetails, total=False):
    """Corrections of a camera."""

    make: str
    model: str
    serial: str


class Certificate(TypedDict):
    number: str
    laboratory: str
    issued_on: str
    due_on: str
    expanded_uncertainty_rel: float
    coverage_factor: float


class CampaignDetails(TypedDict, total=False):
    kind: str  # calibration, or measurement: a night whose frames no fit uses
    project_number: str
    recorder: str
    customer: str
    place: str
    conditions: str
    started_at: Moment
    ended_at: Moment
    time_zone: str  # of the camera's clock, for files without an offset: Europe/Berlin, or +02:00
    lens: LensDetails  # where it is not the one registered with the camera
    comments: str
    surface_reflectance: float
    lamp: str  # a name of the library, or a table: wavelength in nm and value
    camera_response: str  # likewise, with R, G and B
    focus_distance_m: float
    focal_length_mm: float
    lamp_kind: str  # incandescent | led | led_ripple | led_phase_dimmed | sodium | metal_halide
    mains_frequency_hz: float  # 0: direct current
    lamp_modulation: float
    acceptance: str  # simple | guarded | shared_risk
    panel_id: str  # of a reflectance campaign
    panel_serial: str  # in its place: a registered panel's, or that of the panel which the frames name
    target: dict[str, Any]  # what is photographed, as its method's page says


class CampaignChange(CampaignDetails, total=False):
    """Corrections; a text of "" is taken away."""

    camera_id: str  # every frame is checked against another camera; none is sent again
    archived: bool


class PersonDetails(TypedDict, total=False):
    """Person who uses a key, as certificates name who fitted and approved; a text of "" is taken away."""

    person: str
    role: str


class OrganisationChange(TypedDict, total=False):
    """Statements of an organisation; a text of "" is taken away."""

    name: str  # as certificates print it; it cannot be taken away
    address: str  # as certificates print it
    refuses_incomplete_certificates: bool
    time_zone: str  # of its cameras' clocks, for files without an offset: Europe/Berlin, or +02:00


class PanelBand(TypedDict):
    """Reflectance of a panel in a band, 0..1; the uncertainty absolute, k = 1."""

    band: str
    reflectance: float
    standard_uncertainty: NotRequired[float]
    origin: NotRequired[str | None]


class Reading(TypedDict):
    """One meter reading of one scene, as it is sent and as it comes back."""

    scene: str
    quantity: str
    value: float
    unit: str
    meter_id: NotRequired[str]
    taken_at: NotRequired[str]


class Grid(TypedDict):
    """Equal cells of a rectangular surface, by the image [x, y] of its corners as the surface runs.

    Either ``rows`` and ``columns``, or ``lanes``, ``lane_width_m`` and ``spacing_m``: EN 13201-3's points.
    """

    corners: Sequence[tuple[float, float]]
    rows: NotRequired[int]
    columns: NotRequired[int]
    lanes: NotRequired[int]
    lane_width_m: NotRequired[float]
    spacing_m: NotRequired[float]  # of the luminaires
    length_m: NotRequired[float]  # of the rectangle, where it is not the spacing
    corner_u_px: NotRequired[float]


class MeasureDetails(TypedDict, total=False):
    """How to measure; what is left out is taken from the frame, its campaign and what is in force."""

    calibration_id: str
    polygon: Polygon
    grid: Grid
    reflectance: float
    incidence_angle_deg: float
    index: str  # of reflectance: ndvi | ndre | gndvi | evi2 | savi, or a formula: (nir - red) / (nir + red)
    quantity: str  # of a band: reflectance | radiance
    light_source: str  # a name of the library, or a table: wavelength in nm and value
    spectral_mismatch_u_rel: float
    distance_m: float
    lamp_kind: str
    mains_frequency_hz: float
    lamp_modulation: float
    flicker_modulation: float  # older name of lamp_modulation
    glare_share: float
    height_above_ground_m: float  # of a band: places its map on level ground
    ground_altitude_m: float  # in its place, in the height system of the file's altitude
    height_u_m: float
    allow: list[str]  # flags of a frame that else forbid to measure it: image_part_empty


def as_text(moment: Moment) -> str:
    """A time as the service reads it; a datetime without its zone could mean two moments and is refused."""
    if isinstance(moment, str):
        return moment
    if moment.tzinfo is None:
        raise ValueError(f"{moment!r} has no time zone")
    return moment.isoformat()
