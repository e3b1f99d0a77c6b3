"""The certificate of a version, built from its record, and what it lacks. No value is changed here."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import date
from typing import Any

from radiometry.findings import Finding, interface
from radiometry.fitting.evidence import CoefficientValue
from radiometry.frame.statistics import ChannelStatistics, measure_signal
from radiometry.methods import get_method
from radiometry.methods.findings import FINDINGS
from radiometry.records import Record
from radiometry.specification.method import MethodSpec, Scope
from service.calibrations.schemas import Gap, PersonAnswer
from service.documents.schemas import (
    Amended,
    Budget,
    CertificateAnswer,
    CertifiedCoefficient,
    CheckedItem,
    Checklist,
    DaysFrom,
    FlagInWords,
    Issued,
    Item,
    Laboratory,
    PublishedBy,
    Region,
    Revoked,
    Signature,
    UsedFrame,
    UsedMeter,
    UsedPanel,
    UsedReading,
    Validity,
    Work,
)
from service.equipment.schemas import CameraAnswer
from service.http.models import rfc3339
from store.codec import drop_absent, encode_statistics
from store.queries.calibration_record import CalibrationRecord, state_budgets, state_coefficients
from store.queries.organisations import UNNAMED_LABORATORY, Person, name_laboratory
from store.tables import Calibration

_RELATES = (
    "This certificate relates only to the item named on it, in the state in which it was calibrated, and "
    "within the range of validity stated."
)
_EXPANDED = (
    "Each expanded uncertainty is the standard uncertainty multiplied by the coverage factor k, which is "
    "taken from the t distribution with the effective degrees of freedom for a coverage probability of "
    "about 95 %. Uncertainties are evaluated according to JCGM 100:2008."
)
_UNCORRECTED = (
    "No vignetting correction was applied. The coefficient is valid for the region in which it was "
    "determined."
)
_SUFFICE = (
    "The frames, readings, regions and parameters listed here are sufficient to recompute every value. Each "
    "frame is identified by its SHA-256."
)
_RELATIVE = (
    "Relative only. Traceability is not demonstrated: not every luminance meter of these readings is "
    "registered with a certificate. K and its standard uncertainty u(K) are valid for ratios of luminances; "
    "the error of the meter's scale is unknown, so that no expanded uncertainty of K is stated. What a meter "
    "certificate would give is stated under Flags."
)
_WHOLE = "This certificate may be reproduced only in full."


def amend(amends: Amended, reason: str) -> str:
    """Return the statement that identifies an amendment, as ISO/IEC 17025, 7.8.8, asks."""
    return (
        f"Amendment {amends.amendment} to certificate {amends.number}, issued {rfc3339(amends.issued_at)}, "
        f"which is kept as it was issued. Reason: {reason}"
    )


def list_statements(
    spec: MethodSpec, vignetting: str, parameters: Mapping[str, Any], result: Mapping[str, Any]
) -> list[str]:
    """Return the statements that the laboratory makes with every certificate of a method."""
    corrected = f"The signals were corrected for vignetting with {vignetting}."
    return [
        _RELATES,
        _EXPANDED,
        *spec.certificate.statements,
        *spec.certificate.state(parameters, result),
        *([_UNCORRECTED if vignetting == "none" else corrected] if spec.corrected_by else []),
        _SUFFICE,
        _WHOLE,
    ]


def format_traceability(
    spec: MethodSpec, meters: Sequence[UsedMeter], panels: Sequence[UsedPanel], scope: Scope | None
) -> str:
    """Return the sentence on the certificates that link the coefficients to their units."""
    if scope == "relative_only":
        return _RELATIVE
    if spec.reference == "meter":
        return _through_meters(meters)
    return _through_panels(panels) if spec.reference == "panel" else spec.certificate.traceability


def format_vignetting(spec: MethodSpec, content_sha256: str | None) -> str:
    """Return the vignetting correction of the signals.

    ``content_sha256`` : of the vignetting version that the coefficients are valid with
    """
    if content_sha256 is None:
        return spec.certificate.vignetting
    return f"the camera's vignetting version with content SHA-256 {content_sha256}"


def _through_meters(meters: Sequence[UsedMeter]) -> str:
    luminance = [meter for meter in meters if meter.kind == "luminance"]
    named = [
        f"{meter.make} {meter.model}, serial number {meter.serial}: "
        f"certificate {meter.certificate.number} of {meter.certificate.laboratory}"
        for meter in luminance
        if meter.certificate
    ]
    return f"Luminance is traceable through {'; '.join(named)}."


def _through_panels(panels: Sequence[UsedPanel]) -> str:
    if not panels:
        return "Not demonstrated: the panel is not registered. Its reflectance was taken from the files."
    ways = {True: "stated by files of", False: "measured on"}
    named = "; ".join(
        f"{panel.serial}, {ways[any(band.origin for band in panel.bands)]} {panel.measured_on}"
        for panel in panels
    )
    return (
        f"Reflectance depends on panel {named}. Who measured the panel, and against what, is documented with "
        "it and is not recorded here."
    )


def describe_work(record: CalibrationRecord) -> Work:
    """The campaign's own words, and the days on which it was done."""
    campaign = record.campaign
    days, days_from = _days(record)
    return Work.restate(
        campaign,
        campaign_id=campaign.id,
        first_day=min(days, default=None),
        last_day=max(days, default=None),
        days_from=days_from if days else None,
    )


