"""The certificate of a version, built from its record. No value is changed here."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from datetime import date
from typing import Any

from radiometry.fitting.evidence import CoefficientValue
from radiometry.frame.statistics import ChannelStatistics, measure_signal
from radiometry.methods import get_method
from radiometry.methods.findings import FINDINGS
from radiometry.specification.method import MethodSpec, Scope
from service.calibrations.schemas import PersonAnswer
from service.documents import schemas
from service.equipment.schemas import CameraAnswer
from service.http.models import rfc3339
from store.codec import drop_absent
from store.queries.calibration_record import CalibrationRecord, state_budgets, state_coefficients
from store.queries.organisations import Person, name_laboratory

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


def amend(amends: schemas.Amended, reason: str) -> str:
    """Return the statement that identifies an amendment, as ISO/IEC 17025, 7.8.8, asks."""
    return (
        f"Amendment {amends.amendment} to certificate {amends.number}, issued {rfc3339(amends.issued_at)}, "
        f"which is kept as it was issued. Reason: {reason}"
    )


def list_statements(
    spec: MethodSpec, vignetting: str, parameters: Mapping[str, Any], result: Mapping[str, Any]
) -> list[str]:
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
    spec: MethodSpec,
    meters: Sequence[schemas.UsedMeter],
    panels: Sequence[schemas.UsedPanel],
    scope: Scope | None,
) -> str:
    if scope == "relative_only":
        return _RELATIVE
    if spec.reference == "meter":
        return _through_meters(meters)
    return _through_panels(panels) if spec.reference == "panel" else spec.certificate.traceability


def _through_meters(meters: Sequence[schemas.UsedMeter]) -> str:
    luminance = [meter for meter in meters if meter.kind == "luminance"]
    named = [
        f"{meter.make} {meter.model}, serial number {meter.serial}: "
        f"certificate {meter.certificate.number} of {meter.certificate.laboratory}"
        for meter in luminance
        if meter.certificate
    ]
    return f"Luminance is traceable through {'; '.join(named)}."


def _through_panels(panels: Sequence[schemas.UsedPanel]) -> str:
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


def describe_work(record: CalibrationRecord) -> schemas.Work:
    """The campaign's own words, and the days on which it was done."""
    campaign = record.campaign
    days, days_from = _days(record)
    return schemas.Work.restate(
        campaign,
        campaign_id=campaign.id,
        first_day=min(days, default=None),
        last_day=max(days, default=None),
        days_from=days_from if days else None,
    )


def describe_meters(record: CalibrationRecord) -> list[schemas.UsedMeter]:
    """Each meter with its certificate of then and the days on which it was read."""
    campaign_days, _ = _days(record)
    meters = []
    for meter in record.meters.values():
        readings = [reading for reading in record.readings if reading and reading.meter_id == meter.row.id]
        days = [reading.taken_at.date() for reading in readings if reading.taken_at] or campaign_days
        meters.append(
            schemas.UsedMeter.restate(
                meter.row,
                certificate=meter.certificate or None,
                readings=len(readings),
                first_day=min(days, default=None),
                last_day=max(days, default=None),
            )
        )
    return meters


def _days(record: CalibrationRecord) -> tuple[list[date], schemas.DaysFrom]:
    """The days of the readings; else those of the campaign; else those of the frames' own clock."""
    if taken := [reading.taken_at.date() for reading in record.readings if reading and reading.taken_at]:
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
    issued: schemas.Issued | None = None,
    approved_by: Person | None = None,
    published: Sequence[schemas.PublishedBy] = (),
) -> schemas.CertificateAnswer:
    """Build the whole document, with the items that it lacks; a draft unless it is being issued."""
    row = record.calibration
    meters = describe_meters(record)
    panels = [schemas.UsedPanel.model_validate(each) for each in row.inputs.get("panels", [])]
    spec = get_method(row.method)
    result, text = drop_absent(row.result), spec.certificate
    vignetting = text.vignetting
    if content_sha256 := row.parameters.get("vignetting"):
        vignetting = f"the camera's vignetting version with content SHA-256 {content_sha256}"
    coefficients = _coefficients(record)
    scope = next((each.uncertainty_scope for each in coefficients if each.uncertainty_scope), None)
    camera = CameraAnswer.of(record.camera)
    amendment = f"-amendment-{issued.amends.amendment}" if issued and issued.amends else ""
    lens = row.configuration.get("lens") or record.campaign.lens or camera.lens
    certificate = schemas.CertificateAnswer.restate(
        row,
        schema_version=SCHEMA_VERSION,
        title="Certificate of calibration",
        number=f"{record.camera.serial}-{row.method}-{row.version}{amendment}",
        calibration_id=row.id,
        procedure=text.procedure,
        equation=text.equation,
        laboratory=schemas.Laboratory.restate(record.organisation, name=name_laboratory(record.organisation)),
        item=schemas.Item.restate(camera, lens=lens),
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
        budgets=[schemas.Budget(**budget) for budget in state_budgets(row.method, row.result)],
        vignetting=vignetting,
        falloff=row.inputs.get("vignetting"),
        flags=[
            schemas.FlagInWords(**flag, meaning=FINDINGS[flag["flag"]].sentence) for flag in result["flags"]
        ],
        flight=record.flight or None,
        checklist=_checklist(record),
        software={**row.software, "extractor": row.inputs["extractor"]},
        author=_name(record, row.created_by),
        fitted_by=PersonAnswer.restate(record.fitted_by) if record.fitted_by else None,
        approved_by=PersonAnswer.restate(approved_by) if approved_by else None,
        issued=issued,
        published=list(published),
        validity=schemas.Validity.restate(published[-1], state="published") if issued else _validity(record),
        statements=[
            *([amend(issued.amends, published[-1].reason)] if issued and issued.amends else []),
            *list_statements(spec, vignetting, row.parameters, result),
        ],
    )
    return certificate.model_copy(update={"gaps": schemas.list_gaps(certificate)})


