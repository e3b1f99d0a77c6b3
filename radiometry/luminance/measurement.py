"""Measurement of a frame with a calibrated camera: a region, its pixels, and the cells of a lit surface."""

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from radiometry.findings import Raised
from radiometry.fitting.evidence import FieldCorrection, Quantity
from radiometry.frame import Frame
from radiometry.frame.exposure import Exposure
from radiometry.frame.grid import Grid
from radiometry.frame.roi import Polygon, Window, bounding_window
from radiometry.frame.statistics import Signal
from radiometry.luminance import codes, method
from radiometry.luminance.application import choose_coefficient
from radiometry.luminance.averaging import SCATTER, add_signal, flag_scatter
from radiometry.luminance.camera import CalibratedCamera, add_up
from radiometry.luminance.cells import illuminate, measure_surface
from radiometry.luminance.coefficient import Coefficient
from radiometry.luminance.conditions import CalibrationConditions, FieldConditions, measure_colour
from radiometry.luminance.corners import check_grid
from radiometry.luminance.corrections import correct_focus, correct_spectrum, correct_stray_light
from radiometry.luminance.effects import share_out
from radiometry.luminance.findings import find_flags, find_mixed, find_mixed_light
from radiometry.luminance.flicker import correct_flicker
from radiometry.luminance.maps import average_map, find_map_scale, sum_signal
from radiometry.luminance.measured import Measured, Percentile
from radiometry.luminance.pixels import PERCENTILES, Correction, PixelSignal, order_pixels
from radiometry.luminance.surface import lay_grid
from radiometry.vignetting.lens import Lens

# A flicker over whole periods is not exactly 0.
_ROUNDING = 1e-9
# The extremes of fifty cells then lie within 3 % of each other, half of what a known camera is flagged for.
_CLEAR_REL = 0.01


@dataclass(frozen=True, kw_only=True)
class Request:
    """Region, grid and reflectance of a measurement.

    Attributes
    ----------
    polygon : Polygon
        Region to measure.
    grid : Grid or None, default: None
        Grid of cells to measure, if any.
    reflectance : float or None, default: None
        Reflectance rho of the surface, (0, 1]; None if no illuminance is requested.
    conditions : FieldConditions or None, default: None
        Light and surroundings; None for those of the calibration, as in a laboratory.
    """

    polygon: Polygon
    grid: Grid | None = None
    reflectance: float | None = None
    conditions: FieldConditions | None = None


@dataclass(frozen=True, kw_only=True)
class Vignetting:
    """Version that a frame's vignetting is corrected with.

    Attributes
    ----------
    name : str
        Name of the version in the answer.
    lens : Lens
        Relative illumination at the frame's f-number.
    """

    name: str
    lens: Lens


def find_window(request: Request, *, height_px: int, width_px: int) -> Window:
    """Return the window of a frame that a measurement reads.

    Parameters
    ----------
    request : Request
        Region and grid.
    height_px, width_px : int
        Size of the frame [px].

    Returns
    -------
    Window
        Smallest one that contains the region and the grid; of a frame of the field the whole, whose mean
        the glare depends on.

    Raises
    ------
    InputRejected
        `roi_outside_frame`, `roi_empty` or `grid_invalid`.
    """
    part = _find_part(request, height_px=height_px, width_px=width_px)
    return part if request.conditions is None else Window(row0=0, col0=0, height=height_px, width=width_px)


def needs_scale(request: Request) -> bool:
    """Return True if a measurement needs the scale of a map, which a model may not have: to subtract glare.

    Parameters
    ----------
    request : Request
        Region, grid and conditions.

    Returns
    -------
    bool
        True if the request states a glare.
    """
    return request.conditions is not None and request.conditions.glare_share is not None


def _find_part(request: Request, *, height_px: int, width_px: int) -> Window:
    """Return the window that contains the region and the grid."""
    cells = itertools.chain.from_iterable(lay_grid(request.grid)) if request.grid else ()
    windows = [
        bounding_window(polygon, height_px=height_px, width_px=width_px)
        for polygon in (request.polygon, *cells)
    ]
    row0, col0 = min(w.row0 for w in windows), min(w.col0 for w in windows)
    return Window(
        row0=row0,
        col0=col0,
        height=max(w.row0 + w.height for w in windows) - row0,
        width=max(w.col0 + w.width for w in windows) - col0,
    )


