"""Sharpness: contrast that a camera keeps by spatial frequency, from slanted edges or Siemens stars.

Computed as in ISO 12233:2023 (e-SFR, s-SFR) as implemented by sfrmat5::

    MTF(f) = |F{LSF}(f)| / |F{LSF}(0)|,   LSF = d ESF / dx          f in cycles per pixel of the whole sensor
    RP = n / (pi d)      of a star of n cycles, d the DIAMETER of the disc that is not resolved

The lp/mm of the camera paper's equation 3 are line widths per millimetre of a 24 mm picture, and its d is a
diameter; both are corrected here.
"""

from typing import Final

from radiometry.sharpness import codes, fit, positions, results, verdicts
from radiometry.sharpness.fit import extract
from radiometry.specification import certificate, method, roles
from radiometry.specification.certificate import CertificateText, CoefficientEffect, CoefficientKind, Column

_FREQUENCIES = (
    ("cycles_per_pixel", "cycles/px"),
    ("lp_per_mm", "lp/mm"),
    ("lp_per_ph", "LP/PH"),
    ("lw_per_ph", "LW/PH"),
)

_CERTIFICATE: Final = CertificateText(
    procedure="Modulation transfer function of the camera against spatial frequency, per position and "
    "channel, from slanted edges (ISO 12233, e-SFR) or Siemens stars",
    equation="MTF(f) = |F{LSF}(f)| / |F{LSF}(0)|, where f is in cycles per pixel of the whole sensor",
    headlines=frozenset({"mtf50_cycles_per_pixel", "resolving_power_cycles_per_pixel"}),
    columns=(
        certificate.FRAME,
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

SPEC: Final = method.MethodSpec(
    name="sharpness",
    label="Sharpness",
    description="The MTF from slanted edges or Siemens stars, in the centre and towards the corners.",
    schema_version=1,
    roles=(roles.CHART,),
    params=results.Params,
    result=results.Fit,
    features=results.Features,
    target=results.Target,
    target_example={"kind": "siemens_star", "cycles": 48},
    manual_exposure=False,
    several_regions=True,
    coefficients=(
        *(
            CoefficientKind(name=f"mtf50_{name}", label=f"MTF50 in {unit}", units=(unit,))
            for name, unit in _FREQUENCIES
        ),
        *(
            CoefficientKind(
                name=f"resolving_power_{name}", label=f"Limiting resolution in {unit}", units=(unit,)
            )
            for name, unit in _FREQUENCIES
        ),
        CoefficientKind(name="edge_rise_10_90_px", label="Edge rise 10 to 90 %", units=("px",)),
        CoefficientKind(name="lsf_fwhm_px", label="Width of the line spread function", units=("px",)),
        CoefficientKind(name="mtf_nyquist", label="MTF at the Nyquist frequency", units=("1",)),
        CoefficientKind(name="overshoot", label="Overshoot", units=("1",)),
        CoefficientKind(name="undershoot", label="Undershoot", units=("1",)),
        CoefficientKind(
            name="unresolved_diameter_px", label="Diameter of the unresolved disc", units=("px",)
        ),
        CoefficientKind(
            name="lateral_colour_px", label="Lateral colour against green, outwards", units=("px",)
        ),
        CoefficientKind(
            name="corner_falloff",
            label="Loss towards the corners",
            units=("1",),
            effect=CoefficientEffect(of="of the signal in the corner"),
        ),
    ),
    findings=codes.FINDINGS,
    extract=extract,
    missing=method.drop_readings(positions.missing),
    judge=lambda frames, rows, _, params: verdicts.judge(frames, rows, params),
    plan=method.drop_readings(verdicts.plan),
    grid=roles.Grid(rows="f_number"),
    fit=method.drop_readings(fit.fit),
    list_coefficients=fit.list_coefficients,
    list_key_figures=results.list_key_figures,
    plots=results.PLOTS,
    certificate=_CERTIFICATE,
)
