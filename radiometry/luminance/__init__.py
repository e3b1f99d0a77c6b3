"""Luminance method: its specification; `radiometry.luminance.method` exports its functions."""

from typing import Final

from radiometry.findings import shared
from radiometry.fitting.evidence import Extracted
from radiometry.frame.statistics import state_row
from radiometry.luminance import application, codes, maps, measurement, method, suggestions, surface, verdicts
from radiometry.luminance.presentation import CERTIFICATE, PLOTS, explain_budget, list_key_figures
from radiometry.luminance.results import Fit
from radiometry.luminance.rows import FieldConditions, Params, Reading
from radiometry.specification.application import SurfaceApplication
from radiometry.specification.certificate import Budget, CoefficientEffect, CoefficientKind
from radiometry.specification.method import MethodSpec
from radiometry.specification.roles import DARK, LIGHT, Grid

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
    judge=verdicts.judge,
    plan=suggestions.plan,
    grid=Grid(rows="scene", columns=("iso", "f_number")),
    find_gaps=suggestions.find_gaps,
    fit=method.fit,
    list_coefficients=method.list_coefficients,
    list_key_figures=list_key_figures,
    plots=PLOTS,
    certificate=CERTIFICATE,
    application=SurfaceApplication(
        quantity="luminance",
        summarise=measurement.summarise,
        unit="cd/m2",
        options=("grid", "reflectance", "frame_ids"),
        conditions=FieldConditions,
        name_channels=maps.name_channels,
        choose_coefficient=application.choose_coefficient,
        request=measurement.Request,
        correction=measurement.Vignetting,
        outline=surface.outline,
        check_grid=surface.check_grid,
        find_window=measurement.find_window,
        find_map_scale=maps.find_map_scale,
        needs_scale=measurement.needs_scale,
        measure=measurement.measure,
        compute_map=maps.compute_map,
        change=application.change_luminance,
        foresee=application.foresee_k,
        unforeseen=codes.F_NUMBER_NOT_CALIBRATED,
        rim_px=maps.RIM_PX,
    ),
    applied="iso_fits",
    list_budgets=lambda fitted: tuple(
        Budget(holds_for={"iso": fit.coefficient.iso}, lines=explain_budget(fit)) for fit in fitted.iso_fits
    ),
)
