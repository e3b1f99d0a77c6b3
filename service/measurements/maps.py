"""Numbers out of a map: a window of it, pixel by pixel or as means over squares, tile by tile."""

import hashlib
import json
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, BinaryIO, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, WithJsonSchema

from radiometry import maps, methods, records
from radiometry.findings import interface
from radiometry.frame import roi
from radiometry.specification.application import PictureApplication, SurfaceApplication
from service.http import models
from service.http.context import Context
from service.http.problems import Problem
from store import blobs, codec, tables
from store.measuring.version import read_lens

MOST_VALUES = 250_000

Values = NDArray[np.float32]


class Layout(records.Record):
    """Where the tiles of a map lie in its file."""

    height_px: int
    width_px: int
    tile_px: int
    predicted: bool
    offsets: tuple[int, ...]
    sizes: tuple[int, ...]
    description: str

    @property
    def unit(self) -> str:
        return str(json.loads(self.description)["unit"])


def read_layout(path: Path) -> Layout:
    """The layout of a file of worker/maps/tiff.py: square tiles of float32, deflated."""
    import tifffile

    with tifffile.TiffFile(path) as file:
        page = file.pages.first
        return Layout(
            height_px=page.imagelength,
            width_px=page.imagewidth,
            tile_px=page.tilewidth,
            predicted=page.predictor != 1,
            offsets=tuple(page.dataoffsets),
            sizes=tuple(page.databytecounts),
            description=page.description,
        )


