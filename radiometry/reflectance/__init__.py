"""Reflectance method: its specification; `radiometry.reflectance.method` exports its functions."""

from typing import Final

from radiometry.reflectance import codes, method
from radiometry.reflectance.applying import APPLICATION
from radiometry.reflectance.budget import list_budgets
from radiometry.reflectance.certificate import CERTIFICATE
from radiometry.reflectance.key_figures import list_key_figures
from radiometry.reflectance.plots import PLOTS
from radiometry.specification.coefficients import CoefficientEffect, CoefficientKind
from radiometry.specification.grid import Grid
from radiometry.specification.method import MethodSpec, drop_target
from radiometry.specification.roles import FIELD, PANEL

__all__ = ["SPEC"]

SPEC: Final = MethodSpec(
    name="reflectance",
    label="Reflectance",
    description="The coefficient K of each band of a multispectral camera with its sunshine sensor, from a "
    "panel of known reflectance.",
    schema_version=1,
    roles=(PANEL,),
    applied_roles=(FIELD,),
    params=method.Params,
    result=method.Fit,
    features=method.Features,
    reference="panel",
    reading=method.Reading,
    finds_region=True,
    manual_exposure=False,
    coefficients=(
        CoefficientKind(
            name="reflectance_k",
            label="Reflectance K",
            units=("1/s", "1", "sr", "m2*sr*nm/W", "s"),
            effect=CoefficientEffect(of="of the reflectance"),
        ),
    ),
    findings=codes.FINDINGS,
    check_frame=method.review_frame,
    extract=drop_target(method.extract),
    find_region=method.find_region,
    take_region=method.take_region,
    make_row=method.make_row,
    missing=method.missing,
    judge=method.judge,
    plan=method.plan,
    grid=Grid(rows="capture_id", columns=("band",)),
    fit=method.fit,
    list_coefficients=method.list_coefficients,
    list_key_figures=list_key_figures,
    plots=PLOTS,
    draws_flight=True,
    certificate=CERTIFICATE,
    application=APPLICATION,
    applied="band_fits",
    measure_light=method.measure_sunshine,
    list_budgets=list_budgets,
    configure=method.configure,
)
