"""Measurement of a frame with a calibrated camera: a region, its pixels, and the cells of a lit surface."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from radiometry.findings import Raised, shared
from radiometry.fitting.curve import coverage_factor
from radiometry.fitting.evidence import FieldCorrection, Quantity
from radiometry.frame import Frame, statistics
from radiometry.frame.exposure import Exposure
from radiometry.frame.grid import Grid
from radiometry.frame.roi import Polygon, Window, bounding_window
from radiometry.luminance import codes, method, results
from radiometry.luminance.application import AppliedLuminance, choose_coefficient
from radiometry.luminance.corrections import (
    correct_flicker,
    correct_focus,
    correct_spectrum,
    correct_stray_light,
)
from radiometry.luminance.maps import average_map, find_map_scale, sum_signal
from radiometry.luminance.pixels import (
    PERCENTILES,
    PixelSignal,
    add_signal,
    flag_scatter,
    order_pixels,
)
from radiometry.luminance.rows import CalibrationConditions, Colour, FieldConditions, measure_colour
from radiometry.luminance.surface import (
    CalibratedCamera,
    Surface,
    add_up,
    check_grid,
    illuminate,
    lay_grid,
    measure_surface,
)
from radiometry.records import Record
from radiometry.specification.application import Summary
from radiometry.spectral.mismatch import LEAST_U_REL, fit_colour_remedy, list_responses
from radiometry.vignetting.lens import Lens

Corners = Sequence[tuple[float, float]]

_USUAL_REFLECTANCE_U_REL = 0.1
# A flicker over whole periods is not exactly 0.
_ROUNDING = 1e-9
# The extremes of fifty cells then lie within 3 % of each other, half of what a known camera is flagged for.
_CLEAR_REL = 0.01
# As well as a hand draws the same region twice, of the frame's diagonal.
_NEAR_SHARE = 0.02
# Mean over median, of a region and of a cell. Light that rises by three times over a cell as an exponential,
# more than a lamp's pool does within 3 m, has 5 %; pools of light in a region of the road have 25 %.
_MIXED_REGION, _MIXED_CELL = 0.25, 0.05
# Three standard errors of mean less median of a normal distribution, in those of its mean; and of rounding.
_SKEW_ERRORS, _ROUNDING_DN = 3.0 * math.sqrt(math.pi / 2.0 - 1.0), 0.5


class Share(Record):
    """Contribution of one source to the mean's uncertainty."""

    source: str
    shared: bool  # the same error in every pixel of the frame, which no mean reduces
    standard_uncertainty_cd_m2: float
    variance_share: float


class Percentile(Record):
    """A percentile of the region's pixels."""

    percent: int
    luminance: Quantity


class Measured(Record):
    """Luminance of a region with its whole budget; all values are finite, what does not exist is None."""

    pixels: int
    signal_dn: float
    dark_signal_dn: float
    channel: str
    model: str
    exposure_basis: str
    mean: Quantity  # of the region's signal, as the calibration was made
    shared_u_cd_m2: float
    noise_u_cd_m2: float
    smallest: Quantity  # of single pixels, with a single pixel's noise, as the percentiles
    largest: Quantity
    median: Quantity  # with the median's own noise
    percentiles: tuple[Percentile, ...]
    budget: tuple[Share, ...]
    surface: Surface | None
    illuminance_lx: Quantity | None
    saturated_share: float
    vignetting: str  # "none", or the name of the version that vignetting was corrected with
    flags: tuple[Raised, ...]
    lens_share: Quantity | None = None
    corrections: tuple[FieldCorrection, ...] = ()  # that all luminances contain, maps included
    effective_dof: float | None = None  # of the mean's variance; None if infinite, and of older measurements
    coverage_factor: float | None = None  # for a coverage probability of 95 %
    expanded_uncertainty_cd_m2: float | None = None


class Request(Record):
    """Region, grid and reflectance of a measurement."""

    polygon: Polygon
    grid: Grid | None = None
    reflectance: float | None = None  # rho of the surface, (0, 1]; None if no illuminance is requested
    conditions: FieldConditions | None = None  # None for those of the calibration, as in a laboratory

    def state_reflectance(self) -> Quantity | None:
        """Return rho with its uncertainty, 10 % where none is stated."""
        if self.reflectance is None:
            return None
        stated = self.conditions.reflectance_u_rel if self.conditions else None
        u_rel = _USUAL_REFLECTANCE_U_REL if stated is None else stated
        return Quantity(self.reflectance, u_rel * self.reflectance, "1")