def describe_meters(record: CalibrationRecord) -> list[UsedMeter]:
    """Each meter with its certificate of then and the days on which it was read."""
    campaign_days, _ = _days(record)
    meters = []
    for meter in record.meters.values():
        readings = [reading for reading in record.readings if reading and reading.meter_id == meter.row.id]
        days = [reading.taken_at.date() for reading in readings if reading.taken_at] or campaign_days
        meters.append(
            UsedMeter.restate(
                meter.row,
                certificate=meter.certificate or None,
                readings=len(readings),
                first_day=min(days, default=None),
                last_day=max(days, default=None),
            )
        )
    return meters


def _days(record: CalibrationRecord) -> tuple[list[date], DaysFrom]:
    """The days of the readings; else those of the campaign; else those of the frames' own clock."""
    taken = [reading.taken_at.date() for reading in record.readings if reading and reading.taken_at]
    if taken:
        return taken, "readings"
    stated = [record.campaign.started_at, record.campaign.ended_at]
    if any(stated):
        return [each.date() for each in stated if each], "campaign"
    return list(_read_days(frame.taken_at for frame in record.frames.values())), "frames"


def _read_days(stamps: Iterable[str | None]) -> Iterable[date]:
    for stamp in stamps:
        try:
            yield date.fromisoformat((stamp or "")[:10])
        except ValueError:
            continue  # a camera whose clock was never set


SCHEMA_VERSION = 1

_SI = {"luminance": "cd/m2", "illuminance": "lx"}


