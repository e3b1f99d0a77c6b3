"""Text of a certificate for a reflectance calibration."""

from typing import Final

from radiometry.specification.certificate import FRAME, CertificateText, Column

CERTIFICATE: Final = CertificateText(
    procedure="Reflectance coefficient K of each band of a camera with its sunshine sensor, from frames of a "
    "panel of known reflectance",
    equation="R cos θ = K I_sq / I_ss, where I_sq is the band's signal after black-level and vignetting "
    "correction, and I_ss the reading of the sunshine sensor, converted to a level surface unless a flag or "
    "a parameter states otherwise",
    headlines=frozenset({"reflectance_k"}),
    vignetting="as stated in each file",
    columns=(
        FRAME,
        Column(name="band", head="band", form="text"),
        Column(name="visit", head="capture", share=0.7),
        Column(name="i_sq", head="I_sq"),
        Column(name="i_ss", head="I_ss"),
        Column(name="i_ss_oriented", head="as oriented"),
        Column(name="i_ss_basis", head="I_ss is", form="text"),
        Column(name="sunshine_spread_rel", head="s(I_ss) / I_ss", form="percent"),
        Column(name="gradient_rel", head="gradient", form="percent"),
        Column(name="panel_reflectance", head="R of panel"),
        Column(name="reflectance_k", head="K"),
        Column(name="residual_rel", head="deviation", form="percent"),
    ),
    holds_for_lens=False,
    statements=(
        (
            "K belongs to the camera and the sunshine sensor named here as a pair, and to the light of "
            "the day on which the panel was photographed."
        ),
        "Vignetting is corrected as stated in each file for its camera.",
    ),
)
