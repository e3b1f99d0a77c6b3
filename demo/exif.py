"""The EXIF of a frame of a camera with a lens."""

import math
from dataclasses import dataclass
from datetime import datetime

from demo.directory import Entry, rational, short, signed_rational, text, undefined

_MANUAL_MODE, _MANUAL_PROGRAM, _ISO_IS_RECOMMENDED_INDEX = 1, 1, 2


@dataclass(frozen=True, kw_only=True)
class Exposure:
    """What a camera writes about one exposure. Nominal and APEX values agree: both come from these."""

    exposure_time_s: float
    f_number: float
    iso: int
    taken_at: datetime
    body_serial: str
    lens_make: str
    lens_model: str
    lens_serial: str
    focal_length_mm: float


def exif_entries(exposure: Exposure) -> list[Entry]:
    """Give the entries of the EXIF directory."""
    moment = exposure.taken_at
    return [
        rational(33434, exposure.exposure_time_s),  # ExposureTime
        rational(33437, exposure.f_number),  # FNumber
        short(34850, _MANUAL_PROGRAM),  # ExposureProgram
        short(34855, exposure.iso),  # PhotographicSensitivity
        short(34864, _ISO_IS_RECOMMENDED_INDEX),  # SensitivityType
        undefined(36864, b"0230"),  # ExifVersion
        text(36867, moment.strftime("%Y:%m:%d %H:%M:%S")),  # DateTimeOriginal
        text(36881, moment.strftime("%z")[:3] + ":" + moment.strftime("%z")[3:5]),  # OffsetTimeOriginal
        signed_rational(37377, -math.log2(exposure.exposure_time_s)),  # ShutterSpeedValue
        rational(37378, 2 * math.log2(exposure.f_number)),  # ApertureValue
        rational(37386, exposure.focal_length_mm),  # FocalLength
        short(41986, _MANUAL_MODE),  # ExposureMode
        text(42033, exposure.body_serial),  # BodySerialNumber
        text(42035, exposure.lens_make),  # LensMake
        text(42036, exposure.lens_model),  # LensModel
        text(42037, exposure.lens_serial),  # LensSerialNumber
    ]