def build_certificate(
    record: CalibrationRecord,
    *,
    issued: Issued | None = None,
    approved_by: Person | None = None,
    published: Sequence[PublishedBy] = (),
) -> CertificateAnswer:
    """Build the whole document, with the items that it lacks; a draft unless it is being issued."""
    row = record.calibration
    meters, panels = describe_meters(record), _panels(record)
    spec = get_method(row.method)
    result, text = drop_absent(row.result), spec.certificate
    vignetting = format_vignetting(spec, row.parameters.get("vignetting"))
    coefficients = _coefficients(record)
    scope = next((each.uncertainty_scope for each in coefficients if each.uncertainty_scope), None)
    certificate = CertificateAnswer(
        schema_version=SCHEMA_VERSION,
        title="Certificate of calibration",
        number=f"{_number(record, row)}-amendment-{issued.amends.amendment}"
        if issued and issued.amends
        else _number(record, row),
        calibration_id=row.id,
        content_sha256=row.content_sha256,
        version=row.version,
        method=row.method,
        procedure=text.procedure,
        equation=text.equation,
        configuration=row.configuration,
        laboratory=Laboratory.restate(record.organisation, name=name_laboratory(record.organisation)),
        item=_item(record),
        work=describe_work(record),
        meters=meters,
        panels=panels,
        traceability=format_traceability(spec, meters, panels, scope),
        uncertainty_scope=scope,
        readings=_readings(record),
        regions=_regions(record),
        frames=[_frame(record, used) for used in row.inputs["frames"]],
        target=row.inputs.get("target"),
        parameters=drop_absent(row.parameters),
        result=result,
        coefficients=coefficients,
        budgets=[Budget(**budget) for budget in state_budgets(row.method, row.result)],
        vignetting=vignetting,
        falloff=row.inputs.get("vignetting"),
        flags=[FlagInWords(**flag, meaning=FINDINGS[flag["flag"]].sentence) for flag in result["flags"]],
        flight=record.flight or None,
        checklist=_checklist(record),
        software={**row.software, "extractor": row.inputs["extractor"]},
        author=_name(record, row.created_by),
        fitted_by=PersonAnswer.restate(record.fitted_by) if record.fitted_by else None,
        approved_by=PersonAnswer.restate(approved_by) if approved_by else None,
        created_at=row.created_at,
        issued=issued,
        published=list(published),
        validity=Validity.restate(published[-1], state="published") if issued else _validity(record),
        statements=[
            *([amend(issued.amends, published[-1].reason)] if issued and issued.amends else []),
            *list_statements(spec, vignetting, row.parameters, result),
        ],
    )
    gaps = [Gap(code=found.code, message=found.message) for found in list_gaps(certificate)]
    return certificate.model_copy(update={"gaps": gaps})


def list_published(record: CalibrationRecord) -> list[PublishedBy]:
    """Return every publication of a version, oldest first."""
    return [
        PublishedBy.restate(act.publication, by=_name(record, act.by), at=act.publication.known_from)
        for act in record.acts
    ]


def _item(record: CalibrationRecord) -> Item:
    """Return the camera with the lens that the version holds for; one named since, where it names none."""
    camera = CameraAnswer.of(record.camera)
    lens = record.calibration.configuration.get("lens") or record.campaign.lens or camera.lens
    return Item.restate(camera, lens=lens)


def _number(record: CalibrationRecord, version: Calibration) -> str:
    return f"{record.camera.serial}-{version.method}-{version.version}"


def _name(record: CalibrationRecord, key_id: str) -> str:
    """Return the person whose key acted; a process that acted without a key is named as it is."""
    return record.names.get(key_id, key_id)


def _panels(record: CalibrationRecord) -> list[UsedPanel]:
    return [UsedPanel.model_validate(panel) for panel in record.calibration.inputs.get("panels", [])]


def _regions(record: CalibrationRecord) -> list[Region]:
    inputs = record.calibration.inputs
    parts = inputs.get("roi_parts", {})
    return [Region(sha256=key, points=points, parts=parts.get(key)) for key, points in inputs["rois"].items()]


def _coefficients(record: CalibrationRecord) -> list[CertifiedCoefficient]:
    version = record.calibration
    figures = [
        {name: getattr(row, name, None) for name in CoefficientValue.__dataclass_fields__}
        for row in record.coefficients
    ]
    stated = state_coefficients(version.method, version.result, figures)
    return [CertifiedCoefficient(**figure) for figure in stated]


def _readings(record: CalibrationRecord) -> list[UsedReading]:
    """List the readings of meters; a panel's reflectances are listed with the panel."""
    if get_method(record.calibration.method).reference != "meter":
        return []
    found = zip(record.calibration.inputs["readings"], record.readings, strict=True)
    return [UsedReading.restate(row, used, unit=_SI[used["quantity"]]) for used, row in found]


