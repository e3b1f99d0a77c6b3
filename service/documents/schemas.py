"""The certificate of a calibration: everything that is handed out with it, and what it lacks."""

from collections.abc import Iterator
from datetime import date
from typing import Any, Literal

from radiometry.findings import interface
from radiometry.fitting import evidence
from radiometry.methods import findings, get_method
from radiometry.specification.application import FoundBy
from radiometry.specification.method import Scope
from service.calibrations.schemas import Gap, PersonAnswer
from service.equipment.schemas import Certificate as MeterCertificate
from service.equipment.schemas import Lens
from service.http.models import Answer, Instant, Method, maybe, told
from store import tables
from store.queries import calibrations, organisations
from store.queries.checklist import ChecklistItem

DaysFrom = Literal["readings", "campaign", "frames"]


class Laboratory(Answer):
    name: str
    address: str | None = None


class Item(Answer, restates=tables.Camera, fields="make model serial pixel_pitch_um sensor_width_mm"):
    lens: Lens | None = None


class Work(
    Answer, restates=tables.Campaign, fields="project_number started_at ended_at comments surface_reflectance"
):
    """Where, when, for whom and under which conditions the frames and readings were taken."""

    campaign_id: str
    customer: str | None = None
    recorder: str | None = None
    place: str | None = None
    conditions: str | None = None
    first_day: date | None = None
    last_day: date | None = None
    days_from: DaysFrom | None = None


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


class UsedReading(Answer, restates=tables.Reading, fields="scene quantity value taken_at meter_id"):
    """``value`` in SI; the last two as the fit took them from the meter's certificate."""

    unit: str
    entered_value: float | None = None
    entered_unit: str | None = None
    meter: str | None = None
    expanded_uncertainty_rel: float | None = None
    coverage_factor: float | None = None


class UsedFrame(Answer, restates=tables.FrameRow, fields="id sha256 role scene exposure"):
    """``exposure`` : absent of a chart that states none; ``signal_dn`` : of luminance, from its channel."""

    frame: str = told("Its name in the fit: the file's, where no two share one.")
    size_bytes: int
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


class Region(Answer, restates=tables.Roi, fields="sha256 points parts"):
    """``parts`` : name and points of each, where there are several; ``points`` are then those around them."""


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


class CheckedItem(Answer, restates=ChecklistItem, fields="key section text done_at evidence note"):
    done_by: str | None = None


class Signature(Answer, restates=tables.ChecklistSignature, fields="name signed_by signed_at"):
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


class PublishedBy(Answer, restates=tables.Publication, fields="valid_from valid_to"):
    by: str
    at: Instant
    reason: str


class Revoked(Answer):
    by: str
    at: Instant
    reason: str


class Validity(Answer, restates=calibrations.VersionStatus, fields="state valid_from valid_to"):
    revoked: Revoked | None = None


class CertificateAnswer(
    Answer, restates=tables.Calibration, fields="content_sha256 version parameters result software created_at"
):
    """``result``: the fit as stored; frames, readings, regions and parameters reproduce it."""

    schema_version: int
    title: str
    number: str
    calibration_id: str
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
    author: str = told("The person who fitted.")
    fitted_by: PersonAnswer | None = None
    approved_by: PersonAnswer | None = maybe("Who signs for it. Absent: a draft, or nobody has signed.")
    issued: Issued | None = None
    published: list[PublishedBy] = told("The publication that it was issued with.")
    validity: Validity = told("As published; what was decided since stands with the version.")
    statements: list[str]
    gaps: list[Gap] = told("What ISO/IEC 17025, 7.8, asks for and is absent.", default=[])


def list_gaps(certificate: CertificateAnswer) -> list[Gap]:
    """Return every item of ISO/IEC 17025:2017, 7.8, that a certificate lacks, in the order of its pages."""
    return [
        *_unnamed(certificate),
        *(found for meter in certificate.meters for found in _of_meter(meter)),
        *_of_readings(certificate),
        *_of_panels(certificate),
        *_of_checklist(certificate),
    ]


