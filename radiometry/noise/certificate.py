"""Certificate text of a noise calibration."""

from typing import Final

from radiometry.specification.certificate import FRAME, CertificateText, Column

CERTIFICATE: Final = CertificateText(
    procedure="Temporal noise, system gain, linearity and nonuniformity per ISO value and channel, from "
    "stacks of frames with equal settings, by the definitions of EMVA 1288",
    equation="var_y - var_dark = K (mu_y - mu_dark)",
    headlines=frozenset({"system_gain_dn_per_e", "read_noise_e", "full_well_e", "dynamic_range_stops"}),
    columns=(
        FRAME,
        Column(name="channel", head="channel", form="text", share=0.8),
        Column(name="role", head="role", form="text", share=0.7),
        Column(name="iso", head="ISO", share=0.8),
        Column(name="exposure_time_s", head="t [s]"),
        Column(name="mean_dn", head="mean [DN]", share=1.2),
        Column(name="clipped_share", head="clipped", form="percent"),
        Column(name="frames_of_setting", head="frames in stack"),
    ),
    traceability="Numbers of electrons follow from the statistics of the light itself; no external standard "
    "enters.",
    holds_for_lens=False,
)