def _frame(record: CalibrationRecord, used: dict[str, Any]) -> UsedFrame:
    found = record.frames[used["sha256"]]
    return UsedFrame(
        id=found.id,
        frame=used["frame"],
        sha256=used["sha256"],
        size_bytes=found.size_bytes,
        role=used["role"],
        scene=used.get("scene"),
        exposure=drop_absent(used.get("exposure")),
        taken_at=found.taken_at,
        clock_offset=used.get("clock_offset"),
        roi_sha256=used["roi_sha256"],
        roi_origin="found" if found.found_by else None,
        roi_found_by=found.found_by,
        panel_serial=found.panel_serial,
        warnings=[FINDINGS[flag].sentence for flag in found.warnings if flag in FINDINGS],
        **_measured(record, found.statistics),
    )


def _measured(record: CalibrationRecord, statistics: list[ChannelStatistics]) -> dict[str, Any]:
    """Return the statistics of a frame, with the signal that entered the fit if that is one channel's."""
    stored = {"statistics": [encode_statistics(row) for row in statistics]}
    version = record.calibration
    if "channel" not in version.parameters:
        return stored
    signal = measure_signal(statistics, channel=version.parameters["channel"])
    return {
        **stored,
        "signal_dn": signal.value_dn,
        "signal_standard_uncertainty_dn": signal.standard_uncertainty_dn,
    }


def _checklist(record: CalibrationRecord) -> Checklist:
    signature = record.signature
    return Checklist(
        items=[
            CheckedItem.restate(item, done_by=_name(record, item.done_by) if item.done_by else None)
            for item in record.checklist
        ],
        signature=Signature.restate(signature, signed_by=_name(record, signature.signed_by))
        if signature
        else None,
    )


def _validity(record: CalibrationRecord) -> Validity:
    status, revocation = record.status, record.revocation
    revoked = None
    if revocation is not None:
        revoked = Revoked(
            by=_name(record, revocation.revoked_by), at=revocation.revoked_at, reason=revocation.reason
        )
    return Validity.restate(status, revoked=revoked)


_MOST_NAMED = 3


class Found(Record):
    """A missing item: its code, and a message that says what is missing and how to add it."""

    code: Finding
    message: str


def list_gaps(certificate: CertificateAnswer) -> list[Found]:
    """Return every missing item of a certificate, in the order of the printed pages.

    What the record cannot contain is entered once, on the campaign and the organisation, and is missing until
    then.
    """
    return [
        *_unnamed(certificate),
        *(found for meter in certificate.meters for found in _of_meter(meter)),
        *_of_readings(certificate),
        *_of_panels(certificate),
        *_of_checklist(certificate),
    ]


def _unnamed(certificate: CertificateAnswer) -> Iterator[Found]:
    """Check 7.8.2.1 b, c, e, g, i, o and 7.8.4.1 b: the items that a person has to enter."""
    work = certificate.work
    lens = certificate.item.lens or not get_method(certificate.method).certificate.holds_for_lens or None
    name = certificate.laboratory.name
    for value, code, message in (
        (
            certificate.approved_by if certificate.published else "a draft",
            interface.APPROVER_MISSING,
            "Nobody signs it. State your name and role with your key (page Organisation, stilb key change).",
        ),
        (
            certificate.fitted_by,
            interface.AUTHOR_MISSING,
            "Who fitted is missing. State name and role with the key (page Organisation, stilb key change).",
        ),
        (
            None if name == UNNAMED_LABORATORY else name,
            interface.LABORATORY_NAME_MISSING,
            "The laboratory's name is missing. Enter it on the page Organisation (stilb organisation).",
        ),
        (
            certificate.laboratory.address,
            interface.LABORATORY_ADDRESS_MISSING,
            "The laboratory's address is missing. Enter it on the page Organisation (stilb organisation).",
        ),
        (work.customer, interface.CUSTOMER_MISSING, "The customer is missing. Enter it on the campaign."),
        (
            work.place,
            interface.PLACE_MISSING,
            "The place of the measurements is missing. Enter it on the campaign.",
        ),
        (
            work.conditions,
            interface.CONDITIONS_MISSING,
            "The conditions (temperature, lamp, daylight) are missing. Describe them on the campaign.",
        ),
        (
            work.first_day,
            interface.DATE_MISSING,
            "The day of the measurements is missing. Enter the start of the campaign.",
        ),
        (
            work.recorder,
            interface.RECORDER_MISSING,
            "The recorder of the measurements is missing. Enter the name on the campaign.",
        ),
        (
            lens,
            interface.LENS_MISSING,
            "The lens is missing, and the result is valid for one lens only. Register it with the camera.",
        ),
    ):
        if value is None:
            yield Found(code=code, message=message)


