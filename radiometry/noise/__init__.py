"""Noise: characterisation after EMVA 1288 by ISO value and channel, from stacks of equal frames.

The photon transfer gives the system gain K [DN/e-] (EMVA Standard 1288, release 3.1)::

    sigma_y^2 - sigma_y.dark^2 = K (mu_y - mu_y.dark)

Read noise, saturation capacity, dynamic range and SNR follow from it; linearity, dark current, DSNU and
PRNU are added. The photon flux of the standard is left out: light is not measured here, so there is no
quantum efficiency and no threshold in photons.
"""

from typing import Final

from radiometry.noise import codes, fit, results, verdicts
from radiometry.noise import fit as noise_fit
from radiometry.specification import certificate, method, roles

_CERTIFICATE: Final = certificate.CertificateText(
    procedure="Temporal noise, system gain, linearity and nonuniformity per ISO value and channel, from "
    "stacks of frames with equal settings, by the definitions of EMVA 1288",
    equation="var_y - var_dark = K (mu_y - mu_dark)",
    headlines=frozenset({"system_gain_dn_per_e", "read_noise_e", "full_well_e", "dynamic_range_stops"}),
    columns=(
        certificate.FRAME,
        certificate.Column(name="channel", head="channel", form="text", share=0.8),
        certificate.Column(name="role", head="role", form="text", share=0.7),
        certificate.Column(name="iso", head="ISO", share=0.8),
        certificate.Column(name="exposure_time_s", head="t [s]"),
        certificate.Column(name="mean_dn", head="mean [DN]", share=1.2),
        certificate.Column(name="clipped_share", head="clipped", form="percent"),
        certificate.Column(name="frames_of_setting", head="frames in stack"),
    ),
    traceability="Numbers of electrons follow from the statistics of the light itself; no external standard "
    "enters.",
    holds_for_lens=False,
)

SPEC: Final = method.MethodSpec(
    name="noise",
    label="Noise and linearity",
    description="System gain, read noise, dynamic range and linearity, from pairs of equal frames.",
    schema_version=1,
    roles=(roles.FLAT, roles.LIGHT, roles.DARK),
    params=results.Params,
    result=results.Fit,
    features=results.Features,
    whole_frame=True,
    coefficients=noise_fit.COEFFICIENTS,
    findings=codes.FINDINGS,
    extract=lambda frame, regions, *, header, **_: results.extract_features(frame, regions, header=header),
    missing=method.drop_readings(fit.missing),
    judge=lambda frames, rows, _, params: verdicts.judge(frames, rows, params),
    plan=method.drop_readings(verdicts.plan),
    grid=roles.Grid(rows="exposure_time_s", columns=("iso",)),
    find_gaps=method.drop_readings(verdicts.find_gaps),
    fit=method.drop_readings(noise_fit.fit),
    list_coefficients=noise_fit.list_coefficients,
    list_key_figures=results.list_key_figures,
    plots=results.PLOTS,
    certificate=_CERTIFICATE,
)
