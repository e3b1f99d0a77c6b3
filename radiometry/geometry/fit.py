"""Geometry of a camera from its pictures of a board: distortion curve, coverage of the frame, flags."""

import math
import statistics
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Raised, shared
from radiometry.fitting.evidence import CoefficientValue, Quantity, require_complete
from radiometry.frame import opencv, verdicts
from radiometry.geometry import codes, results
from radiometry.geometry.camera import (
    MODEL,
    PARAMETERS,
    UNITS,
    CameraModel,
    Pose,
    Solution,
    choose_free_parameters,
    find_pose,
    project,
    require_determined,
)
from radiometry.geometry.views import (
    Candidate,
    FittedViews,
    collect_candidates,
    fit_views,
    make_view,
    measure_rms_px,
    missing,
)

POINTS: Final = 21
_SEARCHED: Final = 2000
# An ideal radius is looked for up to twice the picture's own: barrel distortion draws in at most that.
_SEARCH_BEYOND: Final = 2.0


def find_farthest_radius_px(camera: CameraModel) -> float:
    """Return the distance from the principal point to the frame's farthest corner pixel."""
    rows = max(camera.cy_px, camera.height_px - 1 - camera.cy_px)
    cols = max(camera.cx_px, camera.width_px - 1 - camera.cx_px)
    return float(np.hypot(rows, cols))


def compute_curve(
    camera: CameraModel,
    covariance: NDArray[np.float64],
    *,
    pixel_pitch_um: float | None,
    covered_radius_px: float,
) -> tuple[results.CurvePoint, ...]:
    """Compute the distortion from the principal point to the frame's farthest corner.

    d(R) = R (k1 s^2 + k2 s^4 + k3 s^6),   s = R / f,   f = (fx + fy) / 2

    R is the ideal radius [px], R + d the radius in the picture; u(d)^2 = g^T C g with g the derivatives of
    d in fx, fy, k1, k2, k3 at fixed R. Where the model turns back before it reaches the corner, the curve
    ends there.
    """
    ideal = np.linspace(0.0, find_ideal_corner_px(camera), POINTS)
    distortion = distort_radially(camera, ideal)
    uncertain = _propagate(camera, covariance, ideal)
    pitch = pixel_pitch_um
    return tuple(
        results.CurvePoint(
            radius_px=float(radius + moved),
            ideal_radius_px=float(radius),
            distortion_px=float(moved),
            standard_uncertainty_px=float(u),
            distortion_um=None if pitch is None else float(moved * pitch),
            standard_uncertainty_um=None if pitch is None else float(u * pitch),
            extrapolated=bool(radius + moved > covered_radius_px),
        )
        for radius, moved, u in zip(ideal, distortion, uncertain, strict=True)
    )


def distort_radially(camera: CameraModel, ideal_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute how far a place at an ideal radius is moved outwards [px]."""
    s2 = (ideal_px / _focal_px(camera)) ** 2
    return np.asarray(ideal_px * s2 * (camera.k1 + s2 * (camera.k2 + s2 * camera.k3)), np.float64)


def find_turning_radius_px(camera: CameraModel) -> float | None:
    """Find the radius in the picture at which the model turns back.

    Beyond it two directions share a place. This occurs with no camera, only with a polynomial that no data
    constrain there.
    """
    ideal = np.linspace(0.0, _SEARCH_BEYOND * find_farthest_radius_px(camera), _SEARCHED)
    shown = ideal + distort_radially(camera, ideal)
    falls = np.flatnonzero(np.diff(shown) <= 0.0)
    if not len(falls) or shown[falls[0]] >= find_farthest_radius_px(camera):
        return None
    return float(shown[falls[0]])


def find_ideal_corner_px(camera: CameraModel) -> float:
    """Return the ideal radius of what the frame's farthest corner shows, or of where the model turns back."""
    farthest = find_farthest_radius_px(camera)
    ideal = np.linspace(0.0, _SEARCH_BEYOND * farthest, _SEARCHED)
    shown = ideal + distort_radially(camera, ideal)
    falls = np.flatnonzero(np.diff(shown) <= 0.0)
    rising = slice(0, falls[0] + 1 if len(falls) else len(ideal))
    return float(np.interp(farthest, shown[rising], ideal[rising]))


def _focal_px(camera: CameraModel) -> float:
    return (camera.fx_px + camera.fy_px) / 2.0


def _propagate(
    camera: CameraModel, covariance: NDArray[np.float64], ideal_px: NDArray[np.float64]
) -> NDArray[np.float64]:
    f = _focal_px(camera)
    s2 = (ideal_px / f) ** 2
    slopes = np.zeros((len(ideal_px), len(PARAMETERS)))
    for power, name in enumerate(("k1", "k2", "k3"), start=1):
        slopes[:, PARAMETERS.index(name)] = ideal_px * s2**power
    of_f = -ideal_px / f * s2 * (2.0 * camera.k1 + s2 * (4.0 * camera.k2 + s2 * 6.0 * camera.k3))
    slopes[:, PARAMETERS.index("fx_px")] = slopes[:, PARAMETERS.index("fy_px")] = of_f / 2.0
    variance = np.einsum("ni,ij,nj->n", slopes, covariance, slopes)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)), np.float64)


