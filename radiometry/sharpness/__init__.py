"""Sharpness: the response to slanted edges and Siemens stars, in cycles per pixel."""

from typing import Final

from radiometry.sharpness import codes, method
from radiometry.sharpness.candidates import missing
from radiometry.sharpness.certificate import CERTIFICATE
from radiometry.sharpness.features import Features
from radiometry.sharpness.key_figures import list_key_figures
from radiometry.sharpness.plots import PLOTS
from radiometry.sharpness.results import Fit
from radiometry.sharpness.rows import Params, Target
from radiometry.sharpness.verdicts import judge, plan
from radiometry.specification.coefficients import CoefficientEffect, CoefficientKind
from radiometry.specification.grid import Grid
from radiometry.specification.method import MethodSpec, drop_readings
from radiometry.specification.roles import CHART

__all__ = ["SPEC"]

_FREQUENCIES = (
    ("cycles_per_pixel", "cycles/px"),
    ("lp_per_mm", "lp/mm"),
    ("lp_per_ph", "LP/PH"),
    ("lw_per_ph", "LW/PH"),
)

SPEC: Final = MethodSpec(
    name="sharpness",
    label="Sharpness",
    description="The MTF from slanted edges or Siemens stars, in the centre and towards the corners.",
    schema_version=1,
    roles=(CHART,),
    params=Params,
    result=Fit,
    features=Features,
    target=Target,
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
    extract=method.extract,
    missing=drop_readings(missing),
    judge=lambda frames, rows, _, params: judge(frames, rows, params),
    plan=drop_readings(plan),
    grid=Grid(rows="f_number"),
    fit=drop_readings(method.fit),
    list_coefficients=method.list_coefficients,
    list_key_figures=list_key_figures,
    plots=PLOTS,
    certificate=CERTIFICATE,
)
