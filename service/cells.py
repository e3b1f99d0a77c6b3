"""Cells of a measured surface as rows and as polygons, in pixels of the frame or in metres on the road."""

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np

from radiometry.frame.grid import find_homography
from store.tables import Measurement

Coordinates = Literal["pixel", "road_m"]


def list_cells(row: Measurement) -> Iterator[dict[str, Any]]:
    """Yield each cell, row by row: its place, its luminance, and its centre in the frame and on the road."""
    points = (row.parameters.get("lanes") or {}).get("points_m")
    middles = _project(row, np.arange(0.5, _rows(row)), np.arange(0.5, _columns(row)))
    for line, cells in enumerate(row.result["surface"]["cells"]):
        for place, cell in enumerate(cells):
            x_px, y_px = middles[line, place].tolist()
            yield {
                "row": line + 1,
                "column": place + 1,
                "luminance_cd_m2": cell["value"],
                "standard_uncertainty_cd_m2": cell["standard_uncertainty"],
                "x_px": x_px,
                "y_px": y_px,
                **(dict(zip(("x_m", "y_m"), points[line][place], strict=True)) if points else {}),
                "seen_from": "above",
            }


def list_outlines(row: Measurement, coordinates: Coordinates) -> Iterator[list[list[float]]]:
    """Yield the closed outline of each cell, in the same order."""
    across, along = np.arange(_rows(row) + 1.0), np.arange(_columns(row) + 1.0)
    if coordinates == "road_m":
        lanes = row.parameters["lanes"]
        y, x = np.meshgrid(across * lanes["across_m"], along * lanes["along_m"], indexing="ij")
        lattice = np.stack([x, y], axis=-1)
    else:
        lattice = _project(row, across, along)
    for line in range(_rows(row)):
        for place in range(_columns(row)):
            ring = [(line, place), (line, place + 1), (line + 1, place + 1), (line + 1, place), (line, place)]
            yield [lattice[corner].tolist() for corner in ring]


def _rows(row: Measurement) -> int:
    return int(row.parameters["grid"]["rows"])


def _columns(row: Measurement) -> int:
    return int(row.parameters["grid"]["columns"])


def _project(row: Measurement, across: Any, along: Any) -> Any:  # noqa: ANN401  arrays
    """Return the images (x, y) of lattice lines, counted in cells."""
    v, u = np.meshgrid(across / _rows(row), along / _columns(row), indexing="ij")
    h = find_homography(row.parameters["grid"]["corners"])
    projected = np.stack([u, v, np.ones_like(u)], axis=-1) @ h.T
    return projected[..., :2] / projected[..., 2:]
