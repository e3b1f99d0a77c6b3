"""Readings of a measurement's map: squares of an area, and the uncertainty of their means."""

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import interface
from radiometry.frame import roi
from radiometry.frame.roi import Polygon
from radiometry.maps import COVERAGE, PixelUncertainty, find_likeness, read_uncertainty
from radiometry.methods import get_method
from radiometry.specification.application import PictureApplication, SurfaceApplication
from service.auth import Caller
from service.context import Context
from service.lookup import owned
from service.map_values import Layout, Values, Window, read_layout, read_values
from service.problems import Problem
from service.schemas.maps import uncertainty_of
from store.blobs import prove_file
from store.codec import decode_exposure
from store.measuring.version import read_lens
from store.tables import Calibration, FrameRow, Measurement

Area = Literal["region", "grid", "frame"]

MOST_SQUARES: Final = 250_000
_LENS_NODES: Final = 9

DISTORTION: Final = (
    "Lens distortion is not corrected: what is straight on the ground is slightly curved in the picture."
)
NO_VIGNETTING: Final = (
    "Vignetting is not corrected: towards the corners the map is too dark, by more than its uncertainty."
)
REGIONS_VIGNETTING: Final = (
    "The vignetting correction has the uncertainty of the measured region; in the corners it is larger."
)


@dataclass(frozen=True, kw_only=True)
class OpenMap:
    """A measurement's map, ready to be read."""

    row: Measurement
    frame: FrameRow
    calibration: Calibration
    path: Path
    layout: Layout
    unit: str
    uncertainty: PixelUncertainty | None

    @property
    def is_light(self) -> bool:
        """Return True for a map whose values are above zero where there is light, not a ratio."""
        return self.unit != "1"

    @property
    def vignetting(self) -> str:
        return str(self.row.result.get("vignetting", "file"))

    def tag(self, asked: str) -> str:
        digest = hashlib.sha256(asked.encode()).hexdigest()[:16]
        return f"{self.row.map_tif_sha256}-{self.row.content_sha256[:16]}-{digest}"

    def find_polygon(self, area: Area) -> Polygon | None:
        """Return the outline of an area, None for the whole frame."""
        if area == "frame":
            return None
        if area == "region":
            return Polygon.from_points(self.row.parameters["polygon"])
        if not self.row.parameters.get("grid"):
            raise Problem(interface.NOT_FOUND, "This measurement has no grid: its map has a region only.")
        return Polygon.from_points(self.row.parameters["grid"]["corners"])

    def list_notes(self) -> list[str]:
        """Return sentences on what the uncertainty of a place does not contain."""
        if not isinstance(get_method(self.row.method).application, SurfaceApplication):
            return [DISTORTION]
        return [DISTORTION, NO_VIGNETTING if self.vignetting == "none" else REGIONS_VIGNETTING]


@contextmanager
def open_map(context: Context, measurement_id: str, caller: Caller) -> Iterator[OpenMap]:
    """Open the map of a measurement; refuse one that was made without, and a picture."""
    with context.database.reading() as session:
        row = owned(session, Measurement, measurement_id, caller)
        if row.map_tif_sha256 is None:
            detail = 'This measurement was made without a map: ask for one with "products": ["map"].'
            raise Problem(interface.NOT_FOUND, detail)
        if isinstance(get_method(row.method).application, PictureApplication):
            detail = "An undistorted image is not a map of values: use its map.tif."
            raise Problem(interface.NOT_FOUND, detail)
        frame = session.get_one(FrameRow, row.frame_id)
        calibration = session.get_one(Calibration, row.calibration_id)
    with context.files.local(row.map_tif_sha256) as file:
        prove_file(file)
        layout = read_layout(file.path)
        likeness = find_likeness((frame.header or {}).get("cfa", ""), row.result.get("channel", ""))
        yield OpenMap(
            row=row,
            frame=frame,
            calibration=calibration,
            path=file.path,
            layout=layout,
            unit=layout.unit,
            uncertainty=read_uncertainty(
                uncertainty_of(row.result),
                reference=row.result.get("mean", {}).get("value", 0.0),
                likeness=likeness,
            ),
        )


