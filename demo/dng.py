"""Writes a DNG as a Zenmuse X5S does: the mosaic untouched, its levels and its EXIF beside it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import imagecodecs
import numpy as np
import tifffile
from numpy.typing import NDArray

from demo.directory import EXIF, append_directory, reserve
from demo.exif import Exposure, exif_entries

_BYTE, _ASCII, _SHORT, _LONG, _RATIONAL, _SRATIONAL = 1, 2, 3, 4, 5, 10
_CFA = 32803
_JPEG = 7
_TILE_PX = 256
_WORD_BITS = 16
_COLOURS = {"R": 0, "G": 1, "B": 2}
_DAYLIGHT = 21  # CalibrationIlluminant1: D65
# XYZ to camera, of no weight here: a converter asks for one before it opens a colour DNG.
_COLOUR_MATRIX = (7013, -1408, -635, -5268, 12902, 2640, -1470, 2801, 7379)

Compression = Literal["none", "ljpeg"]
Tag = tuple[int | str, int, int, Any, bool]


@dataclass(frozen=True, kw_only=True)
class Camera:
    """The body and what its files say of the sensor. Levels in DN."""

    black_level_dn: int
    white_level_dn: int
    serial: str
    cfa: str = "RGGB"
    make: str = "DJI"
    model: str = "FC6520"
    unique_model: str = "DJI FC6520"


def write_dng(
    path: Path,
    mosaic_dn: NDArray[np.uint16],
    *,
    camera: Camera,
    exposure: Exposure,
    compression: Compression = "none",
) -> None:
    """Write ``mosaic_dn`` (row, col) uint16 [DN], black not subtracted, as one CFA image in a DNG 1.4.

    ``compression``: "none" is one strip of 16-bit words; "ljpeg" is lossless JPEG in tiles, as many cameras
    write, and needs 16 pixels each way.
    """
    layout: dict[str, Any] = {"data": mosaic_dn}
    if compression == "ljpeg":
        tile = _tile_shape(mosaic_dn)
        layout = {
            "data": _ljpeg_tiles(mosaic_dn, tile),
            "shape": mosaic_dn.shape,
            "dtype": mosaic_dn.dtype,
            "tile": tile,
            "compression": _JPEG,
            # Else tifffile declares the 12 bits of lossy JPEG; these samples are 16-bit words.
            "compressionargs": {"bitspersample": _WORD_BITS},
        }
    with tifffile.TiffWriter(path, byteorder="<") as file:
        file.write(
            **layout,
            photometric=_CFA,
            metadata=None,
            software="v02.00.0106",
            extratags=_tags(camera),
        )
    append_directory(path, EXIF, exif_entries(exposure))


def _tags(camera: Camera) -> list[Tag]:
    pattern = bytes(_COLOURS[colour] for colour in camera.cfa)
    matrix = tuple(part for value in _COLOUR_MATRIX for part in (value, 10_000))
    return [
        (271, _ASCII, 0, camera.make, True),
        (272, _ASCII, 0, camera.model, True),
        (274, _SHORT, 1, 1, True),  # Orientation
        (33421, _SHORT, 2, (2, 2), True),  # CFARepeatPatternDim
        (33422, _BYTE, 4, pattern, True),  # CFAPattern
        reserve(EXIF),
        (50706, _BYTE, 4, (1, 4, 0, 0), True),  # DNGVersion
        (50707, _BYTE, 4, (1, 1, 0, 0), True),  # DNGBackwardVersion
        (50708, _ASCII, 0, camera.unique_model, True),
        (50710, _BYTE, 3, (0, 1, 2), True),  # CFAPlaneColor
        (50711, _SHORT, 1, 1, True),  # CFALayout: a rectangle
        (50713, _SHORT, 2, (2, 2), True),  # BlackLevelRepeatDim
        (50714, _SHORT, 4, (camera.black_level_dn,) * 4, True),
        (50717, _LONG, 1, camera.white_level_dn, True),
        (50721, _SRATIONAL, 9, matrix, True),  # ColorMatrix1
        (50728, _RATIONAL, 3, (1, 2, 1, 1, 2, 3), True),  # AsShotNeutral
        (50735, _ASCII, 0, camera.serial, True),
        (50778, _SHORT, 1, _DAYLIGHT, True),
    ]


def _tile_shape(mosaic_dn: NDArray[np.uint16]) -> tuple[int, int]:
    """Multiples of 16, as TIFF asks, and within the image: LibRaw misreads a single, larger tile."""
    rows, cols = (min(_TILE_PX, size - size % 16) for size in mosaic_dn.shape)
    return rows, cols


def _ljpeg_tiles(mosaic_dn: NDArray[np.uint16], tile: tuple[int, int]) -> Iterator[bytes]:
    """Every tile has its full size: the last ones repeat the border, which a reader cuts off again."""
    rows, cols = mosaic_dn.shape
    tile_rows, tile_cols = tile
    padded = np.pad(mosaic_dn, ((0, -rows % tile_rows), (0, -cols % tile_cols)), mode="edge")
    for row in range(0, rows, tile_rows):
        for col in range(0, cols, tile_cols):
            part = np.ascontiguousarray(padded[row : row + tile_rows, col : col + tile_cols])
            yield bytes(imagecodecs.ljpeg_encode(part, bitspersample=_WORD_BITS))
