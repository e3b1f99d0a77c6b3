"""Answers of the service, as frozen records.

A record names the fields that a caller works with; ``raw`` holds the whole answer, so that a field which the
service learnt yesterday is within reach today. Times are aware datetimes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from typing import Any, Final, NotRequired, Self, TypedDict, dataclass_transform, overload

DEFAULT_METHOD: Final = "luminance"  # of commands and calls that name none

_QUANTITY = {"value", "standard_uncertainty", "unit"}
_TIMES = frozenset(
    {
        *("at", "computed_at", "created_at", "ended_at", "expires_at", "last_used_at"),
        *("revoked_at", "started_at", "taken_at", "valid_from", "valid_to"),
    }
)


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A reported figure with its uncertainty and unit."""

    value: float
    standard_uncertainty: float
    unit: str


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
@dataclass(frozen=True, kw_only=True)
class Record:
    raw: dict[str, Any] = field(repr=False, compare=False)

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True)(cls)

    @classmethod
    def of(cls, answer: dict[str, Any]) -> Self:
        """Take what this record names out of an answer; what the answer leaves out keeps its default."""
        named = {f.name for f in fields(cls)} & answer.keys()
        known: dict[str, Any] = {name: _value(name, answer[name]) for name in named}
        return cls(**{**known, "raw": answer})


class Camera(Record):
    id: str
    make: str
    model: str
    serial: str


class Meter(Record):
    id: str
    kind: str
    make: str
    model: str
    serial: str


class Panel(Record):
    id: str
    serial: str
    measured_on: str


class Campaign(Record):
    id: str
    camera_id: str
    method: str
    kind: str = "calibration"  # or measurement: a night whose frames no fit uses
    project_number: str | None = None


class Reason(Record):
    """One thing to know about a frame; ``detail`` is a sentence with the numbers and what to do."""

    code: str
    outcome: str
    detail: str


class KnownFrame(Record):
    """A frame that a campaign has already, and what was said of it when it was sent."""

    sha256: str
    frame_id: str
    filename: str
    role: str
    state: str
    scene: str | None = None
    job_id: str = ""  # the newest that reads it


class Key(Record):
    """A key of the organisation; ``secret`` only in the answer that made it."""

    id: str
    name: str
    person: str | None = None  # who uses it, as certificates name them
    role: str | None = None
    scopes: tuple[str, ...]
    created_at: datetime
    expires_at: datetime | None = None
    last_used_at: datetime | None = None  # to ten minutes
    revoked_at: datetime | None = None
    secret: str | None = field(default=None, repr=False)

    @property
    def ended(self) -> bool:
        """Return True if it opens nothing any more."""
        return self.revoked_at is not None or (
            self.expires_at is not None and self.expires_at <= datetime.now(UTC)
        )

    @property
    def state(self) -> str:
        if self.revoked_at is not None:
            return f"revoked {self.revoked_at:%Y-%m-%d}"
        if self.expires_at is None:
            return "in force"
        return f"{'expired' if self.ended else 'expires'} {self.expires_at:%Y-%m-%d}"


class AuditEntry(Record):
    """One entry of the audit trail: who changed what, from what to what."""

    seq: int
    at: datetime
    actor: str  # id of a key, or worker, sweeper, service
    actor_name: str | None = None
    action: str
    subject_type: str
    subject_id: str
    subject_name: str | None = None
    before: dict[str, Any]
    after: dict[str, Any]


class AuditChain(Record):
    """State of the chain that the entries of an organisation form."""

    state: str  # intact | broken
    entries: int  # checked, and as they were
    head: str | None = None  # seq:sha256 of the last one, to be noted elsewhere
    broken_at: int | None = None
    detail: str | None = None


class OwnKey(Record):
    """The key that a client asks with."""

    id: str
    name: str
    person: str | None = None
    role: str | None = None
    scopes: tuple[str, ...]

    @property
    def organisation(self) -> str:
        return str(self.raw["organisation"]["name"])


class Frame(Record):
    id: str
    sha256: str
    filename: str
    state: str  # received | read | extracted | refused
    role: str = ""
    scene: str | None = None
    size_bytes: int | None = None
    job_id: str = ""  # the newest that reads it
    refusal: dict[str, Any] | None = None

    @property
    def outcome(self) -> str:
        """The verdict: pass, warn, fail or pending; pending too where the answer holds none."""
        return str(self.raw.get("verdict", {}).get("outcome", "pending"))

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """Why, the gravest first."""
        return tuple(Reason.of(each) for each in self.raw.get("verdict", {}).get("reasons", ()))


