"""DNG files as a Zenmuse X5S writes them: the mosaic untouched, with its levels and its EXIF."""

import math
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

import imagecodecs
import numpy as np
import tifffile
from numpy.typing import NDArray

from radiometry.frame.exposure import Settings
from simulation.camera import Camera
from simulation.tiff import (
    EXIF,
    Entry,
    append_directory,
    describe_exposure,
    rational,
    reserve,
    short,
    signed_rational,
    text,
    undefined,
)

_BYTE, _ASCII, _SHORT, _LONG, _RATIONAL, _SRATIONAL = 1, 2, 3, 4, 5, 10
_MANUAL_MODE, _MANUAL_PROGRAM, _ISO_IS_RECOMMENDED_INDEX = 1, 1, 2
_CFA = 32803
_JPEG = 7
_TILE_PX = 256
_WORD_BITS = 16
_COLOURS = {"R": 0, "G": 1, "B": 2}
_DAYLIGHT = 21  # CalibrationIlluminant1: D65
# XYZ to camera. Nothing here depends on it: a converter asks for one before it opens a colour DNG.
_COLOUR_MATRIX = (7013, -1408, -635, -5268, 12902, 2640, -1470, 2801, 7379)

Compression = Literal["none", "ljpeg"]
Tag = tuple[int | str, int, int, Any, bool]


def write_dng(
    path: Path,
    mosaic_dn: NDArray[np.uint16],
    *,
    camera: Camera,
    settings: Settings,
    taken_at: datetime,
    compression: Compression = "none",
) -> None:
    """Write a mosaic as one CFA image in a DNG 1.4.

    Parameters
    ----------
    path : Path
        File to write.
    mosaic_dn : array of uint16
        Digital numbers (row, col), black not subtracted [DN].
    camera : Camera
        Source of the names and the levels that the file states.
    settings : Settings
        Nominal settings; the APEX values are computed from them.
    taken_at : datetime
        Time of the exposure, with its offset.
    compression : {"none", "ljpeg"}
        One strip of 16-bit words, or lossless JPEG in tiles, which needs 16 pixels each way.

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
            software=camera.body.software,
            extratags=_tags(camera),
        )
    append_directory(path, EXIF, _describe(camera, settings, taken_at))


def _describe(camera: Camera, settings: Settings, taken_at: datetime) -> list[Entry]:
    body = camera.body
    return [
        *describe_exposure(settings, taken_at),
        short(34850, _MANUAL_PROGRAM),  # ExposureProgram
        short(34864, _ISO_IS_RECOMMENDED_INDEX),  # SensitivityType
        undefined(36864, b"0230"),  # ExifVersion
        signed_rational(37377, -math.log2(settings.exposure_time_s)),  # ShutterSpeedValue
        rational(37378, 2 * math.log2(settings.f_number)),  # ApertureValue
        rational(37386, body.focal_length_mm),  # FocalLength
        short(41986, _MANUAL_MODE),  # ExposureMode
        text(42033, body.serial),  # BodySerialNumber
        text(42035, body.lens_make),  # LensMake
        text(42036, body.lens_model),  # LensModel
        text(42037, body.lens_serial),  # LensSerialNumber
    ]


def _tags(camera: Camera) -> list[Tag]:
    body, sensor = camera.body, camera.sensor
    pattern = bytes(_COLOURS[colour] for colour in sensor.cfa)
    matrix = tuple(part for value in _COLOUR_MATRIX for part in (value, 10_000))
    return [
        (271, _ASCII, 0, body.make, True),
        (272, _ASCII, 0, body.model, True),
        (274, _SHORT, 1, 1, True),  # Orientation
        (33421, _SHORT, 2, (2, 2), True),  # CFARepeatPatternDim
        (33422, _BYTE, 4, pattern, True),  # CFAPattern
        reserve(EXIF),
        (50706, _BYTE, 4, (1, 4, 0, 0), True),  # DNGVersion
        (50707, _BYTE, 4, (1, 1, 0, 0), True),  # DNGBackwardVersion
        (50708, _ASCII, 0, f"{body.make} {body.model}", True),
        (50710, _BYTE, 3, (0, 1, 2), True),  # CFAPlaneColor
        (50711, _SHORT, 1, 1, True),  # CFALayout: a rectangle
        (50713, _SHORT, 2, (2, 2), True),  # BlackLevelRepeatDim
        (50714, _SHORT, 4, (round(sensor.black_level_dn),) * 4, True),
        (50717, _LONG, 1, round(sensor.white_level_dn), True),
        (50721, _SRATIONAL, 9, matrix, True),  # ColorMatrix1
        (50728, _RATIONAL, 3, (1, 2, 1, 1, 2, 3), True),  # AsShotNeutral
        (50735, _ASCII, 0, body.serial, True),
        (50778, _SHORT, 1, _DAYLIGHT, True),
    ]


def _tile_shape(mosaic_dn: NDArray[np.uint16]) -> tuple[int, int]:
    """Return multiples of 16, as TIFF asks, within the image: LibRaw misreads a single, larger tile."""
    rows, cols = (min(_TILE_PX, size - size % 16) for size in mosaic_dn.shape)
    return rows, cols


def _ljpeg_tiles(mosaic_dn: NDArray[np.uint16], tile: tuple[int, int]) -> Iterator[bytes]:
    """Encode tiles of full size: the last ones repeat the border, which a reader cuts off again."""
    rows, cols = mosaic_dn.shape
    tile_rows, tile_cols = tile
    padded = np.pad(mosaic_dn, ((0, -rows % tile_rows), (0, -cols % tile_cols)), mode="edge")
    for row in range(0, rows, tile_rows):
        for col in range(0, cols, tile_cols):
            part = np.ascontiguousarray(padded[row : row + tile_rows, col : col + tile_cols])
            yield bytes(imagecodecs.ljpeg_encode(part, bitspersample=_WORD_BITS))