CELLS: Final = 8
TILTED_DEG: Final = 15.0


def measure_coverage(camera: CameraModel, seen_px: Sequence[NDArray[np.float64]]) -> results.Coverage:
    """Return the counts of corners in a grid of 8 x 8 equal cells over the frame."""
    counts = count_cells(seen_px, height_px=camera.height_px, width_px=camera.width_px)
    farthest = find_covered_radius_px(camera, seen_px)
    return results.Coverage(
        counts=tuple(tuple(int(count) for count in row) for row in counts),
        share=float(np.count_nonzero(counts)) / counts.size,
        radius_share=farthest / find_farthest_radius_px(camera),
    )


def count_cells(
    seen_px: Sequence[NDArray[np.float64]], *, height_px: int, width_px: int
) -> NDArray[np.int64]:
    places = np.concatenate([np.empty((0, 2)), *seen_px])
    cells = ((places + 0.5) / np.array([height_px, width_px]) * CELLS).astype(np.int64)
    counts = np.zeros((CELLS, CELLS), np.int64)
    np.add.at(counts, tuple(np.clip(cells, 0, CELLS - 1).T), 1)
    return counts


def find_covered_radius_px(camera: CameraModel, seen_px: Sequence[NDArray[np.float64]]) -> float:
    """Return the distance from the principal point to the outermost corner [px]."""
    principal = np.array([camera.cy_px, camera.cx_px])
    return max(float(np.linalg.norm(seen - principal, axis=1).max()) for seen in seen_px)


def measure_tilt_deg(pose: Pose) -> float:
    """Compute the angle between a board's normal and the optical axis."""
    return math.degrees(math.acos(min(1.0, abs(float(_normal(pose)[2])))))


def measure_one_sidedness(poses: Sequence[Pose]) -> float:
    """Compute how far the tilted boards all turn about one axis: 0 for all axes alike, 1 for one.

    |mean exp(2 i phi)| over views tilted by 15 degrees or more, phi the direction of the normal in the
    picture: turned left and turned right are one axis.
    """
    normals = [_normal(pose) for pose in poses if measure_tilt_deg(pose) >= TILTED_DEG]
    if not normals:
        return 1.0
    turned = [complex(normal[0], normal[1]) ** 2 for normal in normals]
    return float(abs(np.mean([each / abs(each) for each in turned])))


def _normal(pose: Pose) -> NDArray[np.float64]:
    turned, _ = opencv.cv2.Rodrigues(pose.rotation)
    return np.asarray(turned, np.float64)[:, 2]


GOOD_VIEWS: Final = 10
OUTLIER_RATIO: Final = 3.0
GOOD_SHARE: Final = 0.7
GOOD_RADIUS_SHARE: Final = 0.8
FEWEST_TILTED: Final = 3
MOST_ONE_SIDED: Final = 0.9
LARGEST_RMS_PX: Final = 1.0
LARGEST_COLOUR_PX: Final = 1.0
LARGEST_ASPECT_DIFFERENCE: Final = 0.01
_OUTLIER_FLOOR_PX: Final = 0.3


def check_views(fitted: FittedViews, points: Sequence[results.Point]) -> list[Raised]:
    used = fitted.used
    errors = {point.frame: point.rms_px for point in points if point.used and point.rms_px is not None}
    usual = statistics.median(errors.values())
    flags = [
        codes.VIEW_OUTLIER.at(
            f"frame {frame}", f"It fits to {error:.2f} px, the median view to {usual:.2f} px."
        )
        for frame, error in sorted(errors.items())
        if error > max(OUTLIER_RATIO * usual, _OUTLIER_FLOOR_PX)
    ]
    flags += [
        each.finding.at(f"frame {each.candidate.row.frame}", f"It was left out: {each.why}.")
        for each in fitted.rejected
        if each.finding
    ]
    flags += verdicts.flag_rendered([each.row.header.rendered for each in used])
    flags += _check_mirror(fitted)
    if len(used) < GOOD_VIEWS:
        flags.append(codes.FEW_VIEWS.at("", f"Views: {len(used)}."))
    return flags


