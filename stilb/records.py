"""Answers of the service, as frozen records.

A record names the fields that a caller works with; ``raw`` holds the whole answer, so that a field which the
service learnt yesterday is within reach today. Times are aware datetimes.
"""

from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from typing import Any, Self

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


@dataclass(frozen=True, kw_only=True)
class Record:
    raw: dict[str, Any] = field(repr=False, compare=False)

    @classmethod
    def of(cls, answer: dict[str, Any]) -> Self:
        """Take what this record names out of an answer; what the answer leaves out keeps its default."""
        named = {f.name for f in fields(cls)} & answer.keys()
        known: dict[str, Any] = {name: _value(name, answer[name]) for name in named}
        return cls(**{**known, "raw": answer})


@dataclass(frozen=True, kw_only=True)
class Camera(Record):
    id: str
    make: str
    model: str
    serial: str


@dataclass(frozen=True, kw_only=True)
class Meter(Record):
    id: str
    kind: str
    make: str
    model: str
    serial: str


@dataclass(frozen=True, kw_only=True)
class Panel(Record):
    id: str
    serial: str
    measured_on: str


@dataclass(frozen=True, kw_only=True)
class Campaign(Record):
    id: str
    camera_id: str
    method: str
    kind: str = "calibration"  # or measurement: a night whose frames no fit uses
    project_number: str | None = None


@dataclass(frozen=True, kw_only=True)
class Reason(Record):
    """One thing to know about a frame; ``detail`` is a sentence with the numbers and what to do."""

    code: str
    outcome: str
    detail: str


@dataclass(frozen=True, kw_only=True)
class KnownFrame(Record):
    """A frame that a campaign has already, and what was said of it when it was sent."""

    sha256: str
    frame_id: str
    filename: str
    role: str
    state: str
    scene: str | None = None
    job_id: str = ""  # the newest that reads it


@dataclass(frozen=True, kw_only=True)
class Finding(Record):
    """An entry of the registry: what a flag, a reason or a refusal means, and what to do about it."""

    code: str
    severity: str
    where: tuple[str, ...]
    sentence: str
    remedy: str


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
class Session(Record):
    """A browser that is signed in with a key."""

    id: str
    key_id: str
    key_name: str
    person: str | None = None  # of the key
    browser: str | None = None  # as it names itself
    created_at: datetime
    expires_at: datetime
    last_used_at: datetime | None = None


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
class AuditChain(Record):
    """State of the chain that the entries of an organisation form."""

    state: str  # intact | broken
    entries: int  # checked, and as they were
    head: str | None = None  # seq:sha256 of the last one, to be noted elsewhere
    broken_at: int | None = None
    detail: str | None = None


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
class Job(Record):
    id: str
    kind: str
    state: str  # queued | running | succeeded | failed | quarantined
    progress: float = 0.0
    attempt: int = 0
    error: dict[str, Any] | None = None
    result: dict[str, Any] | None = None


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
class Rig(Record):
    id: str
    name: str
    camera_ids: tuple[str, ...] = ()  # the reference first


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
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
