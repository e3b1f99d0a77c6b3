"""What a raw file says of itself, and the window of its mosaic that a region needs."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.multispectral import Multispectral


@dataclass(frozen=True, kw_only=True)
class Opcode:
    """One DNG opcode that the file asks a converter to apply. Detected and kept, never applied."""

    stage: int  # 1, 2 or 3: OpcodeList1..3
    name: str  # "GainMap", "WarpRectilinear", ..., or "opcode-<number>"
    sha256: str  # of its parameter bytes


@dataclass(frozen=True, kw_only=True)
class StatedAngle:
    """An angle of the camera or of what carries it, under the file's own name and in the unit which that has.

    ``name`` : with its family, such as "camera:Yaw"
    """

    name: str
    value: float


@dataclass(frozen=True, kw_only=True)
class FrameHeader:
    """The metadata of one raw file. What the file does not state is None; zero is kept as zero.

    Levels are per site of the CFA pattern in row-major order, in DN after linearisation.
    """

    container: str  # "dng" | "tiff" | "raw" (readable by LibRaw only) | "jpeg" | "png"
    decoder: str  # "stilb" | "libraw" | "imagecodecs"
    rendered: bool  # True: a picture that carries somebody's tone curve
    compression: str  # "none" | "ljpeg" | ...
    bits_per_sample: int
    width_px: int  # of the visible (active) area
    height_px: int
    cfa: str  # "RGGB", "GBRG", "BGGR", "GRBG", "grey" or "rgb", at the visible area's corner
    black_level_dn: tuple[float, ...]
    black_level_origin: str  # "tag" | "default" | "libraw"
    white_level_dn: tuple[float, ...]
    white_level_origin: str  # as for black, or "camera": known of this kind of camera
    exposure_time_s: float | None = None  # nominal: EXIF ExposureTime
    exposure_time_apex_s: float | None = None  # 2**-ShutterSpeedValue
    f_number: float | None = None  # nominal: EXIF FNumber
    f_number_apex: float | None = None  # 2**(ApertureValue/2)
    iso: float | None = None
    exposure_mode: str | None = None  # "manual" | "auto" | "bracket"
    exposure_program: str | None = None  # "manual" | "program" | "aperture_priority" | ...
    make: str | None = None
    model: str | None = None
    serial: str | None = None
    lens_make: str | None = None
    lens_model: str | None = None
    lens_serial: str | None = None
    taken_at: str | None = None  # EXIF DateTimeOriginal, RFC 3339; with the offset where the file has one
    orientation: int | None = None
    sensor_temperature_c: float | None = None
    software: str | None = None
    latitude_deg: float | None = None  # WGS 84, north positive; stated with the longitude or not at all
    longitude_deg: float | None = None  # east positive
    altitude_m: float | None = None  # above sea level, as the camera says; below it is negative
    attitude: tuple[StatedAngle, ...] = field(default=())  # kept and handed on, computed with by nothing
    opcodes: tuple[Opcode, ...] = field(default=())
    multispectral: Multispectral | None = None  # of a camera with one band a file and a sunshine sensor
    # A whole frame is read cheapest in bands of so many rows, the first of which may be cut by the border.
    band_rows: int = 1
    first_band_rows: int = 1


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A window of the linearised mosaic, black not subtracted.

    ``samples_dn`` : (row, col) uint16 [DN], or (row, col, 3) for a rendered RGB image
    ``row0, col0`` : the window's corner in the visible area, whose own corner is (0, 0)
    ``cfa``, ``white_level_dn`` : as in FrameHeader, at the visible area's corner (not the window's)
    ``black_level_dn`` : per CFA site, mean over the window, deltas included
    """

    samples_dn: NDArray[np.uint16]
    row0: int
    col0: int
    height_px: int  # of the whole visible area
    width_px: int
    cfa: str
    black_level_dn: tuple[float, ...]
    white_level_dn: tuple[float, ...]