def list_published(record: CalibrationRecord) -> list[schemas.PublishedBy]:
    return [
        schemas.PublishedBy.restate(act.publication, by=_name(record, act.by), at=act.publication.known_from)
        for act in record.acts
    ]


def _name(record: CalibrationRecord, key_id: str) -> str:
    """Return the person whose key acted; a process that acted without a key is named as it is."""
    return record.names.get(key_id, key_id)


def _regions(record: CalibrationRecord) -> list[schemas.Region]:
    inputs = record.calibration.inputs
    parts = inputs.get("roi_parts", {})
    return [
        schemas.Region.restate(sha256=key, points=points, parts=parts.get(key))
        for key, points in inputs["rois"].items()
    ]


def _coefficients(record: CalibrationRecord) -> list[schemas.CertifiedCoefficient]:
    version = record.calibration
    figures = [
        {name: getattr(row, name, None) for name in CoefficientValue.__dataclass_fields__}
        for row in record.coefficients
    ]
    stated = state_coefficients(version.method, version.result, figures)
    return [schemas.CertifiedCoefficient(**figure) for figure in stated]


def _readings(record: CalibrationRecord) -> list[schemas.UsedReading]:
    """List the readings of meters; a panel's reflectances are listed with the panel."""
    if get_method(record.calibration.method).reference != "meter":
        return []
    found = zip(record.calibration.inputs["readings"], record.readings, strict=True)
    return [schemas.UsedReading.restate(row, used, unit=_SI[used["quantity"]]) for used, row in found]


def _frame(record: CalibrationRecord, used: dict[str, Any]) -> schemas.UsedFrame:
    found = record.frames[used["sha256"]]
    return schemas.UsedFrame.restate(
        used,
        found,
        exposure=drop_absent(used.get("exposure")),
        roi_origin="found" if found.found_by else None,
        roi_found_by=found.found_by,
        warnings=[FINDINGS[flag].sentence for flag in found.warnings if flag in FINDINGS],
        **_measured(record, found.statistics),
    )


def _measured(record: CalibrationRecord, statistics: list[ChannelStatistics]) -> dict[str, Any]:
    """Return the statistics of a frame, with the signal that entered the fit if that is one channel's."""
    stored = {"statistics": [asdict(row) for row in statistics]}
    version = record.calibration
    if "channel" not in version.parameters:
        return stored
    signal = measure_signal(statistics, channel=version.parameters["channel"])
    return {
        **stored,
        "signal_dn": signal.value_dn,
        "signal_standard_uncertainty_dn": signal.standard_uncertainty_dn,
    }


def _checklist(record: CalibrationRecord) -> schemas.Checklist:
    signature = record.signature
    return schemas.Checklist(
        items=[
            schemas.CheckedItem.restate(item, done_by=_name(record, item.done_by) if item.done_by else None)
            for item in record.checklist
        ],
        signature=schemas.Signature.restate(signature, signed_by=_name(record, signature.signed_by))
        if signature
        else None,
    )


def _validity(record: CalibrationRecord) -> schemas.Validity:
    status, revocation = record.status, record.revocation
    revoked = None
    if revocation is not None:
        revoked = schemas.Revoked(
            by=_name(record, revocation.revoked_by), at=revocation.revoked_at, reason=revocation.reason
        )
    return schemas.Validity.restate(status, revoked=revoked)
