"""Reflectance method: its specification; `radiometry.reflectance.method` exports its functions."""

from typing import Final

from radiometry.reflectance import codes, method
from radiometry.reflectance.applying import APPLICATION
from radiometry.reflectance.budget import list_budgets
from radiometry.reflectance.certificate import CERTIFICATE
from radiometry.reflectance.features import Features
from radiometry.reflectance.findings import review_frame
from radiometry.reflectance.key_figures import list_key_figures
from radiometry.reflectance.panel_transfer import take_region
from radiometry.reflectance.plots import PLOTS
from radiometry.reflectance.results import Fit
from radiometry.reflectance.rows import Params, Reading
from radiometry.reflectance.sunshine import measure_sunshine
from radiometry.reflectance.verdicts import judge, plan
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
    params=Params,
    result=Fit,
    features=Features,
    reference="panel",
    reading=Reading,
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
    check_frame=review_frame,
    extract=drop_target(method.extract),
    find_region=method.find_region,
    take_region=take_region,
    make_row=method.make_row,
    missing=method.missing,
    judge=judge,
    plan=plan,
    grid=Grid(rows="capture_id", columns=("band",)),
    fit=method.fit,
    list_coefficients=method.list_coefficients,
    list_key_figures=list_key_figures,
    plots=PLOTS,
    of_one_flight=True,
    certificate=CERTIFICATE,
    application=APPLICATION,
    applied="band_fits",
    measure_light=measure_sunshine,
    list_budgets=list_budgets,
    configure=method.configure,
)
