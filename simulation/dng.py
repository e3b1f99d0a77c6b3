"""DNG files as a Zenmuse X5S writes them: the mosaic untouched, with its levels and its EXIF."""

import math
from datetime import datetime
from pathlib import Path
from typing import Literal

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from radiometry.frame.exposure import Settings
from simulation.camera import Camera
from simulation.tiff import (
    ASCII,
    BYTE,
    LONG,
    RATIONAL,
    SHORT,
    SRATIONAL,
    UNDEFINED,
    Entries,
    TiffWriter,
    append_strip,
    approximate,
    describe_exposure,
    describe_image,
)

_CFA = 32803
_TILE_PX = 256
_COLOURS = {"R": 0, "G": 1, "B": 2}
# XYZ to camera. Nothing here depends on it: a converter asks for one before it opens a colour DNG.
_COLOUR_MATRIX = (7013, -1408, -635, -5268, 12902, 2640, -1470, 2801, 7379)

Compression = Literal["none", "ljpeg"]


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
    writer = TiffWriter()
    append = append_strip if compression == "none" else _append_tiles
    image = describe_image(mosaic_dn, photometric=_CFA) | append(writer, mosaic_dn)
    exif = writer.directory(_describe(camera, settings, taken_at))
    body, sensor = camera.body, camera.sensor
    tags: Entries = {
        271: (ASCII, body.make),
        272: (ASCII, body.model),
        274: (SHORT, 1),  # Orientation
        305: (ASCII, body.software),
        33421: (SHORT, [2, 2]),  # CFARepeatPatternDim
        33422: (BYTE, [_COLOURS[colour] for colour in sensor.cfa]),  # CFAPattern
        34665: (LONG, exif),
        50706: (BYTE, (1, 4, 0, 0)),  # DNGVersion
        50707: (BYTE, (1, 1, 0, 0)),  # DNGBackwardVersion
        50708: (ASCII, f"{body.make} {body.model}"),  # UniqueCameraModel
        50710: (BYTE, (0, 1, 2)),  # CFAPlaneColor
        50711: (SHORT, 1),  # CFALayout: a rectangle
        50713: (SHORT, [2, 2]),  # BlackLevelRepeatDim
        50714: (SHORT, [round(sensor.black_level_dn)] * 4),
        50717: (LONG, round(sensor.white_level_dn)),
        50721: (SRATIONAL, [(value, 10_000) for value in _COLOUR_MATRIX]),  # ColorMatrix1
        50728: (RATIONAL, [(1, 2), (1, 1), (2, 3)]),  # AsShotNeutral
        50735: (ASCII, body.serial),  # CameraSerialNumber
        50778: (SHORT, 21),  # CalibrationIlluminant1: D65
    }
    path.write_bytes(writer.finish(writer.directory(image | tags)))


def _describe(camera: Camera, settings: Settings, taken_at: datetime) -> Entries:
    body = camera.body
    return describe_exposure(settings, taken_at) | {
        34850: (SHORT, 1),  # ExposureProgram: manual
        34864: (SHORT, 2),  # SensitivityType: recommended exposure index
        36864: (UNDEFINED, b"0230"),  # ExifVersion
        37377: (SRATIONAL, approximate(-math.log2(settings.exposure_time_s))),  # ShutterSpeedValue
        37378: (RATIONAL, approximate(2 * math.log2(settings.f_number))),  # ApertureValue
        37386: (RATIONAL, approximate(body.focal_length_mm)),  # FocalLength
        41986: (SHORT, 1),  # ExposureMode: manual
        42033: (ASCII, body.serial),  # BodySerialNumber
        42035: (ASCII, body.lens_make),  # LensMake
        42036: (ASCII, body.lens_model),  # LensModel
        42037: (ASCII, body.lens_serial),  # LensSerialNumber
    }


def _append_tiles(writer: TiffWriter, mosaic_dn: NDArray[np.uint16]) -> Entries:
    """Append tiles of full size: the last ones repeat the border, which a reader cuts off again.

    Their sides are multiples of 16, as TIFF asks, within the image: LibRaw misreads a single, larger tile.
    """
    rows, cols = mosaic_dn.shape
    high, wide = (min(_TILE_PX, size - size % 16) for size in mosaic_dn.shape)
    padded = np.pad(mosaic_dn, ((0, -rows % high), (0, -cols % wide)), mode="edge")
    tiles = [
        imagecodecs.ljpeg_encode(
            np.ascontiguousarray(padded[row : row + high, col : col + wide]), bitspersample=16
        )
        for row in range(0, rows, high)
        for col in range(0, cols, wide)
    ]
    return {
        259: (SHORT, 7),  # Compression: JPEG
        322: (LONG, wide),
        323: (LONG, high),
        324: (LONG, [writer.append(tile) for tile in tiles]),
        325: (LONG, [len(tile) for tile in tiles]),
    }