def _unnamed(certificate: CertificateAnswer) -> Iterator[Gap]:
    """Check 7.8.2.1 b, c, e, g, i, o and 7.8.4.1 b: the items that a person has to enter."""
    work = certificate.work
    lens = certificate.item.lens or not get_method(certificate.method).certificate.holds_for_lens or None
    name = certificate.laboratory.name
    for value, code in (
        (certificate.approved_by if certificate.published else "a draft", interface.APPROVER_MISSING),
        (certificate.fitted_by, interface.AUTHOR_MISSING),
        (None if name == organisations.UNNAMED_LABORATORY else name, interface.LABORATORY_NAME_MISSING),
        (certificate.laboratory.address, interface.LABORATORY_ADDRESS_MISSING),
        (work.customer, interface.CUSTOMER_MISSING),
        (work.place, interface.PLACE_MISSING),
        (work.conditions, interface.CONDITIONS_MISSING),
        (work.first_day, interface.DATE_MISSING),
        (work.recorder, interface.RECORDER_MISSING),
        (lens, interface.LENS_MISSING),
    ):
        if value is None:
            yield Gap(code=code, message=f"{code.sentence} {code.remedy}")


def _of_meter(meter: UsedMeter) -> Iterator[Gap]:
    """Check 7.8.4.1 c: the meter had a valid certificate on the day of use."""
    name = f"The {meter.kind} meter {meter.make} {meter.model}, serial number {meter.serial},"
    if (certificate := meter.certificate) is None:
        yield Gap(
            code=findings.FINDINGS["meter_certificate_missing"],
            message=f"{name} has no certificate. Register the meter with its certificate, then refit.",
        )
        return
    if meter.last_day and certificate.due_on < meter.last_day:
        yield Gap(
            code=interface.METER_CERTIFICATE_EXPIRED,
            message=f"{name} was read on {meter.last_day}, after its certificate {certificate.number} "
            f"was due on {certificate.due_on}.",
        )
    if meter.first_day and meter.first_day < certificate.issued_on:
        yield Gap(
            code=interface.METER_CERTIFICATE_NOT_YET_ISSUED,
            message=f"{name} was read on {meter.first_day}, before its certificate {certificate.number} "
            f"was issued on {certificate.issued_on}.",
        )


def _of_readings(certificate: CertificateAnswer) -> Iterator[Gap]:
    if unknown := [reading for reading in certificate.readings if reading.meter is None]:
        yield Gap(
            code=interface.METER_UNKNOWN,
            message=f"{len(unknown)} of {len(certificate.readings)} readings have no meter. "
            "Choose the meter of each reading on the campaign.",
        )


def _of_panels(certificate: CertificateAnswer) -> Iterator[Gap]:
    """Check 7.8.4.1 c: the panel that the reflectances depend on."""
    if get_method(certificate.method).reference != "panel":
        return
    if not certificate.panels:
        yield Gap(
            code=findings.FINDINGS["panel_unknown"],
            message="The panel is not registered, and its reflectance was taken from the files. Choose "
            "or register it on the page of the campaign, then refit.",
        )
    fitted = {coefficient.band for coefficient in certificate.coefficients}
    for panel in certificate.panels:
        bands = [each.band for each in panel.bands if each.band in fitted and not each.standard_uncertainty]
        if bands:
            yield Gap(
                code=findings.FINDINGS["panel_uncertainty_missing"],
                message=f"The reflectance of panel {panel.serial} has no standard uncertainty in "
                f"{', '.join(bands)}. Send the panel as measured, with its standard_uncertainty, then refit.",
            )


def _of_checklist(certificate: CertificateAnswer) -> Iterator[Gap]:
    """Check 7.8.2.1 n and o: open items of the checklist, and its signature."""
    if not (items := certificate.checklist.items):
        return  # only the luminance procedure has one
    if waiting := sum(item.done_by is None for item in items):
        yield Gap(
            code=interface.CHECKLIST_INCOMPLETE,
            message=f"{waiting} of {len(items)} items of the procedure's checklist are not ticked.",
        )
    if certificate.checklist.signature is None:
        yield Gap(
            code=interface.CHECKLIST_UNSIGNED,
            message="The operator has not signed the procedure's checklist.",
        )
