"""Certificate text of a vignetting calibration."""

from typing import Final

from radiometry.specification.certificate import FRAME, CertificateText, Column

CERTIFICATE: Final = CertificateText(
    procedure="Light falloff over the frame, one per f-number and channel, from frames of a uniform surface; "
    "centre and coefficients fitted by weighted least squares",
    equation="(N - D) / A = 1 + k1 r² + k2 r⁴ + k3 r⁶, where r is the distance from the fitted centre in "
    "units of half the frame's diagonal",
    headlines=frozenset({"corner_falloff"}),
    columns=(
        FRAME,
        Column(name="role", head="role", form="text", share=0.7),
        Column(name="f_number", head="f/", share=0.6),
        Column(name="signal_share", head="signal", form="percent"),
        Column(name="saturated_share", head="saturated", form="percent"),
        Column(name="gradient_rel", head="gradient", form="percent"),
        Column(name="gradient_standard_uncertainty_rel", head="u(gradient)", form="percent"),
    ),
    traceability="The result is a ratio of light within one frame; no external standard enters. The frames "
    "themselves are tested for non-uniform light, which is reported among the flags.",
)
