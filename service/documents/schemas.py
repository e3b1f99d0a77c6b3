"""The certificate of a calibration: everything that is handed out with it, in one document."""

from datetime import date
from typing import Any, Literal

from radiometry.fitting import evidence
from radiometry.specification.application import FoundBy
from radiometry.specification.method import Scope
from service.calibrations.schemas import Gap, PersonAnswer
from service.equipment.schemas import Certificate as MeterCertificate
from service.equipment.schemas import Lens
from service.http.models import Answer, Instant, Method, maybe, told
from store.queries.calibrations import VersionStatus
from store.tables import Camera, ChecklistSignature, Publication, Reading

DaysFrom = Literal["readings", "campaign", "frames"]


class Laboratory(Answer):
    name: str
    address: str | None = None


class Item(Answer, restates=Camera, fields="make model serial pixel_pitch_um sensor_width_mm"):
    lens: Lens | None = None


class Work(Answer):
    """Where, when, for whom and under which conditions the frames and readings were taken."""

    campaign_id: str
    project_number: str | None = None
    customer: str | None = None
    recorder: str | None = None
    place: str | None = None
    conditions: str | None = None
    started_at: Instant | None = None
    ended_at: Instant | None = None
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


class UsedPanelBand(Answer):
    band: str
    reflectance: float
    standard_uncertainty: float | None = None
    origin: Literal["file"] | None = None


class UsedPanel(Answer):
    """The panel that a reflectance was measured against, as it was measured on that day."""

    serial: str
    measured_on: date
    bands: list[UsedPanelBand]


class UsedReading(Answer, restates=Reading, fields="scene quantity value taken_at meter_id"):
    """``value`` in SI; the last two as the fit took them from the meter's certificate."""

    unit: str
    entered_value: float | None = None
    entered_unit: str | None = None
    meter: str | None = None
    expanded_uncertainty_rel: float | None = None
    coverage_factor: float | None = None


class UsedFrame(Answer):
    """``exposure`` : absent of a chart that states none; ``signal_dn`` : of luminance, from its channel."""

    id: str
    frame: str = told("Its name in the fit: the file's, where no two share one.")
    sha256: str
    size_bytes: int
    role: str
    scene: str | None = None
    exposure: dict[str, Any] | None = None
    taken_at: str | None = None
    clock_offset: str | None = maybe("From UTC, as stated for the clock where `taken_at` has none.")
    roi_sha256: str
    roi_origin: Literal["found"] | None = maybe(
        "The panel was found in the frame; absent where its region was drawn."
    )
    roi_found_by: FoundBy | None = None
    panel_serial: str | None = maybe("As the panel's code in the image states it.")
    warnings: list[str]
    signal_dn: float | None = None
    signal_standard_uncertainty_dn: float | None = None
    statistics: list[dict[str, Any]]


class Region(Answer):
    """``parts`` : name and points of each, where there are several; ``points`` are then those around them."""

    sha256: str
    points: list[Any]
    parts: list[Any] | None = None


class CertifiedCoefficient(
    Answer,
    restates=evidence.CoefficientValue,
    fields="name value standard_uncertainty unit iso f_number channel model",
):
    """A coefficient with its expanded uncertainty U = k u; what it does not depend on is absent.

    `effective_dof`: degrees of freedom from which k follows by the t distribution; absent where the method
    states none. What is `relative_only` has no U.
    """

    band: str | None = None
    uncertainty_scope: Scope | None = None
    expanded_uncertainty: float | None = None
    coverage_factor: float | None = None
    effective_dof: float | None = None
    flags: list[str]


class Budget(Answer, restates=evidence.CoefficientValue, fields="iso f_number band channel"):
    """Budget of the coefficient at an ISO value or f-number, of a band or channel."""

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
    evidence: str | None = maybe("What of the record ticks it automatically.")
    note: str | None = None


class Signature(Answer, restates=ChecklistSignature, fields="name signed_by signed_at"):
    pass


class Checklist(Answer):
    items: list[CheckedItem]
    signature: Signature | None = None


class Amended(Answer):
    """The certificate that this one amends; it is kept as it was issued."""

    amendment: int = told("Of this document, from 1 on.")
    number: str
    issued_at: Instant
    json_sha256: str


class Issued(Answer):
    """How the certificate was issued; a draft is not."""

    at: Instant
    at_upgrade: bool = told("Whether the version was published before certificates were kept as issued.")
    amends: Amended | None = None


class PublishedBy(Answer, restates=Publication, fields="valid_from valid_to"):
    by: str
    at: Instant
    reason: str


class Revoked(Answer):
    by: str
    at: Instant
    reason: str


class Validity(Answer, restates=VersionStatus, fields="state valid_from valid_to"):
    revoked: Revoked | None = None


class CertificateAnswer(Answer):
    """``result``: the fit as stored; frames, readings, regions and parameters reproduce it."""

    schema_version: int
    title: str
    number: str
    calibration_id: str
    content_sha256: str
    version: int
    method: Method
    procedure: str
    equation: str
    configuration: dict[str, Any] = told("What else it holds for: lens, sunshine sensor.")
    laboratory: Laboratory
    item: Item
    work: Work
    meters: list[UsedMeter]
    panels: list[UsedPanel]
    traceability: str
    uncertainty_scope: Scope | None = maybe(
        "`relative_only`: the error of the reference's scale is unknown. Absent where the method "
        "checks no certificate of a reference."
    )
    readings: list[UsedReading]
    regions: list[Region]
    frames: list[UsedFrame]
    target: dict[str, Any] | None = maybe("What the charts show.")
    parameters: dict[str, Any]
    result: dict[str, Any]
    coefficients: list[CertifiedCoefficient]
    budgets: list[Budget]
    vignetting: str = told("What the signals were corrected with.")
    falloff: list[dict[str, Any]] | None = maybe(
        "The vignetting version of a luminance K, with its coefficients."
    )
    flags: list[FlagInWords]
    flight: list[Instant] | None = maybe(
        "When the frames of the plot in time were taken: measured with the version, or to be."
    )
    checklist: Checklist
    software: dict[str, Any] = told(
        "The fit code version (`stilb`), the release (`release`) and the packages that fitted."
    )
    author: str = told("The person who fitted.")
    fitted_by: PersonAnswer | None = None
    approved_by: PersonAnswer | None = maybe("Who signs for it. Absent: a draft, or nobody has signed.")
    created_at: Instant
    issued: Issued | None = None
    published: list[PublishedBy] = told("The publication that it was issued with.")
    validity: Validity = told("As published; what was decided since stands with the version.")
    statements: list[str]
    gaps: list[Gap] = told("What ISO/IEC 17025, 7.8, asks for and is absent.", default=[])
