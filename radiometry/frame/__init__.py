"""Metadata of a raw file, and the window of its mosaic that a region needs."""

import math
from datetime import datetime
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.multispectral import Multispectral
from radiometry.frame.roi import Window
from radiometry.records import Record, later

EARLIEST_YEAR: Final = 2000  # A clock that was never set starts in 1970, or when a GPS week begins: 1980
_LOCAL_CLOCKS = frozenset({"dji"})  # These write the time of day of the place, without its offset


def has_set_clock(at: datetime) -> bool:
    """Return True unless a time lies before any of these cameras was built.

    Parameters
    ----------
    at : datetime
        Time as a file states it.
    """
    return at.year >= EARLIEST_YEAR


def writes_utc(system: str | None) -> bool:
    """Return True for a family of multispectral cameras that writes UTC without saying so.

    Parameters
    ----------
    system : str or None
        As in `Multispectral.system`; None for any other camera.
    """
    return system is not None and system not in _LOCAL_CLOCKS


class TableRow(Record):
    """Statistics of a frame's region as a table states them, black included."""

    mean_dn: float  #: Mean, smallest and largest sample [DN]
    min_dn: float
    max_dn: float
    pixels: int  #: Number of samples
    white_level_dn: float
    #: Standard deviation of the samples [DN]; None if the table does not state it
    std_dn: float | None = None
    black_level_dn: float | None = None  #: Black level [DN]; None if it is not known

    @property
    def is_possible(self) -> bool:
        """True if samples with these statistics exist."""
        levels = (self.mean_dn, self.min_dn, self.max_dn, self.white_level_dn)
        known = (*levels, self.std_dn or 0.0, self.black_level_dn or 0.0)
        return (
            all(map(math.isfinite, known))
            and 0.0 <= self.min_dn <= self.mean_dn <= self.max_dn <= self.white_level_dn
            and self.white_level_dn > (self.black_level_dn or 0.0) >= 0.0
            and self.pixels >= 1
            and (self.std_dn or 0.0) >= 0.0
        )

    @property
    def widest_std_dn(self) -> float:
        """The stated standard deviation, else the largest that samples of this mean and range can have [DN].

        [1] R. Bhatia, C. Davis, Am. Math. Mon. 107, 353 (2000), doi:10.1080/00029890.2000.12005203
        """
        if self.std_dn is not None:
            return self.std_dn
        return math.sqrt((self.max_dn - self.mean_dn) * (self.mean_dn - self.min_dn))

    @property
    def saturated_share(self) -> float:
        """Largest share of the samples that can lie at the white level."""
        if self.max_dn < self.white_level_dn:
            return 0.0
        span = self.max_dn - self.min_dn
        return (self.mean_dn - self.min_dn) / span if span > 0.0 else 1.0


class Opcode(Record):
    """One DNG opcode that the file asks a converter to apply; detected and stored, never applied."""

    stage: int  #: 1, 2 or 3 for OpcodeList1 to OpcodeList3
    name: str  #: "GainMap", "WarpRectilinear" and so on, or "opcode-<number>"
    sha256: str  #: Hash of the opcode's parameter bytes


class StatedAngle(Record):
    """An angle of the camera or its carrier, under the file's own name and in the file's unit."""

    name: str  #: Name with its family, such as "camera:Yaw"
    value: float  #: Value in the unit that the name has


class PositionFix(Record):
    """Quality of a position by satellites with corrections (RTK)."""

    kind: str  #: "none", "single", "float" or "fixed"; "other" for what the maker does not describe
    u_latitude_m: float | None = None  #: Standard deviations that the receiver states [m]
    u_longitude_m: float | None = None
    u_height_m: float | None = None


