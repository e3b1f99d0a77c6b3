"""Luminances of a road's points in its frames, and the road seen from above."""

import io
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from radiometry.frame import Frame
from radiometry.frame.roi import Polygon, Window, bounding_window, mask
from radiometry.methods import get_method
from radiometry.records import Record
from radiometry.road import codes
from radiometry.road.grid import GridPoint
from radiometry.road.observations import Sight, lay_cells
from radiometry.road.results import RoadResult
from radiometry.road.site import Meter, Road, Scale, Site
from radiometry.specification.application import SurfaceApplication
from radiometry.spectral import mismatch
from store.codec import read_applied
from store.measuring import version
from store.measuring.roads import read_placement
from store.tables import Calibration
from worker.maps import picture
from worker.measuring import surface
from worker.measuring.task import Task

Array = NDArray[np.float64]

METER: Final = "meter calibration"
_MARGIN_M: Final = 5.0
_MOST_PX: Final = 1200
_FINEST_M: Final = 0.05
_LEAST_KNOWN: Final = 0.99
"""Share of a rectangle's pixels that are not saturated."""


class View(Record):
    """The part of a road that its picture shows, and the places of its pixels."""

    x_m: tuple[float, float]
    y_m: tuple[float, float]
    places_m: Array
    shape: tuple[int, int]


def lay_view(site: Site) -> View:
    """Lay the pixels of a picture over the field and what lies around it."""
    corners = [corner for area in site.areas for corner in area.corners_m]
    across = [at for each in site.strips for at in (each.y_m, each.y_m + each.width_m)]
    xs, ys = [*site.field_m, *(x for x, _ in corners)], [*across, *(y for _, y in corners)]
    x, y = ((min(each) - _MARGIN_M, max(each) + _MARGIN_M) for each in (xs, ys))
    pixel_m = max(_FINEST_M, max(x[1] - x[0], y[1] - y[0]) / _MOST_PX)
    across_m, along_m = (
        np.arange(low + pixel_m / 2.0, high, pixel_m) for low, high in ((y[0], y[1]), (x[0], x[1]))
    )
    places = np.stack(np.meshgrid(along_m, across_m), axis=-1)
    return View(x_m=x, y_m=y, places_m=places.reshape(-1, 2), shape=(len(across_m), len(along_m)))


