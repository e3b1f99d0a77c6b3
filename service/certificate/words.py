"""Sentences of a certificate: statements, traceability and vignetting correction."""

from collections.abc import Mapping, Sequence
from typing import Any

from radiometry.specification.method import MethodSpec, Scope
from service.schemas.base import rfc3339
from service.schemas.certificates import Amended, UsedMeter, UsedPanel

RELATES = (
    "This certificate relates only to the item named on it, in the state in which it was calibrated, and "
    "within the range of validity stated."
)
EXPANDED = (
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
WHOLE = "This certificate may be reproduced only in full."


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
        RELATES,
        EXPANDED,
        *spec.certificate.statements,
        *spec.certificate.state(parameters, result),
        *([_UNCORRECTED if vignetting == "none" else corrected] if spec.corrected_by else []),
        _SUFFICE,
        WHOLE,
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