class Vignetting(Record):
    """Version that a frame's vignetting is corrected with."""

    name: str  # in the answer
    lens: Lens  # at the frame's f-number


def find_window(request: Request, *, height_px: int, width_px: int) -> Window:
    """Return the window of a frame that a measurement reads."""
    part = _find_part(request, height_px=height_px, width_px=width_px)
    return part if request.conditions is None else Window(row0=0, col0=0, height=height_px, width=width_px)


def needs_scale(request: Request) -> bool:
    """Return True if a measurement needs the scale of a map to subtract glare; a model may not have one."""
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
    coefficients: Sequence[results.Coefficient],
    calibrated: Sequence[Polygon],
    correction: Vignetting | None = None,
    rendered: bool = False,
    repeats: Iterable[Frame] = (),
) -> Measured:
    """Measure the luminance of a frame.

    The mean of the region and of each cell is `application.apply_to_signal` of its statistics: measured as
    it was calibrated. E = pi L / rho holds for a diffuse surface. With a correction
    every signal above dark is divided by V (see `maps.correct_signal`). All luminances take the same
    corrections of the field (see `corrections`), found in the first frame.

    Repeated frames are averaged pixel by pixel. Their noise averages; every shared error remains; what they
    scatter beyond noise is a source of its own (see `CalibratedCamera.average`). In a grid the part that
    all cells have in common is shared by them, the rest is each cell's own.
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
    one = replace(camera, corrections=corrections)
    camera = one.average([signal for signal, _ in signals])
    region, reflectance = camera.apply_to_region(signals), request.state_reflectance()
    dof = camera.find_dof(region)
    disagreement = flag_scatter([signal for signal, _ in signals], dark_signal_dn=coefficient.dark_signal_dn)
    pixels = order_pixels(
        frame,
        request.polygon,
        channel=coefficient.channel,
        lens=lens,
        dark_signal_dn=coefficient.dark_signal_dn,
        signal=summed,
    )
    surface, cell_flags = (
        measure_surface(of_cells, one, request.grid, reflectance=reflectance) if request.grid else (None, ())
    )
    measured = [request.polygon.points, *([request.grid.corners] if request.grid else [])]
    own = _find_limits(frame, measured, calibrated, rendered=rendered, corrected=lens is not None)
    shown = find_mixed(
        signals[0][0],
        [[signal for signal, _ in line] for line in of_cells[0]],
        dark_signal_dn=coefficient.dark_signal_dn,
    )
    if request.grid:
        shown += check_grid(request.grid, height_px=frame.height_px, width_px=frame.width_px)
    if reflectance is not None:
        detail = f"The reflectance has a standard uncertainty of {reflectance.standard_uncertainty:.2g}."
        shown += (codes.DIFFUSE_ASSUMED.at("illuminance", detail),)

    def luminance(pixel: PixelSignal) -> Quantity:
        signal = statistics.Signal(
            value_dn=pixel.value_dn,
            standard_uncertainty_dn=pixel.noise_dn,
            saturated_share=0.0,
            black_level_dn=0.0,
            white_level_dn=0.0,
        )
        return camera.convert_signal(signal, pixel.share).luminance_cd_m2

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
        budget=_share_out(region),
        surface=surface,
        illuminance_lx=illuminate(region.luminance_cd_m2, reflectance),
        saturated_share=max(signal.saturated_share for signal, _ in signals),
        vignetting=correction.name if correction else "none",
        flags=(*region.flags, *raised, *cell_flags, *shown, *disagreement, *own),
        lens_share=region.lens_share,
        corrections=camera.corrections,
        effective_dof=dof if math.isfinite(dof) else None,
        coverage_factor=coverage_factor(dof),
        expanded_uncertainty_cd_m2=coverage_factor(dof) * region.luminance_cd_m2.standard_uncertainty,
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


def _share_out(applied: AppliedLuminance) -> tuple[Share, ...]:
    """Add up the effects of each source; the variance shares add up to one."""
    total = applied.luminance_cd_m2.standard_uncertainty
    names = dict.fromkeys((effect.source, effect.shared) for effect in applied.effects)
    shares = []
    for source, is_shared in names:
        u = math.hypot(*(e.effect_cd_m2 for e in applied.effects if e.source == source))
        shares.append(
            Share(
                source=source,
                shared=is_shared,
                standard_uncertainty_cd_m2=u,
                variance_share=(u / total) ** 2 if total > 0.0 else 0.0,
            )
        )
    return tuple(shares)


def _find_limits(
    frame: Frame,
    measured: Sequence[Corners],
    calibrated: Sequence[Polygon],
    *,
    rendered: bool,
    corrected: bool,
) -> list[Raised]:
    """Return the flags that limit the claims of a measurement from the air: K holds where it was fitted."""
    flags = []
    if not corrected:
        flags.append(codes.NO_VIGNETTING_CORRECTION.at("", "Vignetting was corrected with: none."))
        # how far a corner lies beyond the nearest bounding box of the calibration's regions
        corners = itertools.chain.from_iterable(measured)
        distance = (
            max(min(_beyond_px(each, box) for box in calibrated) for each in corners) if calibrated else 0.0
        )
        diagonal = math.hypot(frame.height_px, frame.width_px)
        if distance > _NEAR_SHARE * diagonal:
            detail = (
                f"It reaches {distance:.0f} px beyond the calibration's region, "
                f"{distance / diagonal:.0%} of the frame's diagonal."
            )
            flags.append(codes.ROI_ELSEWHERE.at("", detail))
    if rendered:
        flags.append(shared.RENDERED.at("", "The frame is no raw file."))
    detail = "Luminance towards the camera, not towards a driver 60 m or a pedestrian 1.5 m away."
    return [*flags, codes.OBSERVER_DIFFERS.at("", detail)]


def find_mixed(
    region: statistics.Signal, cells: Sequence[Sequence[statistics.Signal]], *, dark_signal_dn: float
) -> tuple[Raised, ...]:
    """Return `mixed_surface` where a mean is that of unlike parts: a kerb, a lamp, a passing car's light."""
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