class Job(Record):
    id: str
    kind: str
    state: str  # queued | running | succeeded | failed | quarantined
    progress: float = 0.0
    attempt: int = 0
    error: dict[str, Any] | None = None
    result: dict[str, Any] | None = None


class Coefficient(Record):
    """One value with its standard uncertainty. The last fields say whence it came, where it was looked up."""

    name: str
    value: float
    standard_uncertainty: float
    unit: str
    iso: float | None = None
    f_number: float | None = None
    band: str | None = None
    channel: str | None = None
    model: str | None = None
    calibration_id: str | None = None
    version: int | None = None
    valid_from: datetime | None = None
    valid_to: datetime | None = None
    uncertainty_scope: str | None = None  # traceable | relative_only: holds for ratios alone
    flags: tuple[str, ...] = ()
    why: str | None = None


class Rig(Record):
    id: str
    name: str
    camera_ids: tuple[str, ...] = ()  # the reference first


class Calibration(Record):
    id: str
    method: str
    state: str  # draft | published | superseded | revoked
    version: int | None = None
    camera_id: str | None = None
    valid_from: datetime | None = None
    valid_to: datetime | None = None

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        return tuple(Coefficient.of(row) for row in self.raw.get("coefficients", ()))


class Measurement(Record):
    """A frame or an average, measured. ``raw`` also contains grid, percentiles, budget and flags."""

    id: str
    frame_id: str
    frame_ids: tuple[str, ...] = ()  # of an average
    filename: str
    camera_id: str
    region_origin: str = ""  # of mean, min, max and median: request | grid | frame | campaign | whole_frame
    mean: Quantity | None = None  # an undistorted picture has none
    min: Quantity | None = None  # an index has a mean alone
    max: Quantity | None = None
    median: Quantity | None = None
    l_av_cd_m2: Quantity | None = None
    u_o: Quantity | None = None
    illuminance: Quantity | None = None
    uncertainty_scope: str | None = None  # traceable | relative_only: holds for ratios alone
    created_at: datetime | None = None

    @property
    def flags(self) -> tuple[str, ...]:
        return tuple(raised["flag"] for raised in self.raw.get("flags", ()))


class Road(Record):
    """A road as it is stated. ``raw`` also contains site, requirement, frames, points, grid and results."""

    id: str
    name: str
    created_at: datetime | None = None


class RoadResult(Record):
    """An evaluation of a road. ``raw`` also contains figures, criteria, points and flags."""

    road_id: str
    number: int
    verdict: str  # conforms | does_not | not_decided | not_measured
    created_at: datetime | None = None


class Comparison(Record):
    """Difference of two measurements, new - old. ``raw`` also contains both sides, and the cells of grids."""

    difference: Quantity
    change: Quantity | None = None  # in %
    in_standard_uncertainties: float | None = None
    significant: bool
    said: str
    same_region: bool


def as_times(row: dict[str, Any]) -> dict[str, Any]:
    """A flat row with its times as datetimes."""
    return {name: _value(name, value) for name, value in row.items()}


def _value(name: str, value: object) -> object:
    if name in _TIMES and isinstance(value, str):
        return datetime.fromisoformat(value)
    if isinstance(value, dict) and value.keys() == _QUANTITY:
        return Quantity(**value)
    return tuple(value) if isinstance(value, list) else value


Polygon = Sequence[tuple[float, float]]
Moment = datetime | str


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
    lens: dict[str, str]  # make, model and serial, where it is not the one registered with the camera
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
    reason: NotRequired[str]


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
    reflectance_u_rel: float
    incidence_angle_deg: float
    index: str  # of reflectance: ndvi | ndre | gndvi | evi2 | savi, or a formula: (nir - red) / (nir + red)
    quantity: str  # of a band: reflectance | radiance
    light_source: str  # a name of the library, or a table: wavelength in nm and value
    spectral_mismatch_u_rel: float
    distance_m: float
    lens_focus: str  # surface | unchanged
    lamp_kind: str
    mains_frequency_hz: float
    lamp_modulation: float
    glare_share: float
    height_above_ground_m: float  # of a band: places its map on level ground
    ground_altitude_m: float  # in its place, in the height system of the file's altitude
    height_u_m: float
    allow: list[str]  # flags of a frame that else forbid to measure it: image_part_empty


@overload
def as_text(moment: Moment) -> str: ...
@overload
def as_text(moment: Moment | None) -> str | None: ...
def as_text(moment: Moment | None) -> str | None:
    """A time as the service reads it; a datetime without its zone could mean two moments and is refused."""
    if moment is None or isinstance(moment, str):
        return moment
    if getattr(moment, "tzinfo", None) is None:  # a plain day has none either
        raise ValueError(f"{moment!r} has no time zone")
    return moment.isoformat()
