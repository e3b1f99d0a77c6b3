"""Metadata of a raw file, and the window of its mosaic that a region needs."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.multispectral import Multispectral
from radiometry.frame.table import TableRow
from radiometry.specification.stored import LATER


@dataclass(frozen=True, kw_only=True)
class Opcode:
    """One DNG opcode that the file asks a converter to apply; detected and stored, never applied.

    Attributes
    ----------
    stage : int
        1, 2 or 3 for OpcodeList1 to OpcodeList3.
    name : str
        "GainMap", "WarpRectilinear" and so on, or "opcode-<number>".
    sha256 : str
        Hash of the opcode's parameter bytes.
    """

    stage: int
    name: str
    sha256: str


@dataclass(frozen=True, kw_only=True)
class StatedAngle:
    """An angle of the camera or its carrier, under the file's own name and in the file's unit.

    Attributes
    ----------
    name : str
        Name with its family, such as "camera:Yaw".
    value : float
        Value in the unit that the name has.
    """

    name: str
    value: float


@dataclass(frozen=True, kw_only=True)
class PositionFix:
    """Quality of a position by satellites with corrections (RTK).

    Attributes
    ----------
    kind : str
        "none", "single", "float" or "fixed"; "other" for what the maker does not
        describe.
    u_latitude_m, u_longitude_m, u_height_m : float or None, default: None
        Standard deviations that the receiver states [m].
    """

    kind: str
    u_latitude_m: float | None = None
    u_longitude_m: float | None = None
    u_height_m: float | None = None


@dataclass(frozen=True, kw_only=True)
class FrameHeader:
    """Metadata of one raw file; a value that the file does not state is None, and zero is kept as zero.

    Levels are given per CFA position in row-major order, in DN after linearisation.

    Attributes
    ----------
    container : str
        "dng", "tiff", "raw" (readable by LibRaw only), "jpeg" or "png"; "table" for a
        row of a table, which has no pixels.
    decoder : str
        "stilb", "libraw" or "imagecodecs".
    rendered : bool
        True for an image to which a tone curve was applied.
    compression : str
        "none", "ljpeg" and so on.
    bits_per_sample : int
        Bits per sample.
    width_px, height_px : int
        Size of the visible (active) area [px].
    cfa : str
        "RGGB", "GBRG", "BGGR", "GRBG", "grey" or "rgb", at the visible area's
        corner.
    black_level_dn : tuple of float
        Black level per CFA position [DN].
    black_level_origin : str
        "tag", "default", "libraw", "camera" if the camera's XMP states it, or
        "supplied" with a table.
    white_level_dn : tuple of float
        White level per CFA position [DN].
    white_level_origin : str
        As for black, or "camera" if it is known for this kind of camera.
    exposure_time_s : float or None, default: None
        Nominal exposure time from EXIF ExposureTime [s].
    exposure_time_apex_s : float or None, default: None
        2^-ShutterSpeedValue [s].
    f_number : float or None, default: None
        Nominal f-number from EXIF FNumber.
    f_number_apex : float or None, default: None
        2^(ApertureValue / 2).
    iso : float or None, default: None
        ISO value.
    exposure_mode : str or None, default: None
        "manual", "auto" or "bracket".
    exposure_program : str or None, default: None
        "manual", "program", "aperture_priority" and so on.
    make, model, serial : str or None, default: None
        Manufacturer, model and serial number of the camera body.
    lens_make, lens_model, lens_serial : str or None, default: None
        Manufacturer, model and serial number of the lens.
    taken_at : str or None, default: None
        EXIF DateTimeOriginal as in RFC 3339, with the offset if the file has one.
    clock_offset : str or None, default: None
        Offset from UTC that was stated for the clock of a file without one, such as
        "+02:00".
    orientation : int or None, default: None
        EXIF orientation.
    sensor_temperature_c : float or None, default: None
        Temperature of the sensor [degree Celsius].
    software : str or None, default: None
        Software or firmware that wrote the file.
    latitude_deg : float or None, default: None
        Latitude in WGS 84, north positive [deg]; stated with the longitude or not
        at all.
    longitude_deg : float or None, default: None
        Longitude, east positive [deg].
    altitude_m : float or None, default: None
        Height above sea level as the camera states it, negative below [m].
    position_fix : PositionFix or None, default: None
        Quality of the position; None if the file does not state it.
    height_above_takeoff_m : float or None, default: None
        Height above the take-off point that a DJI aircraft states [m].
    attitude : tuple of StatedAngle
        Angles of camera and carrier.
    opcodes : tuple of Opcode
        DNG opcodes of the file.
    multispectral : Multispectral or None, default: None
        Metadata of a camera with one band per file and a sunshine sensor.
    table : TableRow or None, default: None
        Statistics that stand in a table in the place of pixels.
    band_rows, first_band_rows : int, default: 1
        Rows per band in which a whole frame is read at the least cost; the border
        may cut the first band.
    """

    container: str
    decoder: str
    rendered: bool
    compression: str
    bits_per_sample: int
    width_px: int
    height_px: int
    cfa: str
    black_level_dn: tuple[float, ...]
    black_level_origin: str
    white_level_dn: tuple[float, ...]
    white_level_origin: str
    exposure_time_s: float | None = None
    exposure_time_apex_s: float | None = None
    f_number: float | None = None
    f_number_apex: float | None = None
    iso: float | None = None
    exposure_mode: str | None = None
    exposure_program: str | None = None
    make: str | None = None
    model: str | None = None
    serial: str | None = None
    lens_make: str | None = None
    lens_model: str | None = None
    lens_serial: str | None = None
    taken_at: str | None = None
    clock_offset: str | None = field(default=None, metadata=LATER)
    orientation: int | None = None
    sensor_temperature_c: float | None = None
    software: str | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_m: float | None = None
    position_fix: PositionFix | None = field(default=None, metadata=LATER)
    height_above_takeoff_m: float | None = field(default=None, metadata=LATER)
    attitude: tuple[StatedAngle, ...] = field(default=())
    opcodes: tuple[Opcode, ...] = field(default=())
    multispectral: Multispectral | None = None
    table: TableRow | None = field(default=None, metadata=LATER)
    # A whole frame is read cheapest in bands of so many rows, the first of which may be cut by the border.
    band_rows: int = 1
    first_band_rows: int = 1

    @property
    def zoned_at(self) -> str | None:
        """`taken_at` with the offset of the file, or with the one stated for its clock."""
        return self.taken_at and self.taken_at + (self.clock_offset or "")

    @property
    def assumes_black(self) -> bool:
        """True if a raw file states no black level at all, so that 0 is read for it."""
        band = self.multispectral
        stated = self.black_level_origin != "default" or (band is not None and band.sensor_model is not None)
        return not (stated or self.rendered)


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A window of the linearised mosaic; black is not subtracted.

    Attributes
    ----------
    samples_dn : ndarray of uint16
        Raw values [DN], (row, col), or (row, col, 3) for a rendered RGB image.
    row0, col0 : int
        Corner of the window in the visible area, whose own corner is (0, 0).
    height_px, width_px : int
        Size of the whole visible area [px].
    cfa : str
        CFA pattern as in `FrameHeader`, at the visible area's corner (not the
        window's).
    black_level_dn : tuple of float
        Black level per CFA position [DN], mean over the window, deltas included.
    white_level_dn : tuple of float
        White level as in `FrameHeader` [DN], at the visible area's corner.
    """

    samples_dn: NDArray[np.uint16]
    row0: int
    col0: int
    height_px: int
    width_px: int
    cfa: str
    black_level_dn: tuple[float, ...]
    white_level_dn: tuple[float, ...]
