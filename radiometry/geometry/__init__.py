"""Geometry: principal distance, principal point and distortion of a camera, from pictures of a board.

A direction (X/Z, Y/Z), distorted by k1, k2, k3, p1, p2 to (x', y'), appears at::

    col = fx x' + cx,  row = fy y' + cy

Corners of a checkerboard or ChArUco board in three views or more, best in ten, are fitted together with the
board's pose in each: Z. Zhang, A flexible new technique for camera calibration, IEEE TPAMI 22(11), 2000. The
distortion is Brown's (1966), in OpenCV's notation.
"""

from functools import partial
from typing import Final

from radiometry.geometry import codes, fit, results, verdicts, views
from radiometry.geometry.camera import DISTORTION, UNITS, move_corner, require_size, undistort_frame
from radiometry.geometry.exports import EXPORTS, RIG_EXPORTS
from radiometry.geometry.rig import adjustment, orientation
from radiometry.geometry.target import Target
from radiometry.specification import application, certificate, method, roles
from radiometry.specification.certificate import CertificateText, CoefficientEffect, CoefficientKind, Column
from radiometry.specification.exports import RigSpec

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

_CERTIFICATE: Final = CertificateText(
    procedure="Principal distance, principal point and distortion of the camera, from views of a plane "
    "board; camera parameters and poses fitted by least squares over all corners",
    equation="col = fx x' + cx, row = fy y' + cy, where (x', y') is the direction distorted by k1, k2, k3, "
    "p1, p2",
    headlines=frozenset({"fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "p1", "p2", "rms_px"}),
    columns=(
        certificate.FRAME,
        Column(name="corners", head="corners", share=0.8),
        Column(name="rms_px", head="rms [px]"),
        Column(name="largest_px", head="largest [px]"),
        Column(name="tilt_deg", head="tilt [°]"),
        Column(name="distance_mm", head="distance [mm]"),
        Column(name="edge_rise_px", head="edge rise [px]"),
    ),
    traceability="Values in pixels depend on the board's shape, not on its size; no external standard "
    "enters. Distances depend on the stated square size and pixel pitch.",
)

SPEC: Final = method.MethodSpec(
    name="geometry",
    label="Geometry",
    description="Focal length, principal point and distortion, from views of a plane board.",
    schema_version=1,
    roles=(roles.CHART,),
    params=results.Params,
    result=results.Fit,
    features=results.Features,
    target=Target,
    target_example={"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25.0},
    whole_frame=True,
    manual_exposure=False,
    check_features=verdicts.check_features,
    tolerance_unit="px",
    coefficients=(
        *(
            CoefficientKind(name=name, label=_LABELS.get(name, name), units=(unit,), effect=_MOVED.get(name))
            for name, unit in UNITS.items()
        ),
        CoefficientKind(name="rms_px", label="Root mean square residual", units=("px",)),
        CoefficientKind(
            name="lateral_colour_px", label="Lateral colour against green, in the corner", units=("px",)
        ),
    ),
    findings=codes.FINDINGS,
    extract=lambda frame, regions, *, header, target, **_: results.extract_features(
        frame, regions, header=header, target=target
    ),
    missing=method.drop_readings(views.missing),
    judge=lambda frames, rows, _readings, _params: verdicts.judge_frames(frames, rows),
    plan=method.drop_readings(verdicts.plan_views),
    find_gaps=method.drop_readings(verdicts.find_gaps),
    fit=method.drop_readings(fit.fit_geometry),
    list_coefficients=fit.list_coefficients,
    list_key_figures=results.list_key_figures,
    plots=results.PLOTS,
    certificate=_CERTIFICATE,
    exports=EXPORTS,
    rig=RigSpec(
        result=adjustment.RigFit,
        orient=orientation.orient_members,
        count_shared=orientation.count_shared,
        list_quantities=orientation.list_quantities,
        exports=RIG_EXPORTS,
    ),
    application=application.PictureApplication(
        quantity="undistorted picture",
        unit="DN",
        summarise=lambda result: application.Summary(
            signal="".join(result["undistorted"]["planes"]),
            measured="undistorted picture",
            column=None,
            vignetting="none",
            figures={"undistorted": result["undistorted"]},
        ),
        require_size=require_size,
        undistort_frame=undistort_frame,
    ),
    applied="camera",
)