class RoadReader:
    """Reads the frames of a road; what frames of one setting share is found once."""

    def __init__(self, road: Road, points: Sequence[GridPoint]) -> None:
        self._site, self._cells, self.view = road.site, lay_cells(road, points), lay_view(road.site)
        stated = {name: getattr(road.conditions, name) for name in ("lamp_kind", "mains_frequency_hz")}
        self._conditions = {name: value for name, value in stated.items() if value is not None}
        self._measured: dict[Any, Any] = {}
        self._scales: list[Scale] = []
        self._rows: list[dict[str, Array]] = []
        self.above_cd_m2: list[Array] = []
        """Luminances over the view in each frame that shows a point; NaN where it shows none."""

    def finish(self) -> tuple[Sight, Scale]:
        """Return what all frames show, and the scale of the largest uncertainty."""
        if not self._rows:
            raise codes.ROAD_NOT_SEEN.refuse("No frame shows a point of the road.")
        sight = Sight(**{name: np.stack([row[name] for row in self._rows]) for name in self._rows[0]})
        widest = max(self._scales, key=lambda each: each.total_u_rel)
        return sight, replace(widest, falls_off=any(each.falls_off for each in self._scales))

    def read(self, task: Task, geometry: Calibration | None) -> None:
        """Read every point of the road that a frame shows whole."""
        header, xy_m = task.header, self._cells.xy_m
        size = {"height_px": header.height_px, "width_px": header.width_px}
        placed = read_placement(task.parameters, geometry, self._site, **size)
        far = header.width_px, header.height_px
        outlines = dict(enumerate(placed.outline(xy_m, self._cells.sides_m)))
        shown = {n: each for n, each in outlines.items() if _is_inside(each, far)}
        if not shown:
            return
        pixels = np.floor(placed.to_image(self.view.places_m)).astype(np.intp)
        within = np.all((pixels >= 0) & (pixels < far), axis=1)
        window = _bound(
            np.concatenate([pixels[within], *(np.array(each.points) for each in shown.values())]), far
        )
        frame = task.decoders.read_window(task.file, (window.row0, window.col0, window.height, window.width))
        plane = self._convert(task, frame, list(shown.values())[len(shown) // 2])
        cols, rows = (pixels[within] - (window.col0, window.row0)).T
        above = np.full(len(self.view.places_m), np.nan)
        above[within] = plane[rows, cols]
        self.above_cd_m2.append(above)
        read = np.full((3, len(xy_m)), np.nan)
        for n, outline in shown.items():
            read[:, n] = _read_cell(frame, plane, outline)
        self._rows.append(
            {
                "luminance_cd_m2": read[0] / self._cells.brighter,
                "u_rel": read[1],
                "red_over_green": read[2],
                "view_deg": placed.find_views(xy_m),
                "off_axis_deg": placed.find_off_axis(xy_m),
                "place_u_m": placed.estimate_u_m(xy_m),
            }
        )

    def _convert(self, task: Task, frame: Frame, middle: Polygon) -> NDArray[np.float32]:
        """Convert a window to luminances, with the corrections of the first frame of these settings."""
        application = get_method(task.calibration.method).application
        assert isinstance(application, SurfaceApplication)  # noqa: S101  the plan let no other through
        key = task.calibration.id, task.exposure
        if key not in self._measured:
            stated = {"polygon": [list(corner) for corner in middle.points], "conditions": self._conditions}
            measured = surface.measure_region(replace(task, parameters=task.parameters | stated), application)
            self._measured[key] = measured
            self._scales.append(_find_scale(task, application, measured))
        scale = application.find_map_scale(
            read_applied(task.calibration),
            task.exposure,
            lens=version.read_lens(task.calibration, task.exposure),
            corrections=self._measured[key].corrections,
        )
        plane: NDArray[np.float32] = application.compute_map(frame, scale)
        return plane


def draw_road(view: View, luminances: Sequence[Array], result: RoadResult) -> tuple[bytes, dict[str, Any]]:
    """Draw the illuminance from above: a PNG in false colours, and what it shows."""
    pairs = [(each.illuminance_lx, each.luminance_cd_m2) for each in result.points if each.luminance_cd_m2]
    factor = float(np.median([lux / luminance for lux, luminance in pairs]))
    stack = np.stack(luminances)
    seen = np.isfinite(stack)
    counts = seen.sum(axis=0)
    lux = factor * np.where(seen, stack, 0.0).sum(axis=0) / np.where(counts, counts, 1)
    on_points = np.array([each.illuminance_lx for each in result.points])
    scale = picture.Scale(float(on_points.min()) / 1.5, float(on_points.max()) * 1.5)
    pixels = picture.make_colours()[scale.place(lux)]
    pixels[counts == 0] = 255
    out = io.BytesIO()
    Image.fromarray(pixels.reshape(*view.shape, 3)).save(out, "PNG")
    told = {"x_m": list(view.x_m), "y_m": list(view.y_m), "lx": [scale.low, scale.high]}
    return out.getvalue(), told


def _find_scale(task: Task, application: SurfaceApplication, measured: Any) -> Scale:  # noqa: ANN401
    """Return what all luminances of these settings share, and the meter and lamp behind K."""
    mean = abs(measured.mean.value)
    shared = {each.source: each.standard_uncertainty_cd_m2 / mean for each in measured.budget if each.shared}
    meter_u_rel, spectral_u_rel = shared.pop(METER, 0.0), shared.pop(mismatch.SOURCE, 0.0)
    coefficients, meters = read_applied(task.calibration), task.calibration.inputs.get("meters", [])
    lit = application.choose_coefficient(coefficients, iso=task.exposure.iso).conditions
    named = {f"{m['make']} {m['model']} {m['serial']}" for m in meters if m["kind"] == "luminance"}
    return Scale(
        u_rel=math.hypot(*shared.values()),
        # of a meter without a certificate K has no such part
        meter=Meter(meter=min(named, default="the meter of K"), u_rel=meter_u_rel or None),
        spectral_u_rel=spectral_u_rel,
        lamp_kind=lit.lamp_kind if lit else None,
        falls_off=measured.vignetting == "none",
    )


def _is_inside(outline: Polygon, far: tuple[int, int]) -> bool:
    corners = np.array(outline.points)
    return bool(np.all((corners >= 0.0) & (corners <= far)))


def _bound(spots: Array, far: tuple[int, int]) -> Window:
    """Return the window around places in a frame, with a pixel more on each side."""
    low = np.maximum(np.floor(spots.min(axis=0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(spots.max(axis=0)).astype(int) + 2, far)
    (col0, row0), (width, height) = low.tolist(), (high - low).tolist()
    return Window(row0=row0, col0=col0, height=height, width=width)


def _read_cell(frame: Frame, plane: NDArray[np.float32], outline: Polygon) -> tuple[float, float, float]:
    """Return mean luminance of a cell, its relative noise, and R/G; NaN where it is saturated."""
    part = bounding_window(outline, height_px=frame.height_px, width_px=frame.width_px)
    row0, col0, inside = part.row0 - frame.row0, part.col0 - frame.col0, mask(outline, part)
    cut = slice(row0, row0 + part.height), slice(col0, col0 + part.width)
    values = plane[cut][inside].astype(np.float64)
    known = values[np.isfinite(values)]
    if len(known) < _LEAST_KNOWN * len(values) or not (mean := float(known.mean())) > 0.0:
        return math.nan, math.nan, math.nan
    samples, black = frame.samples_dn[cut][inside].astype(np.float64), np.array(frame.black_level_dn)
    red = green = math.nan
    if frame.cfa == "rgb":
        red, green, _ = samples.mean(axis=0) - black
    elif len(frame.cfa) == 4:
        rows, cols = np.nonzero(inside)
        sites = 2 * ((rows + part.row0) % 2) + (cols + part.col0) % 2
        letters, above = np.array(list(frame.cfa))[sites], samples - black[sites]
        red, green = (above[letters == each].mean() if np.any(letters == each) else 0.0 for each in "RG")
    ratio = red / green if min(red, green) > 0.0 else math.nan
    return mean, float(known.std()) / math.sqrt(len(known)) / mean, float(ratio)