def read_values(path: Path, layout: Layout, window: roi.Window, *, step: int) -> Values:
    """Return means over whole squares of `step` pixels from the window's corner on; NaN where unknown."""
    rows, cols = window.height // step, window.width // step
    size = layout.tile_px
    if not rows or not cols:
        return np.zeros((rows, cols), np.float32)
    bottom, right = window.row0 + rows * step, window.col0 + cols * step
    across = range(window.col0 // size, -(-right // size))
    sums = np.zeros((rows, cols), np.float64)
    with path.open("rb") as file:
        # a row of tiles at a time: the whole map would take as much memory as the frame
        for tile_row in range(window.row0 // size, -(-bottom // size)):
            strip = np.concatenate([_read_tile(file, layout, tile_row, each) for each in across], axis=1)
            top, left = max(window.row0 - tile_row * size, 0), window.col0 - across.start * size
            part = strip[top : bottom - tile_row * size, left : left + cols * step]
            to_rows = (tile_row * size + top - window.row0 + np.arange(len(part))) // step
            if step > 1:
                first_rows = np.flatnonzero(np.diff(to_rows, prepend=-1))
                part = np.add.reduceat(part, first_rows, axis=0, dtype=np.float64)
                part = np.add.reduceat(part, np.arange(0, cols * step, step), axis=1)
            sums[to_rows[0] : to_rows[-1] + 1] += part
    return (sums / step**2).astype(np.float32)


def _read_tile(file: BinaryIO, layout: Layout, row: int, col: int) -> Values:
    index = row * -(-layout.width_px // layout.tile_px) + col
    file.seek(layout.offsets[index])
    return _decode(zlib.decompress(file.read(layout.sizes[index])), layout)


def _decode(tile: bytes, layout: Layout) -> Values:
    """Undo TIFF's floating point predictor: differences of bytes, the highest byte of every pixel first."""
    size = layout.tile_px
    if not layout.predicted:
        return np.frombuffer(tile, "<f4").reshape(size, size)
    rows = np.cumsum(np.frombuffer(tile, np.uint8).reshape(size, 4 * size), axis=1, dtype=np.uint8)
    planes = np.ascontiguousarray(rows.reshape(size, 4, size).transpose(0, 2, 1))
    return planes.view(">f4")[..., 0]


_Pixel = Annotated[int, Field(ge=0, lt=1_000_000)]
_Size = Annotated[int | None, models.told("Left out: up to the border.", ge=1, lt=1_000_000)]


Layer = Literal["value", "expanded_uncertainty_rel"]


class MapWindow(models.Form):
    """Which part of a map."""

    layer: Layer = models.told(
        "`value`: those of map.tif. `expanded_uncertainty_rel`: the expanded uncertainty "
        "(95 %, k as in `uncertainty`) of each mean over that mean.",
        default="value",
    )
    step: int = models.told("The side of the squares, in pixels.", default=1, ge=1, le=4096)
    top: _Pixel = 0
    left: _Pixel = 0
    height: _Size = None
    width: _Size = None

    @property
    def tag(self) -> str:
        return f"{self.layer}-{self.step}-{self.top}-{self.left}-{self.height}-{self.width}"


# here null is a value: that of a pixel which was saturated
_Value = Annotated[float | None, WithJsonSchema({"type": ["number", "null"]})]


class ValueUncertainty(models.Answer, restates=maps.ValueUncertainty):
    """Uncertainty of a value v: u^2 = (u_rel v)^2 + u_constant^2 + u_pixel^2; the last two in its unit."""


class MapValuesAnswer(models.Answer):
    layer: Layer
    unit: str = models.told('As in map.tif: "cd/m2", or "1" of a reflectance, an index or a share.')
    height_px: int = models.told("Of the whole map.")
    width_px: int
    top: int
    left: int
    step: int
    values: list[list[_Value]] = models.told(
        "Rows of columns; the mean of `step` x `step` pixels. null: saturated, or not defined."
    )
    uncertainty: ValueUncertainty | None = models.maybe(
        "Of values; absent of an index, whose uncertainty follows no such rule, and of other layers."
    )
    notes: list[str] = models.told("What the uncertainty of a place does not contain.")


class FootprintAnswer(models.Answer):
    """A GeoJSON polygon: one ring of longitude and latitude, closed."""

    type: Literal["Polygon"]
    coordinates: list[list[list[float]]]


class StacItem(models.Answer):
    """A STAC item: a GeoJSON feature with links and assets."""

    type: Literal["Feature"]
    stac_version: str
    stac_extensions: list[str]
    id: str
    geometry: FootprintAnswer | None = Field(json_schema_extra={"nullable_on_purpose": True})
    bbox: list[float] | None = models.maybe("Absent where there is no geometry.")
    properties: dict[str, Any]
    links: list[dict[str, str]]
    assets: dict[str, dict[str, Any]]


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


class OpenMap(records.Record):
    """A measurement's map, ready to be read."""

    row: tables.Measurement
    frame: tables.FrameRow
    calibration: tables.Calibration
    path: Path
    layout: Layout
    uncertainty: maps.PixelUncertainty | None

    @property
    def is_light(self) -> bool:
        """Return True for a map whose values are above zero where there is light, not a ratio."""
        return self.layout.unit != "1"

    def tag(self, asked: str) -> str:
        digest = hashlib.sha256(asked.encode()).hexdigest()[:16]
        return f"{self.row.map_tif_sha256}-{self.row.content_sha256[:16]}-{digest}"

    def find_polygon(self, area: Area) -> roi.Polygon | None:
        if area == "frame":
            return None
        if area == "region":
            return roi.Polygon.from_points(self.row.parameters["polygon"])
        if not self.row.parameters.get("grid"):
            raise Problem(interface.NOT_FOUND, "This measurement has no grid: its map has a region only.")
        return roi.Polygon.from_points(self.row.parameters["grid"]["corners"])

    def list_notes(self) -> list[str]:
        """Return sentences on what the uncertainty of a place does not contain."""
        if not isinstance(methods.get_method(self.row.method).application, SurfaceApplication):
            return [DISTORTION]
        is_corrected = self.row.result.get("vignetting") != "none"
        return [DISTORTION, REGIONS_VIGNETTING if is_corrected else NO_VIGNETTING]


def require_map(sha256: str | None) -> str:
    """Return the hash of a measurement's map; refuse one that was made without."""
    if sha256 is None:
        detail = 'This measurement was made without a map: ask for one with "products": ["map"].'
        raise Problem(interface.NOT_FOUND, detail)
    return sha256


@contextmanager
def open_map(context: Context, row: tables.Measurement) -> Iterator[OpenMap]:
    """Open the map of a measurement; refuse one that was made without, and a picture."""
    sha256 = require_map(row.map_tif_sha256)
    if isinstance(methods.get_method(row.method).application, PictureApplication):
        detail = "An undistorted image is not a map of values: use its map.tif."
        raise Problem(interface.NOT_FOUND, detail)
    with context.database.reading() as session:
        frame = session.get_one(tables.FrameRow, row.frame_id)
        calibration = session.get_one(tables.Calibration, row.calibration_id)
    with context.files.local(sha256) as file:
        blobs.prove_file(file)
        uncertainty = None
        if (known := maps.read_uncertainty(row.result)) is not None:
            cfa, channel = (frame.header or {}).get("cfa", ""), row.result.get("channel", "")
            uncertainty = maps.PixelUncertainty(
                relative=known.u_rel,
                constant=known.u_constant,
                pixel=known.u_pixel,
                reference=row.result["mean"]["value"],
                likeness=maps.find_likeness(cfa, channel),
            )
        yield OpenMap(
            row=row,
            frame=frame,
            calibration=calibration,
            path=file.path,
            layout=read_layout(file.path),
            uncertainty=uncertainty,
        )


def map_uncertainty(found: OpenMap, window: roi.Window, values: Values, *, step: int) -> Values:
    """Return the relative expanded uncertainty of the means over squares; NaN where none is above zero."""
    known, weigh = found.uncertainty, _open_lens(found)
    if known is None:
        detail = "The uncertainty of this map's values follows no rule: its map.tif may have it as a plane."
        raise Problem(interface.NOT_FOUND, detail)
    if weigh is not None:
        rows, cols = (
            first + (np.arange(size) + 0.5) * step
            for first, size in zip((window.row0, window.col0), values.shape, strict=True)
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
    k = found.row.result.get("coverage_factor") or maps.COVERAGE
    return (k * u / positive).astype(np.float32)


def _open_lens(found: OpenMap) -> Callable[[NDArray[np.float64]], NDArray[np.float64]] | None:
    """Return the shared relative uncertainty at places, with that of the vignetting correction there."""
    known, application = found.uncertainty, methods.get_method(found.row.method).application
    lens = read_lens(found.calibration, codec.decode_exposure(found.frame.exposure or {})) if known else None
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


def read_squares(
    found: OpenMap, window: roi.Window, polygon: roi.Polygon | None, *, step: int
) -> tuple[Values, int]:
    """Return the means over squares, NaN outside or unknown, and how many have their centre in the area."""
    values = read_values(found.path, found.layout, window, step=step)
    if polygon is None:
        return values, values.size
    rows, cols = (np.arange(size) * step + step // 2 for size in values.shape)
    inside = roi.mask(polygon, window)[np.ix_(rows, cols)]
    values[~inside] = np.nan
    return values, int(inside.sum())


def frame_window(layout: Layout, polygon: roi.Polygon | None) -> roi.Window:
    if polygon is None:
        return roi.Window(row0=0, col0=0, height=layout.height_px, width=layout.width_px)
    return roi.bounding_window(polygon, height_px=layout.height_px, width_px=layout.width_px)
