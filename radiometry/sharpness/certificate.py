"""Certificate text of a sharpness calibration."""

from typing import Final

from radiometry.specification.certificate import FRAME, CertificateText, Column

CERTIFICATE: Final = CertificateText(
    procedure="Modulation transfer function of the camera against spatial frequency, per position and "
    "channel, from slanted edges (ISO 12233, e-SFR) or Siemens stars",
    equation="MTF(f) = |F{LSF}(f)| / |F{LSF}(0)|, where f is in cycles per pixel of the whole sensor",
    headlines=frozenset({"mtf50_cycles_per_pixel", "resolving_power_cycles_per_pixel"}),
    columns=(
        FRAME,
        Column(name="position", head="position", form="text", share=1.2),
        Column(name="channel", head="channel", form="text"),
        Column(name="f_number", head="f/", share=0.6),
        Column(name="value", head="f [c/px]"),
        Column(name="standard_uncertainty", head="u(f)"),
        Column(name="residual_rel", head="deviation", form="percent"),
    ),
    traceability="Lengths are counted in pixels of the camera itself; no external standard enters. Line "
    "pairs per millimetre depend on the pixel pitch that is stated for the camera.",
)
