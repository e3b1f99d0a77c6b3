"""The parts of the vignetting calibration; `radiometry.vignetting.method` is its door."""

from typing import Final

from radiometry.specification.application import Correction
from radiometry.specification.coefficients import CoefficientEffect, CoefficientKind
from radiometry.specification.grid import Grid
from radiometry.specification.method import MethodSpec, drop_readings, drop_target
from radiometry.specification.roles import DARK, FLAT
from radiometry.vignetting import codes, method
from radiometry.vignetting.budget import list_budgets
from radiometry.vignetting.certificate import CERTIFICATE
from radiometry.vignetting.features import Features
from radiometry.vignetting.key_figures import list_key_figures
from radiometry.vignetting.lens import Lens, average_over_polygon
from radiometry.vignetting.plots import PLOTS
from radiometry.vignetting.points import missing
from radiometry.vignetting.results import Fit
from radiometry.vignetting.rows import Params
from radiometry.vignetting.suggestions import find_gaps, plan
from radiometry.vignetting.verdicts import judge
from radiometry.vignetting.written import EXPORTS

__all__ = ["SPEC"]

_IN_CORNER: Final = CoefficientEffect(of="of the signal in the corner", factor=lambda _: 100.0)

SPEC: Final = MethodSpec(
    name="vignetting",
    label="Vignetting",
    description="The light falloff of a lens towards the corners, per f-number, from flat fields.",
    schema_version=1,
    roles=(FLAT, DARK),
    params=Params,
    result=Fit,
    features=Features,
    whole_frame=True,
    several_regions=True,
    coefficients=(
        CoefficientKind(name="corner_falloff", label="Corner falloff", units=("1",), effect=_IN_CORNER),
        CoefficientKind(name="k1", label="k1", units=("1",), effect=_IN_CORNER),
        CoefficientKind(name="k2", label="k2", units=("1",), effect=_IN_CORNER),
        CoefficientKind(name="k3", label="k3", units=("1",), effect=_IN_CORNER),
        CoefficientKind(name="centre_row_px", label="Centre row", units=("px",)),
        CoefficientKind(name="centre_col_px", label="Centre column", units=("px",)),
    ),
    findings=codes.FINDINGS,
    extract=drop_target(method.extract),
    missing=drop_readings(missing),
    judge=lambda frames, rows, _, params: judge(frames, rows, params),
    plan=drop_readings(plan),
    grid=Grid(rows="f_number"),
    find_gaps=drop_readings(find_gaps),
    fit=drop_readings(method.fit),
    list_coefficients=method.list_coefficients,
    list_key_figures=list_key_figures,
    list_budgets=list_budgets,
    plots=PLOTS,
    certificate=CERTIFICATE,
    exports=EXPORTS,
    applied="channel_fits",
    correction=Correction(lens=Lens, average_over_polygon=average_over_polygon),
)
