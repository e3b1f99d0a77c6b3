"""Flags of a geometry fit."""

import statistics
from collections.abc import Sequence
from typing import Final

from radiometry.findings import Raised, shared
from radiometry.geometry import codes
from radiometry.geometry.bundle import Solution
from radiometry.geometry.camera import CameraModel
from radiometry.geometry.colour import LateralColour
from radiometry.geometry.coverage import TILTED_DEG, measure_one_sidedness, measure_tilt_deg
from radiometry.geometry.curve import find_farthest_radius_px, find_turning_radius_px
from radiometry.geometry.detection import FIXED_WINDOW_PX
from radiometry.geometry.results import Coverage, Point
from radiometry.geometry.rows import Params
from radiometry.geometry.views import FittedViews

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


def check_views(fitted: FittedViews, points: Sequence[Point], params: Params) -> list[Raised]:
    """Check the pictures, one by one and together.

    Parameters
    ----------
    fitted : FittedViews
        Pictures that were used, and those that were rejected.
    points : sequence of Point
        Points of the fit.
    params : Params
        Parameters of the fit.
    """
    used = fitted.used
    errors = {point.frame: point.rms_px for point in points if point.used and point.rms_px is not None}
    usual = statistics.median(errors.values())
    flags = [
        codes.VIEW_OUTLIER.at(
            f"frame {frame}",
            f"It fits to {error:.2f} px, the median view to {usual:.2f} px.",
        )
        for frame, error in sorted(errors.items())
        if error > max(OUTLIER_RATIO * usual, _OUTLIER_FLOOR_PX)
    ]
    flags += [
        each.finding.at(f"frame {each.candidate.row.frame}", f"It was left out: {each.why}.")
        for each in fitted.rejected
        if each.finding
    ]
    wide = [
        each.features
        for each in used
        if each.features
        and each.features.target.kind == "checkerboard"
        and each.features.fitted_window_px < FIXED_WINDOW_PX
    ]
    if wide and params.corner_window == "fixed":
        closest = min(features.spacing_px for features in wide)
        detail = f"Views: {len(wide)} of {len(used)}; the closest corners are {closest:.1f} px apart."
        flags.append(codes.CORNER_WINDOW_WIDE.at("", detail))
    rendered = sum(each.row.header.rendered for each in used)
    if rendered:
        flags.append(shared.RENDERED.at("", f"Rendered frames: {rendered} of {len(used)}."))
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


def check_solution(solution: Solution, coverage: Coverage) -> list[Raised]:
    """Check the solution, and the coverage on which it rests.

    Parameters
    ----------
    solution : Solution
        Solution of the fit.
    coverage : Coverage
        Coverage of the frame by corners.
    """
    flags = _check_coverage(coverage) + _check_tilts(solution) + _check_model(solution.camera)
    if solution.rms_px > LARGEST_RMS_PX:
        detail = f"Root mean square {solution.rms_px:.2f} px."
        flags.append(codes.REPROJECTION_LARGE.at("", detail))
    return flags


def check_colours(colours: Sequence[LateralColour]) -> list[Raised]:
    """Check how far the colours lie apart where corners were seen.

    Parameters
    ----------
    colours : sequence of LateralColour
        Lateral colour of each pair of channels.
    """
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


def _check_coverage(coverage: Coverage) -> list[Raised]:
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