def _of_meter(meter: UsedMeter) -> Iterator[Found]:
    """Check 7.8.4.1 c: the meter had a valid certificate on the day of use."""
    name = f"The {meter.kind} meter {meter.make} {meter.model}, serial number {meter.serial},"
    certificate = meter.certificate
    if certificate is None:
        yield Found(
            code=FINDINGS["meter_certificate_missing"],
            message=f"{name} has no certificate. Register the meter with its certificate, then refit.",
        )
        return
    if meter.last_day and certificate.due_on < meter.last_day:
        yield Found(
            code=interface.METER_CERTIFICATE_EXPIRED,
            message=f"{name} was read on {meter.last_day}, after its certificate {certificate.number} "
            f"was due on {certificate.due_on}.",
        )
    if meter.first_day and meter.first_day < certificate.issued_on:
        yield Found(
            code=interface.METER_CERTIFICATE_NOT_YET_ISSUED,
            message=f"{name} was read on {meter.first_day}, before its certificate {certificate.number} "
            f"was issued on {certificate.issued_on}.",
        )


def _of_readings(certificate: CertificateAnswer) -> Iterator[Found]:
    unknown = [reading for reading in certificate.readings if reading.meter is None]
    if unknown:
        yield Found(
            code=interface.METER_UNKNOWN,
            message=f"{len(unknown)} of {len(certificate.readings)} readings have no meter. "
            "Send readings with their meter_id.",
        )


def _of_panels(certificate: CertificateAnswer) -> Iterator[Found]:
    """Check 7.8.4.1 c: the panel that the reflectances depend on."""
    if get_method(certificate.method).reference != "panel":
        return
    if not certificate.panels:
        yield Found(
            code=FINDINGS["panel_unknown"],
            message="The panel is not registered, and its reflectance was taken from the files. Choose "
            "or register it on the page of the campaign, then refit.",
        )
    fitted = {coefficient.band for coefficient in certificate.coefficients}
    for panel in certificate.panels:
        bands = [each.band for each in panel.bands if each.band in fitted and not each.standard_uncertainty]
        if bands:
            yield Found(
                code=FINDINGS["panel_uncertainty_missing"],
                message=f"The reflectance of panel {panel.serial} has no standard uncertainty in "
                f"{', '.join(bands)}. Send the panel as measured, with its standard_uncertainty, then refit.",
            )


def _of_checklist(certificate: CertificateAnswer) -> Iterator[Found]:
    """Check 7.8.2.1 n and o: open items of the checklist, and its signature."""
    items = certificate.checklist.items
    if not items:
        return  # only the luminance procedure has one
    waiting = [item.text for item in items if item.done_by is None]
    if waiting:
        named = "; ".join(waiting[:_MOST_NAMED])
        more = f"; and {len(waiting) - _MOST_NAMED} more" if len(waiting) > _MOST_NAMED else ""
        yield Found(
            code=interface.CHECKLIST_INCOMPLETE,
            message=f"{len(waiting)} of {len(items)} items of the procedure's checklist are not ticked: "
            f"{named}{more}.",
        )
    if certificate.checklist.signature is None:
        yield Found(
            code=interface.CHECKLIST_UNSIGNED,
            message="The operator has not signed the procedure's checklist.",
        )