def _check_mirror(fitted: FittedViews) -> list[Raised]:
    hidden = fitted.hidden
    if hidden is None or hidden.ratio <= 1.0:
        return []
    row, col = hidden.shift_px
    detail = (
        f"If it were {hidden.words}, the principal point would be wrong by {row:+.2f} px in row and "
        f"{col:+.2f} px in col, {hidden.ratio:.1f} standard uncertainties, and the corners would not show it."
    )
    return [codes.MIRROR_NOT_EXCLUDED.at(f"frame {fitted.used[hidden.number].row.frame}", detail)]


def check_solution(solution: Solution, coverage: results.Coverage) -> list[Raised]:
    flags = _check_coverage(coverage) + _check_tilts(solution) + _check_model(solution.camera)
    if solution.rms_px > LARGEST_RMS_PX:
        flags.append(codes.REPROJECTION_LARGE.at("", f"Root mean square {solution.rms_px:.2f} px."))
    return flags


def check_colours(colours: Sequence[results.LateralColour]) -> list[Raised]:
    flags = []
    for each in colours:
        seen = [point for point in each.curve if not point.extrapolated]
        most = max(seen, key=lambda point: abs(point.displacement_px))
        if abs(most.displacement_px) - 2.0 * most.standard_uncertainty_px > LARGEST_COLOUR_PX:
            detail = (
                f"{each.channels} is {most.displacement_px:+.2f} px at {most.radius_px:.0f} px from the "
                f"principal point (u {most.standard_uncertainty_px:.2f} px)."
            )
            flags.append(shared.LATERAL_COLOUR_LARGE.at(each.channels, detail))
    return flags


def _check_coverage(coverage: results.Coverage) -> list[Raised]:
    if coverage.share >= GOOD_SHARE and coverage.radius_share >= GOOD_RADIUS_SHARE:
        return []
    detail = (
        f"Cells with a corner: {coverage.share:.0%}; the outermost corner lies {coverage.radius_share:.0%} "
        "of the way to the corner of the frame."
    )
    return [codes.COVERAGE_POOR.at("", detail)]


def _check_tilts(solution: Solution) -> list[Raised]:
    tilts = [measure_tilt_deg(pose) for pose in solution.poses]
    tilted = sum(tilt >= TILTED_DEG for tilt in tilts)
    if tilted < FEWEST_TILTED:
        detail = f"Views tilted by {TILTED_DEG:g} degrees or more: {tilted}; the steepest {max(tilts):.0f}."
        return [codes.TILT_POOR.at("", detail)]
    if measure_one_sidedness(solution.poses) > MOST_ONE_SIDED:
        return [codes.TILT_POOR.at("", f"All {tilted} tilted views turn about one axis.")]
    return []


def _check_model(camera: CameraModel) -> list[Raised]:
    flags = []
    aspect = camera.fx_px / camera.fy_px
    if abs(aspect - 1.0) > LARGEST_ASPECT_DIFFERENCE:
        flags.append(codes.PIXELS_NOT_SQUARE.at("", f"fx / fy is {aspect:.4f}."))
    turning = find_turning_radius_px(camera)
    if turning is not None:
        farthest = find_farthest_radius_px(camera)
        detail = (
            f"It turns back {turning:.0f} px from the principal point, the corner lies at {farthest:.0f} px."
        )
        flags.append(codes.DISTORTION_FOLDS.at("", detail))
    return flags


_FIGURES = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "p1", "p2")


def fit_geometry(rows: Sequence[results.FrameRow], params: results.Params) -> results.Fit:
    """Fit camera and poses to the corners of all views.

    The same input in any order gives the same result to the last bit. All numbers are finite; what does not
    exist is None.
    """
    require_complete(missing(rows, params))
    candidates = collect_candidates(rows, params)
    free = choose_free_parameters(
        fix_aspect_ratio=params.fix_aspect_ratio,
        radial_terms=params.radial_terms,
        tangential=params.tangential,
    )
    fitted = fit_views(candidates, params, free)
    require_determined(fitted.solution)
    points = _describe_points(candidates, fitted)
    return _build(fitted, points, params)


