"""Text of a certificate for a luminance calibration."""

from collections.abc import Mapping
from typing import Any, Final

from radiometry.specification.certificate import CertificateText

_RULES: Final = {
    "simple": "The verdict compares the largest deviation of a point from the luminance meter with the "
    "tolerance. Measurement uncertainty is not taken into account in this decision.",
    "guarded": "Decision rule (ILAC-G8:09/2019, guard band w = U): the largest deviation of a point from the "
    "luminance meter plus the expanded uncertainty of K at its f-number must not exceed the tolerance.",
    "shared_risk": "Decision rule (JCGM 106:2012, shared risk): the largest deviation of a point from the "
    "luminance meter must not exceed the tolerance, and the expanded uncertainty of K must not exceed it "
    "either. The parties share the risk of a wrong decision.",
}


def state_conditions(parameters: Mapping[str, Any], result: Mapping[str, Any]) -> tuple[str, ...]:
    """State the decision rule of a version, and the light and distance that its K holds for."""
    rule = parameters.get("acceptance") or "simple"
    risks = [fit["beyond_tolerance_risk"] for fit in result["iso_fits"] if "beyond_tolerance_risk" in fit]
    risk = ""
    if risks:
        risk = f" A deviation is beyond the tolerance with a probability of up to {max(risks):.0%}."
    elif rule != "simple":
        risk = " K is relative only: its expanded uncertainty is unknown, and this rule accepts nothing."
    spectral = result.get("spectral") or {"lamp": "not recorded", "camera_response": "not recorded"}
    index = f", f1' = {spectral['f1_prime']:.0%}" if spectral.get("f1_prime") is not None else ""
    distance_m = parameters.get("focus_distance_m")
    distance = "not recorded" if distance_m is None else f"{distance_m:g} m"
    return (
        f"{_RULES[rule]}{risk}",
        (
            f"K holds for light of the lamp of its calibration. Lamp: {spectral['lamp']}. Camera response: "
            f"{spectral['camera_response']}{index}."
        ),
        f"Distance to the calibrated surface: {distance}.",
    )


CERTIFICATE: Final = CertificateText(
    procedure="Luminance coefficient K of a camera against a luminance meter, one per ISO value and one at "
    "each f-number, following the standard operating procedure “Drone Camera Calibration”; K fitted by "
    "generalised least squares",
    equation="N - D = K X,  X = t S L / f²",
    headlines=frozenset({"luminance_k"}),
    layout="curve",
    columns=(),  # luminance has sheets of its own
    state=state_conditions,
)
