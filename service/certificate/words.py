"""The sentences of a certificate: what it states, what its figures hang on, what they were corrected for."""

from collections.abc import Sequence

from radiometry.methods import Method
from service.certificate.papers import describe_paper
from service.schemas.certificates import UsedMeter, UsedPanel
from store.stating import COVERAGE_FACTOR

_RELATES = (
    "This certificate relates only to the item named on it, in the state in which it was calibrated, and "
    "within the range of validity stated."
)
_EXPANDED = (
    "Expanded uncertainties are standard uncertainties times the coverage factor k, taken from the t "
    "distribution with the effective degrees of freedom for a coverage probability of about 95 %, evaluated "
    "according to JCGM 100:2008."
)
_EXPANDED_PLAINLY = (
    f"Expanded uncertainties are standard uncertainties times the coverage factor k = {COVERAGE_FACTOR:g}, "
    "for a coverage probability of about 95 % of a normal distribution, evaluated according to JCGM 100:2008."
)
_UNCORRECTED = (
    "No correction for vignetting was applied: the coefficient holds for the region in which it was found."
)
_SUFFICE = (
    "The frames, readings, regions and parameters named here suffice to compute every figure anew; each "
    "frame is known by its SHA-256."
)
_WHOLE = "This certificate may be reproduced only in full."


def say_statements(method: Method, vignetting: str) -> list[str]:
    """What the laboratory states with every certificate of a method."""
    corrected = f"The signals were corrected for vignetting: {vignetting}."
    return [
        _RELATES,
        _EXPANDED if method in ("luminance", "reflectance") else _EXPANDED_PLAINLY,
        *describe_paper(method).statements,
        *([_UNCORRECTED if vignetting == "none" else corrected] if method == "luminance" else []),
        _SUFFICE,
        _WHOLE,
    ]


def say_traceability(method: Method, meters: Sequence[UsedMeter], panels: Sequence[UsedPanel]) -> str:
    """Through which certificates the figures hang on the units they are given in."""
    match method:
        case "luminance":
            return _through_meters(meters)
        case "reflectance":
            return _through_panels(panels)
        case _:
            return describe_paper(method).traceability


def say_vignetting(method: Method, content_sha256: str | None) -> str:
    """What the signals were corrected with. ``content_sha256`` : of the version that luminance holds with."""
    if method == "reflectance":
        return "as each file states it"
    return (
        f"the camera's vignetting version of content SHA-256 {content_sha256}" if content_sha256 else "none"
    )


def _through_meters(meters: Sequence[UsedMeter]) -> str:
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


def _through_panels(panels: Sequence[UsedPanel]) -> str:
    if not panels:
        return "Not shown: the panel is not registered, its reflectance is what the files say."
    named = "; ".join(f"{panel.serial}, measured on {panel.measured_on}" for panel in panels)
    return (
        f"Reflectance hangs on the panel {named}: who measured it, and against what, is with the panel's "
        "papers and not recorded here."
    )
