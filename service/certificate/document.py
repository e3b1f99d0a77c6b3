"""From what is recorded about a version to its certificate. Nothing here changes a figure."""

from typing import Any

from pydantic import TypeAdapter

from radiometry.flags import Flag
from radiometry.luminance.budget import explain_budget
from radiometry.luminance.results import IsoFit
from radiometry.statistics import measure_signal
from service.certificate.gaps import list_gaps
from service.certificate.work import describe_meters, describe_work
from service.schemas.calibrations import Gap
from service.schemas.certificates import (
    Budget,
    CertificateAnswer,
    CheckedItem,
    Checklist,
    FlagInWords,
    Item,
    Laboratory,
    PublishedBy,
    Region,
    Revoked,
    Signature,
    UsedFrame,
    UsedMeter,
    UsedReading,
    Validity,
)
from service.schemas.equipment import CameraAnswer
from store.codec import decode_statistics, drop_absent, encode, encode_statistics
from store.queries.dossier import Dossier

SCHEMA_VERSION = 1

_ISO_FIT = TypeAdapter(IsoFit)
_SI = {"luminance": "cd/m2", "illuminance": "lx"}
_EQUATION = "N - D = K X,  X = t S L / f²"
_PROCEDURE = (
    "Luminance coefficient K of a camera against a luminance meter, one per ISO value, after the standard "
    "operating procedure “Drone Camera Calibration”; K by generalised least squares"
)
_STATEMENTS = """
This certificate relates only to the item named on it, in the state in which it was calibrated, and within \
the range of validity stated.
Expanded uncertainties are standard uncertainties times the coverage factor k, taken from the t \
distribution with the effective degrees of freedom for a coverage probability of about 95 %, evaluated \
according to JCGM 100:2008.
The verdict compares the largest deviation of a point from the luminance meter with the tolerance; the \
measurement uncertainty is not taken into account in the decision.
No correction for vignetting was applied: the coefficient holds for the region in which it was found.
The frames, readings, regions and parameters named here suffice to compute every figure anew; each frame is \
known by its SHA-256.
This certificate may be reproduced only in full.
"""
_MEANINGS = {flag.value: flag.meaning for flag in Flag}


def build_certificate(dossier: Dossier) -> CertificateAnswer:
    """The whole document, and what it lacks."""
    row = dossier.calibration
    meters = describe_meters(dossier)
    result = drop_absent(row.result)
    certificate = CertificateAnswer(
        schema_version=SCHEMA_VERSION,
        title="Certificate of calibration",
        number=f"{dossier.camera.serial}-{row.method}-{row.version}",
        calibration_id=row.id,
        content_sha256=row.content_sha256,
        version=row.version,
        method=row.method,
        procedure=_PROCEDURE,
        equation=_EQUATION,
        laboratory=Laboratory(name=dossier.organisation.name, address=dossier.organisation.address),
        item=Item(**CameraAnswer.of(dossier.camera).model_dump()),
        work=describe_work(dossier),
        meters=meters,
        traceability=_traceability(meters),
        readings=_readings(dossier),
        regions=[Region(sha256=key, points=points) for key, points in row.inputs["rois"].items()],
        frames=[_frame(dossier, used) for used in row.inputs["frames"]],
        parameters=drop_absent(row.parameters),
        result=result,
        budgets=[_budget(fit) for fit in row.result["iso_fits"]],
        vignetting="none",
        flags=[FlagInWords(**flag, meaning=_MEANINGS[flag["flag"]]) for flag in result["flags"]],
        checklist=_checklist(dossier),
        software={**row.software, "extractor": row.inputs["extractor"]},
        author=_name(dossier, row.created_by),
        created_at=row.created_at,
        published=_published(dossier),
        validity=_validity(dossier),
        statements=_STATEMENTS.strip().splitlines(),
    )
    gaps = [Gap(code=found.code.value, message=found.message) for found in list_gaps(certificate)]
    return certificate.model_copy(update={"gaps": gaps})


