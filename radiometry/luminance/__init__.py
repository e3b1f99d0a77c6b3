"""Luminance method: its specification; `radiometry.luminance.method` exports its functions."""

from typing import Final

from radiometry.findings import shared
from radiometry.fitting.evidence import Extracted
from radiometry.frame.statistics import state_row
from radiometry.luminance import codes, method
from radiometry.luminance.applying import APPLICATION
from radiometry.luminance.budget import explain_budget
from radiometry.luminance.certificate import CERTIFICATE
from radiometry.luminance.gaps import find_gaps
from radiometry.luminance.key_figures import list_key_figures
from radiometry.luminance.plots import PLOTS, split
from radiometry.luminance.results import Fit
from radiometry.luminance.rows import Params, Reading
from radiometry.luminance.suggestions import plan
from radiometry.luminance.verdicts import judge
from radiometry.specification.coefficients import Budget, CoefficientEffect, CoefficientKind
from radiometry.specification.grid import Grid
from radiometry.specification.method import MethodSpec
from radiometry.specification.roles import DARK, LIGHT

__all__ = ["SPEC"]

SPEC: Final = MethodSpec(
    name="luminance",
    label="Luminance",
    description="The coefficient K, per ISO value, that converts raw signal into cd/m², from lit surfaces "
    "with a luminance meter's readings, and dark frames.",
    schema_version=1,
    roles=(LIGHT, DARK),
    params=Params,
    result=Fit,
    reference="meter",
    has_checklist=True,
    reading=Reading,
    passed_on=(
        codes.METER_CERTIFICATE_MISSING,
        codes.OFFSET_SIGNIFICANT,
        shared.SCATTER_IMPLAUSIBLE,
        shared.BLACK_LEVEL_ASSUMED,
        shared.STATISTICS_FROM_TABLE,
    ),
    untraced=codes.METER_CERTIFICATE_MISSING,
    coefficients=(
        CoefficientKind(
            name="luminance_k",
            label="Luminance K",
            units=("DN*m2/(cd*s)",),
            effect=CoefficientEffect(of="of the luminance"),
        ),
        CoefficientKind(name="dark_signal_dn", label="Dark signal", units=("DN",)),
    ),
    findings=codes.FINDINGS,
    extract=lambda frame, regions, *, header, **_: Extracted(
        statistics=method.extract(frame, regions[0].polygon)
        if header.table is None
        else (state_row(header.table),),
        features=None,
    ),
    make_row=method.make_row,
    missing=method.missing,
    judge=judge,
    plan=plan,
    grid=Grid(rows="scene", columns=("iso", "f_number")),
    find_gaps=find_gaps,
    fit=method.fit,
    list_coefficients=method.list_coefficients,
    list_key_figures=list_key_figures,
    plots=PLOTS,
    split=split,
    certificate=CERTIFICATE,
    application=APPLICATION,
    applied="iso_fits",
    list_budgets=lambda fitted: tuple(
        Budget(holds_for={"iso": fit.coefficient.iso}, lines=explain_budget(fit)) for fit in fitted.iso_fits
    ),
)
