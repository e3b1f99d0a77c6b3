"""The certificate of a calibration: everything that is handed out with it, in one document."""

from datetime import date
from typing import Any, Literal

from pydantic import ConfigDict, Field

from service.schemas.base import Answer, Instant
from service.schemas.calibrations import Gap, State
from service.schemas.equipment import Certificate as MeterCertificate
from service.schemas.equipment import Lens

DaysFrom = Literal["readings", "campaign", "frames"]


class Laboratory(Answer):
    name: str
    address: str | None = None


class Item(Answer):
    make: str
    model: str
    serial: str
    lens: Lens | None = None
    pixel_pitch_um: float | None = None
    sensor_width_mm: float | None = None


class Work(Answer):
    """Where, when, for whom and under which conditions the frames and readings were taken."""

    campaign_id: str
    project_number: str | None = None
    customer: str | None = None
    recorder: str | None = None
    place: str | None = None
    conditions: str | None = None
    started_at: Instant | None = None
    first_day: date | None = None
    last_day: date | None = None
    days_from: DaysFrom | None = None
    comments: str | None = None
    surface_reflectance: float | None = None


class UsedMeter(Answer):
    id: str
    kind: str
    make: str
    model: str
    serial: str
    certificate: MeterCertificate | None = None
    readings: int
    first_day: date | None = None
    last_day: date | None = None


class UsedReading(Answer):
    """``value`` in SI; the last two as the fit took them from the meter's certificate."""

    scene: str
    quantity: str
    value: float
    unit: str
    entered_value: float | None = None
    entered_unit: str | None = None
    taken_at: Instant | None = None
    meter: str | None = None
    meter_id: str | None = None
    expanded_uncertainty_rel: float | None = None
    coverage_factor: float | None = None


class UsedFrame(Answer):
    id: str
    frame: str = Field(description="Its name in the fit: the file's, where no two share one.")
    sha256: str
    size_bytes: int
    role: str
    scene: str | None = None
    exposure: dict[str, Any]
    taken_at: str | None = None
    roi_sha256: str
    warnings: list[str]
    signal_dn: float
    signal_standard_uncertainty_dn: float
    statistics: list[dict[str, Any]]


class Region(Answer):
    sha256: str
    points: list[Any]


class Budget(Answer):
    iso: float
    lines: list[dict[str, Any]]


class FlagInWords(Answer):
    flag: str
    where: str
    meaning: str
    detail: str


class CheckedItem(Answer):
    key: str
    section: str
    text: str
    done_by: str | None = None
    done_at: Instant | None = None
    evidence: str | None = Field(default=None, description="What of the record ticks it by itself.")
    note: str | None = None


class Signature(Answer):
    name: str
    signed_by: str
    signed_at: Instant


class Checklist(Answer):
    items: list[CheckedItem]
    signature: Signature | None = None


class PublishedBy(Answer):
    by: str
    at: Instant
    valid_from: Instant
    valid_to: Instant | None = None
    reason: str


class Revoked(Answer):
    by: str
    at: Instant
    reason: str


class Validity(Answer):
    state: State
    valid_from: Instant | None = None
    valid_to: Instant | None = None
    superseded_by: str | None = None
    revoked: Revoked | None = None


_EXAMPLE: dict[str, Any] = {
    "schema_version": 1,
    "title": "Certificate of calibration",
    "number": "0K1XE8-luminance-1",
    "calibration_id": "cal_1",
    "content_sha256": "0" * 64,
    "version": 1,
    "method": "luminance",
    "procedure": "Luminance coefficient of a camera against a luminance meter",
    "equation": "N - D = K X,  X = t S L / f^2",
    "laboratory": {"name": "City of Lansing"},
    "item": {"make": "DJI", "model": "FC6520", "serial": "0K1XE8"},
    "work": {"campaign_id": "cmp_1"},
    "meters": [],
    "traceability": "No meter of these readings has a certificate.",
    "readings": [],
    "regions": [],
    "frames": [],
    "parameters": {},
    "result": {},
    "budgets": [],
    "vignetting": "none",
    "flags": [],
    "checklist": {"items": []},
    "software": {"stilb": "0.1.0"},
    "author": "field team",
    "created_at": "2026-05-01T08:00:00Z",
    "published": [],
    "validity": {"state": "draft"},
    "statements": ["It relates only to the item named above."],
    "gaps": [{"code": "place_missing", "message": "The place of the measurements is not named."}],
}


class CertificateAnswer(Answer):
    """``result``: the fit as stored; frames, readings, regions and parameters give it anew."""

    model_config = ConfigDict(json_schema_extra={"examples": [_EXAMPLE]})

    schema_version: int
    title: str
    number: str
    calibration_id: str
    content_sha256: str
    version: int
    method: str
    procedure: str
    equation: str
    laboratory: Laboratory
    item: Item
    work: Work
    meters: list[UsedMeter]
    traceability: str
    readings: list[UsedReading]
    regions: list[Region]
    frames: list[UsedFrame]
    parameters: dict[str, Any]
    result: dict[str, Any]
    budgets: list[Budget]
    vignetting: str
    flags: list[FlagInWords]
    checklist: Checklist
    software: dict[str, Any]
    author: str
    created_at: Instant
    published: list[PublishedBy]
    validity: Validity
    statements: list[str]
    gaps: list[Gap] = Field(default=[], description="What ISO/IEC 17025, 7.8, asks for and is absent.")