class FrameHeader(Record):
    """Metadata of one raw file; a value that the file does not state is None, and zero is kept as zero.

    Levels are given per CFA position in row-major order, in DN after linearisation.
    """

    #: "dng", "tiff", "raw" (readable by LibRaw only), "jpeg" or "png"; "table" for a row of a table, which
    #: has no pixels
    container: str
    decoder: str  #: "stilb", "libraw" or "imagecodecs"
    rendered: bool  #: True for an image to which a tone curve was applied
    compression: str  #: "none", "ljpeg" and so on
    bits_per_sample: int
    width_px: int  #: Size of the visible (active) area [px]
    height_px: int
    cfa: str  #: "RGGB", "GBRG", "BGGR", "GRBG", "grey" or "rgb", at the visible area's corner
    black_level_dn: tuple[float, ...]  #: Black level per CFA position [DN]
    #: "tag", "default", "libraw", "camera" if the camera's XMP states it, or "supplied" with a table
    black_level_origin: str
    white_level_dn: tuple[float, ...]  #: White level per CFA position [DN]
    white_level_origin: str  #: As for black, or "camera" if it is known for this kind of camera
    exposure_time_s: float | None = None  #: Nominal exposure time from EXIF ExposureTime [s]
    exposure_time_apex_s: float | None = None  #: 2^-ShutterSpeedValue [s]
    f_number: float | None = None  #: Nominal f-number from EXIF FNumber
    f_number_apex: float | None = None  #: 2^(ApertureValue / 2)
    iso: float | None = None
    exposure_mode: str | None = None  #: "manual", "auto" or "bracket"
    exposure_program: str | None = None  #: "manual", "program", "aperture_priority" and so on
    make: str | None = None  #: Manufacturer, model and serial number of the camera body
    model: str | None = None
    serial: str | None = None
    lens_make: str | None = None  #: Manufacturer, model and serial number of the lens
    lens_model: str | None = None
    lens_serial: str | None = None
    taken_at: str | None = None  #: EXIF DateTimeOriginal as in RFC 3339, with the offset if the file has one
    #: Offset from UTC that was stated for the clock of a file without one, such as "+02:00"
    clock_offset: str | None = later()
    orientation: int | None = None  #: EXIF orientation
    sensor_temperature_c: float | None = None
    software: str | None = None  #: Software or firmware that wrote the file
    #: Latitude in WGS 84, north positive [deg]; stated with the longitude or not at all
    latitude_deg: float | None = None
    longitude_deg: float | None = None  #: Longitude, east positive [deg]
    altitude_m: float | None = None  #: Height above sea level as the camera states it, negative below [m]
    #: Quality of the position; None if the file does not state it
    position_fix: PositionFix | None = later()
    #: Height above the take-off point that a DJI aircraft states [m]
    height_above_takeoff_m: float | None = later()
    attitude: tuple[StatedAngle, ...] = ()  #: Angles of camera and carrier
    opcodes: tuple[Opcode, ...] = ()  #: DNG opcodes of the file
    #: Metadata of a camera with one band per file and a sunshine sensor
    multispectral: Multispectral | None = None
    #: Statistics that stand in a table in the place of pixels
    table: TableRow | None = later()
    #: Rows per band in which a whole frame is read at the least cost; the border may cut the first band
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


class Frame(Record):
    """A window of the linearised mosaic; black is not subtracted."""

    samples_dn: NDArray[np.uint16]  #: Raw values [DN], (row, col), or (row, col, 3) for a rendered RGB image
    row0: int  #: Corner of the window in the visible area, whose own corner is (0, 0)
    col0: int
    height_px: int  #: Size of the whole visible area [px]
    width_px: int
    cfa: str  #: CFA pattern as in `FrameHeader`, at the visible area's corner (not the window's)
    #: Black level per CFA position [DN], mean over the window, deltas included
    black_level_dn: tuple[float, ...]
    white_level_dn: tuple[float, ...]  #: White level as in `FrameHeader` [DN], at the visible area's corner

    @property
    def window(self) -> Window:
        height, width = self.samples_dn.shape[:2]
        return Window(row0=self.row0, col0=self.col0, height=height, width=width)