def _measure_skew(signal: statistics.Signal, dark_signal_dn: float) -> float:
    """Compute mean less median beyond noise, relative to the median; 0 where it is not above dark."""
    median = signal.value_dn - signal.skew_dn - dark_signal_dn
    if median <= 0.0:
        return 0.0
    allowed = _SKEW_ERRORS * signal.standard_uncertainty_dn + _ROUNDING_DN
    return math.copysign(max(0.0, abs(signal.skew_dn) - allowed), signal.skew_dn) / median


def _beyond_px(point: tuple[float, float], polygon: Polygon) -> float:
    xs, ys = zip(*polygon.points, strict=True)
    right = max(min(xs) - point[0], point[0] - max(xs), 0.0)
    down = max(min(ys) - point[1], point[1] - max(ys), 0.0)
    return math.hypot(right, down)


_OF_REGION = ("pixels", "mean", "median", "saturated_share", "shared_u_cd_m2", "noise_u_cd_m2")
_EXPANDED = ("effective_dof", "coverage_factor", "expanded_uncertainty_cd_m2")
_OF_CELLS = sorted({f.name for f in fields(Surface)} - {"cell_model", "cells", "u_l", "illuminance_lx"})


def summarise(result: Mapping[str, Any]) -> Summary:
    """Return a stored result in figures; a row without a positive luminance leaves all rows without U_l."""
    surface = result["surface"] or {}
    return Summary(
        signal=result["channel"],
        measured="luminance",
        column="cd_m2",
        vignetting=result["vignetting"],
        figures={
            **{name: result[name] for name in _OF_REGION},
            **{name: result.get(name) for name in _EXPANDED},
            "min": result["smallest"],
            "max": result["largest"],
            "illuminance": result["illuminance_lx"],
            "lens_share": result.get("lens_share"),
            **{name: surface.get(name) for name in _OF_CELLS},
            "u_l": surface["u_l"] if surface and all(surface["u_l"]) else None,
            "grid_illuminance": surface.get("illuminance_lx"),
            "seen_from": "above",
            "seen_from_detail": codes.OBSERVER_DIFFERS.sentence,
        },
    )