def _crop(frame: Frame, part: Window) -> Frame:
    """Return a part of a window of a frame."""
    rows = slice(part.row0 - frame.row0, part.row0 - frame.row0 + part.height)
    cols = slice(part.col0 - frame.col0, part.col0 - frame.col0 + part.width)
    return replace(frame, samples_dn=frame.samples_dn[rows, cols], row0=part.row0, col0=part.col0)


def _cut(frame: Frame, cell: Polygon) -> Frame:
    """Return the part of a frame around a cell: a grid has up to 2,500, and each would read all of it."""
    return _crop(frame, bounding_window(cell, height_px=frame.height_px, width_px=frame.width_px))


def measure(
    frame: Frame,
    request: Request,
    *,
    exposure: Exposure,
    coefficients: Sequence[Coefficient],
    calibrated: Sequence[Polygon],
    correction: Vignetting | None = None,
    rendered: bool = False,
    repeats: Iterable[Frame] = (),
) -> Measured:
    """Measure the luminance of a frame.

    Parameters
    ----------
    frame : Frame
        Window returned by `find_window`.
    request : Request
        Region, grid and reflectance.
    exposure : Exposure
        Exposure of the frame.
    coefficients : sequence of Coefficient
        Coefficients of the version, one per ISO value.
    calibrated : sequence of Polygon
        Regions of the calibration.
    correction : Vignetting or None, default: None
        Vignetting version, if vignetting is corrected.
    rendered : bool, default: False
        True if the frame is a converted image.
    repeats : iterable of Frame, default: ()
        The same window of further frames of the same scene at the same exposure,
        with which the frame is averaged.

    Returns
    -------
    Measured
        Luminances and flags: those of `application.apply_coefficient`,
        `no_vignetting_correction`, `roi_elsewhere`, `observer_differs`, `rendered`,
        `frames_disagree`, `mixed_surface`, `diffuse_assumed`, those of
        `corners.check_grid`, and of the conditions `spectral_mismatch_unknown`,
        `flicker_unknown`, `stray_light_unknown`.

    Raises
    ------
    InputRejected
        `iso_not_calibrated`, `exposure_implausible`, `fit_failed`, `roi_empty`,
        `grid_invalid`; `vignetting_not_calibrated` if K needs the correction and
        has none, or the reverse.

    Notes
    -----
    The mean of the region and of each cell is `application.apply_coefficient` of
    its statistics: measured as it was calibrated. E = pi L / rho holds for a
    diffuse surface; rho is taken as exact. With a correction every signal above
    dark is divided by V (see `lens.correct_signal`). All luminances take the same
    corrections of the field (see `corrections`), found in the first frame.

    Repeated frames are averaged pixel by pixel. Their noise averages; every shared
    error remains; what they scatter beyond noise is a source of its own (see
    `averaging.evaluate_scatter`). In a grid the part that all cells have in common
    is shared by them, the rest is each cell's own.
    """
    coefficient = choose_coefficient(coefficients, iso=exposure.iso)
    coefficient = coefficient.at(exposure.on_basis(coefficient.exposure_basis).exposure_time_s)
    lens = correction.lens if correction else None
    camera = CalibratedCamera(exposure, coefficient, lens, ())
    cells = lay_grid(request.grid) if request.grid else ()
    signals, of_cells, summed = [], [], None
    part, whole = _find_part(request, height_px=frame.height_px, width_px=frame.width_px), frame
    frame = _crop(whole, part)
    # one frame at a time: a region may be most of it
    for each in itertools.chain([frame], (_crop(each, part) for each in repeats)):
        signals.append(camera.read_signal(each, request.polygon))
        of_cells.append(
            [[camera.read_signal(_cut(each, cell), cell, of_grid=True) for cell in line] for line in cells]
        )
        summed = add_signal(summed, sum_signal(each, channel=coefficient.channel))
    corrections, raised = _find_corrections(frame, whole, request, camera, frames=len(signals))
    camera = replace(camera, corrections=corrections)
    region = camera.apply_to_region(signals)
    disagreement = flag_scatter([signal for signal, _ in signals], dark_signal_dn=coefficient.dark_signal_dn)
    scatter_rel = add_up(region.effects, source=SCATTER) / (abs(region.luminance_cd_m2.value) or 1.0)
    pixels = order_pixels(
        frame,
        request.polygon,
        channel=coefficient.channel,
        correction=Correction(lens, coefficient.dark_signal_dn) if lens else None,
        signal=summed,
    )
    surface, cell_flags = (
        measure_surface(of_cells, camera, request.grid, reflectance=request.reflectance)
        if request.grid
        else (None, ())
    )
    measured = [request.polygon.points, *([request.grid.corners] if request.grid else [])]
    own = find_flags(frame, measured, calibrated, rendered=rendered, corrected=lens is not None)
    shown = find_mixed(
        signals[0][0],
        [[signal for signal, _ in line] for line in of_cells[0]],
        dark_signal_dn=coefficient.dark_signal_dn,
    )
    if request.grid:
        shown += check_grid(request.grid, height_px=frame.height_px, width_px=frame.width_px)
    if request.reflectance is not None:
        detail = "An error of 10 % of the reflectance is one of 10 % of the illuminance."
        shown += (codes.DIFFUSE_ASSUMED.at("illuminance", detail),)

    def luminance(pixel: PixelSignal) -> Quantity:
        signal = Signal(
            value_dn=pixel.value_dn,
            standard_uncertainty_dn=pixel.noise_dn,
            saturated_share=0.0,
            black_level_dn=0.0,
            white_level_dn=0.0,
        )
        found = camera.convert_signal(signal, pixel.share).luminance_cd_m2
        u = math.hypot(found.standard_uncertainty, found.value * scatter_rel)
        return replace(found, standard_uncertainty=u)

    return Measured(
        pixels=pixels.pixels,
        signal_dn=region.signal_dn,
        dark_signal_dn=coefficient.dark_signal_dn,
        channel=coefficient.channel,
        model=coefficient.model,
        exposure_basis=coefficient.exposure_basis,
        mean=region.luminance_cd_m2,
        shared_u_cd_m2=add_up(region.effects, shared=True),
        noise_u_cd_m2=add_up(region.effects, shared=False),
        smallest=luminance(pixels.smallest),
        largest=luminance(pixels.largest),
        median=luminance(pixels.median),
        percentiles=tuple(
            Percentile(percent=percent, luminance=luminance(pixel))
            for percent, pixel in zip(PERCENTILES, pixels.percentiles, strict=True)
        ),
        budget=share_out(region),
        surface=surface,
        illuminance_lx=illuminate(region.luminance_cd_m2, request.reflectance),
        saturated_share=max(signal.saturated_share for signal, _ in signals),
        vignetting=correction.name if correction else "none",
        flags=(*region.flags, *raised, *cell_flags, *shown, *disagreement, *own),
        lens_share=region.lens_share,
        corrections=corrections,
    )


