"""Flags of a measurement beyond the signal and the settings of its region."""

import math
from collections.abc import Iterable, Sequence

from radiometry.findings import Raised, shared
from radiometry.frame import Frame
from radiometry.frame.roi import Polygon
from radiometry.luminance import codes
from radiometry.luminance.measured import AppliedLuminance

Corners = Sequence[tuple[float, float]]

# As well as a hand draws the same region twice, of the frame's diagonal.
_NEAR_SHARE = 0.02
_OF_CELLS = {
    shared.SATURATED: "Saturated",
    shared.BELOW_DETECTION: "Below detection",
    codes.OUTSIDE_SIGNALS: "Outside the calibrated signals",
}


def find_flags(
    frame: Frame,
    measured: Sequence[Corners],
    calibrated: Sequence[Polygon],
    *,
    rendered: bool,
    corrected: bool = False,
) -> tuple[Raised, ...]:
    """Return the flags that limit the claims of a measurement from the air.

    Parameters
    ----------
    frame : Frame
        Frame that was measured.
    measured : sequence of Corners
        Corners (x, y) of everything that was measured [px].
    calibrated : sequence of Polygon
        Regions of the calibration.
    rendered : bool
        True if the frame is a converted image.
    corrected : bool, default: False
        True if vignetting is corrected: then K holds anywhere in the frame.

    Returns
    -------
    tuple of Raised
        Flags `no_vignetting_correction`, `roi_elsewhere`, `observer_differs`,
        `rendered`.
    """
    flags = [] if corrected else _find_falloff(frame, measured, calibrated)
    if rendered:
        flags.append(shared.RENDERED.at("", "The frame is no raw file."))
    detail = "Luminance towards the camera, not towards a driver 60 m or a pedestrian 1.5 m away."
    flags.append(codes.OBSERVER_DIFFERS.at("", detail))
    return tuple(flags)


def _find_falloff(frame: Frame, measured: Sequence[Corners], calibrated: Sequence[Polygon]) -> list[Raised]:
    """Return the flags of an uncorrected measurement: K holds where it was fitted, and how far that is."""
    detail = "Vignetting was corrected with: none."
    flags = [codes.NO_VIGNETTING_CORRECTION.at("", detail)]
    distance = _farthest_px(measured, calibrated)
    diagonal = math.hypot(frame.height_px, frame.width_px)
    if distance > _NEAR_SHARE * diagonal:
        detail = (
            f"It reaches {distance:.0f} px beyond the calibration's region, "
            f"{distance / diagonal:.0%} of the frame's diagonal."
        )
        flags.append(codes.ROI_ELSEWHERE.at("", detail))
    return flags


def summarise_cells(applied: Iterable[Iterable[AppliedLuminance]]) -> tuple[Raised, ...]:
    """Count the cells to which a flag applies, and name the first.

    Parameters
    ----------
    applied : iterable of iterable of AppliedLuminance
        Luminances of the cells, row by row.

    Returns
    -------
    tuple of Raised
        Flags `saturated`, `below_detection`, `outside_signals`.
    """
    found: dict[str, list[str]] = {finding.code: [] for finding in _OF_CELLS}
    for row, line in enumerate(applied):
        for col, one in enumerate(line):
            for raised in one.flags:
                if raised.flag in found:
                    found[raised.flag].append(f"row {row + 1}, column {col + 1}")
    return tuple(
        finding.at("grid", f"{what}: {len(cells)} of the cells, the first in {cells[0]}.")
        for finding, what in _OF_CELLS.items()
        if (cells := found[finding.code])
    )


def _farthest_px(measured: Sequence[Corners], calibrated: Sequence[Polygon]) -> float:
    """Compute how far a corner lies beyond the nearest bounding box of the calibration's regions [px]."""
    if not calibrated:
        return 0.0
    return max(min(_beyond_px(point, box) for box in calibrated) for corners in measured for point in corners)


def _beyond_px(point: tuple[float, float], polygon: Polygon) -> float:
    xs, ys = zip(*polygon.points, strict=True)
    right = max(min(xs) - point[0], point[0] - max(xs), 0.0)
    down = max(min(ys) - point[1], point[1] - max(ys), 0.0)
    return math.hypot(right, down)
