"""The camera's geometry from pictures of a board: principal distance, principal point, distortion."""

from functools import partial
from typing import Final

from radiometry.geometry import codes, method
from radiometry.geometry.camera import UNITS
from radiometry.geometry.certificate import CERTIFICATE, RIG_CERTIFICATE
from radiometry.geometry.effects import DISTORTION, move_corner
from radiometry.geometry.features import Features
from radiometry.geometry.fit import fit_geometry, list_coefficients
from radiometry.geometry.key_figures import list_key_figures
from radiometry.geometry.plots import PLOTS
from radiometry.geometry.results import Fit
from radiometry.geometry.rig.codes import FINDINGS as RIG_FINDINGS
from radiometry.geometry.rig.exports import EXPORTS as RIG_EXPORTS
from radiometry.geometry.rig.members import count_shared, list_quantities, orient_members
from radiometry.geometry.rig.results import RigFit
from radiometry.geometry.rows import Params
from radiometry.geometry.suggestions import find_gaps, plan_views
from radiometry.geometry.target import Target
from radiometry.geometry.undistortion import require_size, undistort_frame
from radiometry.geometry.verdicts import check_features
from radiometry.geometry.views import missing
from radiometry.geometry.written import EXPORTS
from radiometry.specification.application import PictureApplication
from radiometry.specification.coefficients import CoefficientEffect, CoefficientKind
from radiometry.specification.method import MethodSpec, drop_readings
from radiometry.specification.rig import RigSpec
from radiometry.specification.roles import CHART

__all__ = ["SPEC"]

_LABELS: Final = {
    "fx_px": "Focal length fx",
    "fy_px": "Focal length fy",
    "cx_px": "Principal point cx",
    "cy_px": "Principal point cy",
}

_MOVED: Final = {
    name: CoefficientEffect(of="in the corner of the frame", unit="px", factor=partial(move_corner, name))
    for name in DISTORTION
}

SPEC: Final = MethodSpec(
    name="geometry",
    label="Geometry",
    description="Focal length, principal point and distortion, from views of a plane board.",
    schema_version=1,
    roles=(CHART,),
    params=Params,
    result=Fit,
    features=Features,
    target=Target,
    target_example={"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25.0},
    whole_frame=True,
    manual_exposure=False,
    check_features=check_features,
    tolerance_unit="px",
    coefficients=(
        *(
            CoefficientKind(
                name=name,
                label=_LABELS.get(name, name),
                units=(unit,),
                effect=_MOVED.get(name),
            )
            for name, unit in UNITS.items()
        ),
        CoefficientKind(name="rms_px", label="Root mean square residual", units=("px",)),
        CoefficientKind(
            name="lateral_colour_px", label="Lateral colour against green, in the corner", units=("px",)
        ),
    ),
    findings=(*codes.FINDINGS, *RIG_FINDINGS),
    extract=method.extract,
    missing=drop_readings(missing),
    judge=lambda frames, rows, _, params: method.judge(frames, rows, params),
    plan=drop_readings(plan_views),
    find_gaps=drop_readings(find_gaps),
    fit=drop_readings(fit_geometry),
    list_coefficients=list_coefficients,
    list_key_figures=list_key_figures,
    plots=PLOTS,
    certificate=CERTIFICATE,
    exports=EXPORTS,
    rig=RigSpec(
        result=RigFit,
        orient=orient_members,
        count_shared=count_shared,
        list_quantities=list_quantities,
        certificate=RIG_CERTIFICATE,
        exports=RIG_EXPORTS,
    ),
    application=PictureApplication(
        quantity="undistorted picture",
        unit="DN",
        require_size=require_size,
        undistort_frame=undistort_frame,
    ),
    applied="camera",
)
