"""Text of a certificate for a luminance calibration."""

from typing import Final

from radiometry.specification.certificate import CertificateText

CERTIFICATE: Final = CertificateText(
    procedure="Luminance coefficient K of a camera against a luminance meter, one per ISO value, "
    "following the standard operating procedure “Drone Camera Calibration”; K fitted by generalised least "
    "squares",
    equation="N - D = K X,  X = t S L / f²",
    headlines=frozenset({"luminance_k"}),
    layout="curve",
    states_coverage=True,
    columns=(),  # luminance has sheets of its own
    statements=(
        (
            "The verdict compares the largest deviation of a point from the luminance meter with the "
            "tolerance. Measurement uncertainty is not taken into account in this decision."
        ),
    ),
)