def map_uncertainty(found: OpenMap, window: Window, values: Values, *, step: int) -> Values:
    """Return the relative expanded uncertainty of the means over the squares of a window.

    It is NaN where a mean is not known, or not above zero.
    """
    known, weigh = found.uncertainty, _open_lens(found)
    if known is None:
        detail = "The uncertainty of this map's values follows no rule: its map.tif may have it as a plane."
        raise Problem(interface.NOT_FOUND, detail)
    if weigh is not None:
        rows, cols = (
            first + (np.arange(size) + 0.5) * step
            for first, size in zip((window.top, window.left), values.shape, strict=True)
        )
        nodes = [
            places[np.unique(np.linspace(0, len(places) - 1, _LENS_NODES).astype(int))]
            for places in (rows, cols)
        ]
        x, y = np.meshgrid(nodes[1], nodes[0])
        at_nodes = weigh(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(x.shape)
        along = np.array([np.interp(cols, nodes[1], line) for line in at_nodes])
        known = replace(known, relative=np.array([np.interp(rows, nodes[0], line) for line in along.T]).T)
    positive = np.where(values > 0.0, values, np.nan).astype(np.float64)
    u = np.hypot(known.common(positive), known.own(positive, float(step**2)))
    return (COVERAGE * u / positive).astype(np.float32)


def _open_lens(found: OpenMap) -> Callable[[NDArray[np.float64]], NDArray[np.float64]] | None:
    """Return the shared relative uncertainty at places, with that of the vignetting correction there."""
    known, application = found.uncertainty, get_method(found.row.method).application
    lens = read_lens(found.calibration, decode_exposure(found.frame.exposure or {})) if known else None
    if known is None or lens is None or not isinstance(application, SurfaceApplication):
        return None
    channels = application.name_channels(
        (found.frame.header or {}).get("cfa", ""), channel=found.row.result["channel"]
    )
    mean = found.row.result["mean"]["value"]
    of_region = sum(
        (share["standard_uncertainty_cd_m2"] / mean) ** 2
        for share in found.row.result["budget"]
        if share["source"] == "vignetting"
    )
    rest = max(0.0, float(known.relative) ** 2 - of_region)

    def weigh(xy_px: NDArray[np.float64]) -> NDArray[np.float64]:
        shares = [lens.at(int(y), int(x), channels=channels) for x, y in xy_px]
        at_places = np.array([share.standard_uncertainty / share.value for share in shares])
        relative: NDArray[np.float64] = np.sqrt(rest + at_places**2)
        return relative

    return weigh


def read_squares(found: OpenMap, window: Window, polygon: Polygon | None, *, step: int) -> tuple[Values, int]:
    """Return the means over the squares of a window, and how many of them have their centre in the area.

    A mean is NaN where a pixel of it is unknown, or its centre is outside.
    """
    values = read_values(found.path, found.layout, window, step=step)
    if polygon is None:
        return values, values.size
    rows, cols = (np.arange(size) * step + step // 2 for size in values.shape)
    inside = _mask(polygon, window)[np.ix_(rows, cols)]
    values[~inside] = np.nan
    return values, int(inside.sum())


def frame_window(layout: Layout, polygon: Polygon | None) -> Window:
    """Return the smallest window that holds an area."""
    if polygon is None:
        return Window(top=0, left=0, bottom=layout.height_px, right=layout.width_px)
    part = roi.bounding_window(polygon, height_px=layout.height_px, width_px=layout.width_px)
    return Window(top=part.row0, left=part.col0, bottom=part.row0 + part.height, right=part.col0 + part.width)


def _mask(polygon: Polygon, window: Window) -> NDArray[np.bool_]:
    part = roi.Window(
        row0=window.top,
        col0=window.left,
        height=window.bottom - window.top,
        width=window.right - window.left,
    )
    return roi.mask(polygon, part)
