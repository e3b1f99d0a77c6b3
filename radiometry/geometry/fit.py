"""Geometry of a camera from its pictures of a board."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import CoefficientValue, Quantity
from radiometry.geometry.bundle import Pose, Solution, choose_free_parameters, find_pose, require_determined
from radiometry.geometry.camera import MODEL, PARAMETERS, UNITS, project
from radiometry.geometry.colour import ColourView, LateralColour, fit_colour
from radiometry.geometry.coverage import find_covered_radius_px, measure_coverage, measure_tilt_deg
from radiometry.geometry.curve import compute_curve
from radiometry.geometry.features import Features
from radiometry.geometry.findings import check_colours, check_solution, check_views
from radiometry.geometry.results import Coefficient, Fit, Point
from radiometry.geometry.rows import FrameRow, Params
from radiometry.geometry.target import Target
from radiometry.geometry.views import (
    Candidate,
    FittedViews,
    collect_candidates,
    fit_views,
    make_view,
    measure_rms_px,
    missing,
)

_FIGURES = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "p1", "p2")


def fit_geometry(rows: Sequence[FrameRow], params: Params) -> Fit:
    """Fit camera and poses to the corners of all views.

    Returns
    -------
    Fit
        Camera, points and flags.

    Raises
    ------
    InputRejected
        `fit_incomplete` if fewer than three views can be used, or frames wait to be
        read; `fit_failed` if the views do not determine the camera.

    Notes
    -----
    The same input in any order gives the same result to the last bit. All numbers are finite; what does not
    exist is None.

    Flags of the whole fit: coverage_poor, tilt_poor, few_views, corner_window_wide, reprojection_large,
    pixels_not_square, distortion_folds, rendered. Flags per frame: view_outlier, view_mirrored,
    mirror_not_excluded.
    """
    lacking = missing(rows, params)
    if lacking:
        raise InputRejected(shared.FIT_INCOMPLETE, f"The fit cannot start: {'; '.join(lacking)}.")
    candidates = collect_candidates(rows, params)
    free = choose_free_parameters(
        fix_aspect_ratio=params.fix_aspect_ratio,
        radial_terms=params.radial_terms,
        tangential=params.tangential,
    )
    fitted = fit_views(candidates, params, free)
    require_determined(fitted.solution)
    points = _describe_points(candidates, fitted, params)
    return _build(fitted, points, params)


def list_coefficients(fit: Fit) -> tuple[CoefficientValue, ...]:
    """Return the coefficients as dashboards show them."""
    listed: list[tuple[str, Coefficient | Quantity, str | None, int | None]] = [
        (each.name, each, None, fit.degrees_of_freedom if each.standard_uncertainty else None)
        for each in fit.coefficients
    ]
    listed += [
        ("lateral_colour_px", each.corner, each.channels, each.views - 1) for each in fit.lateral_colour or ()
    ]
    return tuple(
        CoefficientValue(
            name=name,
            value=each.value,
            standard_uncertainty=each.standard_uncertainty,
            unit=each.unit,
            model=fit.model,
            channel=channel,
            effective_dof=dof,
        )
        for name, each, channel, dof in listed
    )


def _build(fitted: FittedViews, points: tuple[Point, ...], params: Params) -> Fit:
    solution, camera = fitted.solution, fitted.solution.camera
    seen = [make_view(_features(each), params).seen_px for each in fitted.used]
    coverage = measure_coverage(camera, seen)
    errors = dict(zip(PARAMETERS, np.sqrt(np.diag(solution.covariance)).tolist(), strict=True))
    middle_row, middle_col = camera.centre_px
    colours = _fit_colours(fitted)
    offset_row = Quantity(
        value=camera.cy_px - middle_row, standard_uncertainty=errors["cy_px"], unit=UNITS["cy_px"]
    )
    offset_col = Quantity(
        value=camera.cx_px - middle_col, standard_uncertainty=errors["cx_px"], unit=UNITS["cx_px"]
    )
    return Fit(
        model=MODEL,
        target=_board(fitted),
        corner_window=params.corner_window,
        pixel_pitch_um=params.pixel_pitch_um,
        camera=camera,
        coefficients=_list_coefficients(solution, errors),
        covariance=tuple(tuple(float(value) for value in row) for row in solution.covariance),
        rms_px=solution.rms_px,
        views=len(fitted.used),
        corners=sum(len(places) for places in seen),
        degrees_of_freedom=solution.degrees_of_freedom,
        principal_distance_mm=_measure_distance(solution, params),
        offset_row=offset_row,
        offset_col=offset_col,
        offset_row_um=_scale(offset_row, params.pixel_pitch_um),
        offset_col_um=_scale(offset_col, params.pixel_pitch_um),
        curve=compute_curve(
            camera,
            solution.covariance,
            pixel_pitch_um=params.pixel_pitch_um,
            covered_radius_px=find_covered_radius_px(camera, seen),
        ),
        coverage=coverage,
        points=points,
        flags=(
            *check_views(fitted, points, params),
            *check_solution(solution, coverage),
            *check_colours(colours),
        ),
        lateral_colour=colours or None,
    )


def _fit_colours(fitted: FittedViews) -> tuple[LateralColour, ...]:
    views: dict[str, list[ColourView]] = {}
    for each in fitted.used:
        features = _features(each)
        for colour in features.colours or ():
            view = ColourView(np.array(features.fitted_px), np.array(colour.moved_px))
            views.setdefault(colour.channel, []).append(view)
    fits = (fit_colour(mine, fitted.solution.camera, channel=name) for name, mine in sorted(views.items()))
    return tuple(each for each in fits if each)


def _board(fitted: FittedViews) -> Target:
    return _features(fitted.used[0]).target


def _features(candidate: Candidate) -> Features:
    if candidate.features is None:
        raise ValueError(f"{candidate.row.frame} has no features")
    return candidate.features


def _list_coefficients(solution: Solution, errors: dict[str, float]) -> tuple[Coefficient, ...]:
    """Return the parameters, and the rms with the standard error of a standard deviation, s / sqrt(2 v)."""
    listed = [
        Coefficient(
            name=name,
            value=float(getattr(solution.camera, name)),
            standard_uncertainty=errors[name],
            unit=UNITS[name],
        )
        for name in _FIGURES
    ]
    rms = Coefficient(
        name="rms_px",
        value=solution.rms_px,
        standard_uncertainty=solution.rms_px / math.sqrt(2.0 * solution.degrees_of_freedom),
        unit="px",
    )
    return (*listed, rms)


def _measure_distance(solution: Solution, params: Params) -> Quantity | None:
    """Return c = f s_p, f the mean of fx and fy."""
    if params.pixel_pitch_um is None:
        return None
    mm_per_px = params.pixel_pitch_um / 1000.0
    variance = float(solution.covariance[:2, :2].sum()) / 4.0
    return Quantity(
        value=(solution.camera.fx_px + solution.camera.fy_px) / 2.0 * mm_per_px,
        standard_uncertainty=math.sqrt(variance) * mm_per_px,
        unit="mm",
    )


def _scale(offset: Quantity, pixel_pitch_um: float | None) -> Quantity | None:
    if pixel_pitch_um is None:
        return None
    return Quantity(
        value=offset.value * pixel_pitch_um,
        standard_uncertainty=offset.standard_uncertainty * pixel_pitch_um,
        unit="um",
    )


def _describe_points(
    candidates: Sequence[Candidate], fitted: FittedViews, params: Params
) -> tuple[Point, ...]:
    solution = fitted.solution
    used = {
        candidate.row.frame: (pose, residual)
        for candidate, pose, residual in zip(fitted.used, solution.poses, solution.residuals_px, strict=True)
    }
    rejected = {each.candidate.row.frame: each.why for each in fitted.rejected}
    points = []
    for each in candidates:
        name, features = each.row.frame, each.features
        if features is not None and name in rejected:
            view = make_view(features, params)
            pose = find_pose(solution.camera, view)
            residual = view.seen_px - project(solution.camera, view.points_mm, pose.rotation, pose.shift)
            points.append(_describe(each, features, rejected[name], pose, residual))
        elif features is not None and name in used:
            points.append(_describe(each, features, "", *used[name]))
        else:
            points.append(Point(frame=name, used=False, left_out=each.left_out, corners=_count(features)))
    return tuple(points)


def _count(features: Features | None) -> int:
    return len(features.indices) if features else 0


def _describe(
    candidate: Candidate,
    features: Features,
    left_out: str,
    pose: Pose,
    residual: NDArray[np.float64],
) -> Point:
    return Point(
        frame=candidate.row.frame,
        used=not left_out,
        left_out=left_out,
        corners=len(features.indices),
        rms_px=measure_rms_px(residual),
        largest_px=float(np.linalg.norm(residual, axis=1).max()),
        tilt_deg=measure_tilt_deg(pose),
        distance_mm=float(np.linalg.norm(pose.shift)),
        spacing_px=features.spacing_px,
        edge_rise_px=features.edge_rise_px,
    )