def _name(dossier: Dossier, key_id: str) -> str:
    """Of the key that acted; a process that acted by itself is named as it is."""
    return dossier.names.get(key_id, key_id)


def _readings(dossier: Dossier) -> list[UsedReading]:
    found = zip(dossier.calibration.inputs["readings"], dossier.readings, strict=True)
    return [
        UsedReading(
            **used,
            unit=_SI[used["quantity"]],
            entered_value=row.entered_value if row else None,
            entered_unit=row.entered_unit if row else None,
            taken_at=row.taken_at if row else None,
            meter_id=row.meter_id if row else None,
        )
        for used, row in found
    ]


def _frame(dossier: Dossier, used: dict[str, Any]) -> UsedFrame:
    found = dossier.frames[used["sha256"]]
    statistics = [decode_statistics(row) for row in found.statistics]
    signal = measure_signal(statistics, channel=dossier.calibration.parameters["channel"])
    return UsedFrame(
        id=found.row.id,
        frame=used["frame"],
        sha256=used["sha256"],
        size_bytes=found.size_bytes,
        role=used["role"],
        scene=used.get("scene"),
        exposure=drop_absent(used["exposure"]),
        taken_at=(found.row.header or {}).get("taken_at"),
        roi_sha256=used["roi_sha256"],
        warnings=[_MEANINGS[flag] for flag in found.row.warnings if flag in _MEANINGS],
        signal_dn=signal.value_dn,
        signal_standard_uncertainty_dn=signal.standard_uncertainty_dn,
        statistics=[encode_statistics(row) for row in statistics],
    )


def _budget(stored: dict[str, Any]) -> Budget:
    fit = _ISO_FIT.validate_python(stored)
    return Budget(iso=fit.coefficient.iso, lines=[drop_absent(encode(line)) for line in explain_budget(fit)])


def _traceability(meters: list[UsedMeter]) -> str:
    """Through which certificates the figures hang on the units they are given in."""
    luminance = [meter for meter in meters if meter.kind == "luminance"]
    named = [
        f"{meter.make} {meter.model}, serial number {meter.serial}: "
        f"certificate {meter.certificate.number} of {meter.certificate.laboratory}"
        for meter in luminance
        if meter.certificate
    ]
    if not named:
        return "Not shown: no luminance meter of these readings is known with a certificate."
    return f"Luminance is traceable through {'; '.join(named)}."


def _checklist(dossier: Dossier) -> Checklist:
    signature = dossier.signature
    return Checklist(
        items=[
            CheckedItem(
                key=item.key,
                section=item.section,
                text=item.text,
                done_by=_name(dossier, item.done_by) if item.done_by else None,
                done_at=item.done_at,
                evidence=item.evidence,
                note=item.note,
            )
            for item in dossier.checklist
        ],
        signature=Signature(
            name=signature.name,
            signed_by=_name(dossier, signature.signed_by),
            signed_at=signature.signed_at,
        )
        if signature
        else None,
    )


def _published(dossier: Dossier) -> list[PublishedBy]:
    return [
        PublishedBy(
            by=_name(dossier, act.by),
            at=act.publication.known_from,
            valid_from=act.publication.valid_from,
            valid_to=act.publication.valid_to,
            reason=act.publication.reason,
        )
        for act in dossier.acts
    ]


def _validity(dossier: Dossier) -> Validity:
    standing, revocation = dossier.standing, dossier.revocation
    revoked = None
    if revocation is not None:
        revoked = Revoked(
            by=_name(dossier, revocation.revoked_by),
            at=revocation.revoked_at,
            reason=revocation.reason,
        )
    return Validity(
        state=standing.state,
        valid_from=standing.valid_from,
        valid_to=standing.valid_to,
        superseded_by=standing.superseded_by,
        revoked=revoked,
    )
