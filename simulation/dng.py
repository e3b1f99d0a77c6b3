"""DNG files, and TIFF byte by byte, in either order, right or wrong as a test wants them."""

import math
import struct
from collections.abc import Mapping
from datetime import datetime
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from radiometry.frame.exposure import Settings
from simulation.camera import Camera

BYTE, ASCII, SHORT, LONG, RATIONAL, UNDEFINED, SRATIONAL, DOUBLE = 1, 2, 3, 4, 5, 7, 10, 12
_FORMATS = {SHORT: "H", LONG: "I", RATIONAL: "II", SRATIONAL: "ii", DOUBLE: "d"}
_LARGEST_DENOMINATOR = 1_000_000

Entries = dict[int, tuple[int, Any]]  # kind and values by tag; a fraction is a pair


class TiffWriter:
    """Writer that only appends: data, then the directories that point to it, then the first directory."""

    def __init__(self, order: str = "<") -> None:
        self.order = order
        self.content = bytearray((b"II*\0" if order == "<" else b"MM\0*") + b"\0\0\0\0")

    def append(self, data: bytes | bytearray) -> int:
        """Append data on a word; return its offset."""
        self.content += b"\0" * (len(self.content) % 2)
        offset = len(self.content)
        self.content += data
        return offset

    def directory(self, entries: Mapping[int, tuple[int, Any]]) -> int:
        """Append a directory; return its offset."""
        table = b""
        for tag, (kind, values) in sorted(entries.items()):
            data, count = self._encode(kind, values)
            if len(data) > 4:
                data = struct.pack(self.order + "I", self.append(data))
            table += struct.pack(self.order + "HHI", tag, kind, count) + data.ljust(4, b"\0")
        return self.append(struct.pack(self.order + "H", len(entries)) + table + b"\0\0\0\0")

    def finish(self, first_directory: int) -> bytes:
        """Return the file."""
        struct.pack_into(self.order + "I", self.content, 4, first_directory)
        return bytes(self.content)

    def _encode(self, kind: int, values: Any) -> tuple[bytes, int]:  # noqa: ANN401  of any kind
        if kind in (ASCII, UNDEFINED, BYTE):
            data = values.encode() + b"\0" if isinstance(values, str) else bytes(values)
            return data, len(data)
        values = values if isinstance(values, list) else [values]
        layout = self.order + _FORMATS[kind]
        pairs = [value if isinstance(value, tuple) else (value,) for value in values]
        return b"".join(struct.pack(layout, *pair) for pair in pairs), len(values)


def describe_image(samples: NDArray[np.uint16], *, photometric: int) -> Entries:
    """Return the entries of an image of 16-bit words, without those of its data."""
    rows, cols = samples.shape
    return {
        254: (LONG, 0),  # NewSubfileType
        256: (LONG, cols),
        257: (LONG, rows),
        258: (SHORT, 16),
        259: (SHORT, 1),  # Compression: none
        262: (SHORT, photometric),
        277: (SHORT, 1),  # SamplesPerPixel
        284: (SHORT, 1),  # PlanarConfiguration
    }


def append_strip(writer: TiffWriter, samples: NDArray[np.uint16]) -> Entries:
    """Append an image as one strip; return the entries of its data."""
    offset = writer.append(samples.astype(writer.order + "u2").tobytes())
    return {273: (LONG, offset), 278: (LONG, samples.shape[0]), 279: (LONG, samples.nbytes)}


def approximate(value: float) -> tuple[int, int]:
    """Return the nearest fraction with a denominator of at most 10^6: 1/60 s stays 1/60."""
    return Fraction(value).limit_denominator(_LARGEST_DENOMINATOR).as_integer_ratio()


def describe_exposure(settings: Settings, taken_at: datetime) -> Entries:
    """Return the EXIF entries of nominal settings and of a time with its offset."""
    offset = f"{taken_at:%z}"
    return {
        33434: (RATIONAL, approximate(settings.exposure_time_s)),  # ExposureTime
        33437: (RATIONAL, approximate(settings.f_number)),  # FNumber
        34855: (SHORT, round(settings.iso)),  # PhotographicSensitivity
        36867: (ASCII, f"{taken_at:%Y:%m:%d %H:%M:%S}"),  # DateTimeOriginal
        36881: (ASCII, f"{offset[:3]}:{offset[3:5]}"),  # OffsetTimeOriginal
    }


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
    """Write a mosaic as the CFA image of a DNG 1.4: one strip of 16-bit words, or lossless JPEG in tiles."""
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
    """Append full tiles, sides multiples of 16 within the image: LibRaw misreads a single, larger one."""
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