def _find_corrections(
    frame: Frame, whole: Frame, request: Request, camera: CalibratedCamera, *, frames: int
) -> tuple[tuple[FieldCorrection, ...], tuple[Raised, ...]]:
    """Find the corrections of the field; none without conditions."""
    field, coefficient = request.conditions, camera.coefficient
    if field is None:
        return (), ()
    dark_dn = coefficient.dark_signal_dn - coefficient.black_level_dn
    colour = measure_colour(method.extract(frame, request.polygon), dark_above_black_dn=dark_dn)
    mean_cd_m2 = None
    if needs_scale(request) or coefficient.model == "proportional":
        mean_cd_m2 = average_map(whole, find_map_scale((coefficient,), camera.exposure, lens=camera.lens))
    pairs = (
        correct_spectrum(field, coefficient, colour),
        correct_flicker(field, camera.exposure.on_basis(coefficient.exposure_basis), frames=frames),
        (correct_focus(field, coefficient), ()),
        correct_stray_light(field, mean_cd_m2),
    )
    made = tuple(
        each
        for each, _ in pairs
        if each.u_rel > _ROUNDING or each.u_cd_m2 or each.offset_cd_m2 or each.factor != 1.0
    )
    of_cells = (
        measure_colour(
            method.extract(_cut(frame, cell), cell), dark_above_black_dn=dark_dn, most_u_rel=_CLEAR_REL
        )
        for cell in itertools.chain.from_iterable(lay_grid(request.grid) if request.grid else ())
    )
    mixed = find_mixed_light(
        [each for each in of_cells if each],
        response=(coefficient.conditions or CalibrationConditions()).camera_response,
        channel=coefficient.channel,
        u_rel=pairs[0][0].u_rel,
    )
    return made, (*itertools.chain.from_iterable(flags for _, flags in pairs), *mixed)
