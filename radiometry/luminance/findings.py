"""Flags of a measurement beyond the signal and the settings of its region."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from radiometry.findings import Raised, shared
from radiometry.frame import Frame
from radiometry.frame.roi import Polygon
from radiometry.frame.statistics import Signal
from radiometry.luminance import codes
from radiometry.luminance.conditions import Colour
from radiometry.luminance.measured import AppliedLuminance
from radiometry.spectral.curves import list_responses
from radiometry.spectral.mismatch import LEAST_U_REL, fit_colour_remedy

Corners = Sequence[tuple[float, float]]

# As well as a hand draws the same region twice, of the frame's diagonal.
_NEAR_SHARE = 0.02
# Mean over median, of a region and of a cell. Light that rises by three times over a cell as an exponential,
# more than a lamp's pool does within 3 m, has 5 %; pools of light in a region of the road have 25 %.
_MIXED_REGION, _MIXED_CELL = 0.25, 0.05
# Three standard errors of mean less median of a normal distribution, in those of its mean; and of rounding.
_SKEW_ERRORS, _ROUNDING_DN = 3.0 * math.sqrt(math.pi / 2.0 - 1.0), 0.5
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


def find_mixed(
    region: Signal, cells: Sequence[Sequence[Signal]], *, dark_signal_dn: float
) -> tuple[Raised, ...]:
    """Return `mixed_surface` where a mean is that of unlike parts: a kerb, a lamp, a passing car's light.

    Parameters
    ----------
    region : Signal
        Signal of the region.
    cells : sequence of sequence of Signal
        Signals of the cells, row by row; empty without a grid. A region around cells is not tested, as
        the light of a road differs from place to place.
    dark_signal_dn : float
        Dark signal D [DN].

    Returns
    -------
    tuple of Raised
        At most one flag.
    """
    if not cells:
        share = _measure_skew(region, dark_signal_dn)
        detail = f"The mean differs from the median by {share:+.0%} of it."
        return (codes.MIXED_SURFACE.at("", detail),) if abs(share) > _MIXED_REGION else ()
    shares = {
        (row, column): _measure_skew(signal, dark_signal_dn)
        for row, line in enumerate(cells, start=1)
        for column, signal in enumerate(line, start=1)
    }
    found = [place for place, share in shares.items() if abs(share) > _MIXED_CELL]
    if not found:
        return ()
    worst = max(found, key=lambda place: abs(shares[place]))
    detail = (
        f"{len(found)} of the cells; most in row {worst[0]}, column {worst[1]}, whose mean differs from its "
        f"median by {shares[worst]:+.0%} of it."
    )
    return (codes.MIXED_SURFACE.at("grid", detail),)


def find_mixed_light(
    colours: Sequence[Colour], *, response: str | None, channel: str, u_rel: float
) -> tuple[Raised, ...]:
    """Return `mixed_light` where no single spectral correction holds for all cells.

    Parameters
    ----------
    colours : sequence of tuple[float, float]
        R/G and B/G of the cells whose colour is certain.
    response : str or None
        Camera response, a name or a table; None for an unknown camera.
    channel : str
        "green" or "grey".
    u_rel : float
        Relative standard uncertainty of the spectral correction, which all cells share.

    Returns
    -------
    tuple of Raised
        At most one flag: beyond the expanded uncertainty, k = 2.

    Notes
    -----
    ln F = a + b ln(R/G) + c ln(B/G) of `fit_colour_remedy` differs between two cells by what one factor for
    both is wrong about their ratio. An unknown camera may be any of the library's.
    """
    if len(colours) < 2:
        return ()
    cameras = list_responses() if response is None else (response,)
    remedies = [fit_colour_remedy((each,), channel=channel, calibrated=("A",)) for each in cameras]
    spread = max(float(np.ptp(np.log(colours) @ (each.red, each.blue))) for each in remedies)
    error, allowed = math.expm1(spread), max(u_rel, LEAST_U_REL)
    if error <= 2.0 * allowed:
        return ()
    of = "" if response else " with one of the published cameras"
    detail = (
        f"The ratio of two cells may be wrong by {error:.0%}{of}; the budget holds {allowed:.0%} for all."
    )
    return (codes.MIXED_LIGHT.at("grid", detail),)


def _measure_skew(signal: Signal, dark_signal_dn: float) -> float:
    """Compute mean less median beyond noise, relative to the median; 0 where it is not above dark."""
    median = signal.value_dn - signal.skew_dn - dark_signal_dn
    if median <= 0.0:
        return 0.0
    allowed = _SKEW_ERRORS * signal.standard_uncertainty_dn + _ROUNDING_DN
    return math.copysign(max(0.0, abs(signal.skew_dn) - allowed), signal.skew_dn) / median


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
