"""Items of ISO/IEC 17025:2017, 7.8, that a calibration certificate lacks."""

from collections.abc import Iterator

from radiometry.findings import Finding, interface
from radiometry.methods import findings, get_method
from radiometry.records import Record
from service.documents.schemas import CertificateAnswer, UsedMeter
from store.queries.organisations import UNNAMED_LABORATORY


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
    for value, code in (
        (certificate.approved_by if certificate.published else "a draft", interface.APPROVER_MISSING),
        (certificate.fitted_by, interface.AUTHOR_MISSING),
        (None if name == UNNAMED_LABORATORY else name, interface.LABORATORY_NAME_MISSING),
        (certificate.laboratory.address, interface.LABORATORY_ADDRESS_MISSING),
        (work.customer, interface.CUSTOMER_MISSING),
        (work.place, interface.PLACE_MISSING),
        (work.conditions, interface.CONDITIONS_MISSING),
        (work.first_day, interface.DATE_MISSING),
        (work.recorder, interface.RECORDER_MISSING),
        (lens, interface.LENS_MISSING),
    ):
        if value is None:
            yield Found(code=code, message=f"{code.sentence} {code.remedy}")


def _of_meter(meter: UsedMeter) -> Iterator[Found]:
    """Check 7.8.4.1 c: the meter had a valid certificate on the day of use."""
    name = f"The {meter.kind} meter {meter.make} {meter.model}, serial number {meter.serial},"
    if (certificate := meter.certificate) is None:
        yield Found(
            code=findings.FINDINGS["meter_certificate_missing"],
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
    if unknown := [reading for reading in certificate.readings if reading.meter is None]:
        yield Found(
            code=interface.METER_UNKNOWN,
            message=f"{len(unknown)} of {len(certificate.readings)} readings have no meter. "
            "Choose the meter of each reading on the campaign.",
        )


def _of_panels(certificate: CertificateAnswer) -> Iterator[Found]:
    """Check 7.8.4.1 c: the panel that the reflectances depend on."""
    if get_method(certificate.method).reference != "panel":
        return
    if not certificate.panels:
        yield Found(
            code=findings.FINDINGS["panel_unknown"],
            message="The panel is not registered, and its reflectance was taken from the files. Choose "
            "or register it on the page of the campaign, then refit.",
        )
    fitted = {coefficient.band for coefficient in certificate.coefficients}
    for panel in certificate.panels:
        bands = [each.band for each in panel.bands if each.band in fitted and not each.standard_uncertainty]
        if bands:
            yield Found(
                code=findings.FINDINGS["panel_uncertainty_missing"],
                message=f"The reflectance of panel {panel.serial} has no standard uncertainty in "
                f"{', '.join(bands)}. Send the panel as measured, with its standard_uncertainty, then refit.",
            )


def _of_checklist(certificate: CertificateAnswer) -> Iterator[Found]:
    """Check 7.8.2.1 n and o: open items of the checklist, and its signature."""
    if not (items := certificate.checklist.items):
        return  # only the luminance procedure has one
    if waiting := sum(item.done_by is None for item in items):
        yield Found(
            code=interface.CHECKLIST_INCOMPLETE,
            message=f"{waiting} of {len(items)} items of the procedure's checklist are not ticked.",
        )
    if certificate.checklist.signature is None:
        yield Found(
            code=interface.CHECKLIST_UNSIGNED,
            message="The operator has not signed the procedure's checklist.",
        )