def list_coefficients(fit: results.Fit) -> tuple[CoefficientValue, ...]:
    listed: list[tuple[str, results.Coefficient | Quantity, str | None, int | None]] = [
        (each.name, each, None, _find_dof(fit, each) if each.standard_uncertainty else None)
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


def _find_dof(fit: results.Fit, of: results.Coefficient) -> int:
    return fit.degrees_of_freedom if of.name == "rms_px" else fit.effective_dof or fit.degrees_of_freedom


def _build(fitted: FittedViews, points: tuple[results.Point, ...], params: results.Params) -> results.Fit:
    solution, camera = fitted.solution, fitted.solution.camera
    seen = [make_view(_features(each)).seen_px for each in fitted.used]
    coverage = measure_coverage(camera, seen)
    errors = dict(zip(PARAMETERS, np.sqrt(np.diag(solution.covariance)).tolist(), strict=True))
    middle_row, middle_col = camera.centre_px
    colours = _fit_colours(fitted)
    offset_row = Quantity(camera.cy_px - middle_row, errors["cy_px"], UNITS["cy_px"])
    offset_col = Quantity(camera.cx_px - middle_col, errors["cx_px"], UNITS["cx_px"])
    return results.Fit(
        model=MODEL,
        target=_features(fitted.used[0]).target,
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
            *check_views(fitted, points),
            *check_solution(solution, coverage),
            *check_colours(colours),
        ),
        lateral_colour=colours or None,
        birge_ratio=fitted.birge_ratio,
        effective_dof=fitted.effective_dof,
    )


def _fit_colours(fitted: FittedViews) -> tuple[results.LateralColour, ...]:
    views: dict[str, list[results.ColourView]] = {}
    for each in fitted.used:
        features = _features(each)
        for colour in features.colours or ():
            view = results.ColourView(np.array(features.fitted_px), np.array(colour.moved_px))
            views.setdefault(colour.channel, []).append(view)
    fits = (
        results.fit_colour(mine, fitted.solution.camera, channel=name) for name, mine in sorted(views.items())
    )
    return tuple(each for each in fits if each)


def _features(candidate: Candidate) -> results.Features:
    if candidate.features is None:
        raise ValueError(f"{candidate.row.frame} has no features")
    return candidate.features


def _list_coefficients(solution: Solution, errors: dict[str, float]) -> tuple[results.Coefficient, ...]:
    """Return the parameters, and the rms with the standard error of a standard deviation, s / sqrt(2 v)."""
    listed = [
        results.Coefficient(
            name=name,
            value=float(getattr(solution.camera, name)),
            standard_uncertainty=errors[name],
            unit=UNITS[name],
        )
        for name in _FIGURES
    ]
    rms = results.Coefficient(
        name="rms_px",
        value=solution.rms_px,
        standard_uncertainty=solution.rms_px / math.sqrt(2.0 * solution.degrees_of_freedom),
        unit="px",
    )
    return (*listed, rms)


def _measure_distance(solution: Solution, params: results.Params) -> Quantity | None:
    """Return c = f s_p, f the mean of fx and fy."""
    if params.pixel_pitch_um is None:
        return None
    mm_per_px = params.pixel_pitch_um / 1000.0
    variance = float(solution.covariance[:2, :2].sum()) / 4.0
    return Quantity(
        (solution.camera.fx_px + solution.camera.fy_px) / 2.0 * mm_per_px,
        math.sqrt(variance) * mm_per_px,
        "mm",
    )


def _scale(offset: Quantity, pixel_pitch_um: float | None) -> Quantity | None:
    if pixel_pitch_um is None:
        return None
    return Quantity(offset.value * pixel_pitch_um, offset.standard_uncertainty * pixel_pitch_um, "um")


def _describe_points(candidates: Sequence[Candidate], fitted: FittedViews) -> tuple[results.Point, ...]:
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
            view = make_view(features)
            pose = find_pose(solution.camera, view)
            residual = view.seen_px - project(solution.camera, view.points_mm, pose.rotation, pose.shift)
            points.append(_describe(each, features, rejected[name], pose, residual))
        elif features is not None and name in used:
            points.append(_describe(each, features, "", *used[name]))
        else:
            corners = len(features.indices) if features else 0
            points.append(results.Point(frame=name, used=False, left_out=each.left_out, corners=corners))
    return tuple(points)


def _describe(
    candidate: Candidate, features: results.Features, left_out: str, pose: Pose, residual: NDArray[np.float64]
) -> results.Point:
    return results.Point(
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
