"""Parrot's Sequoia: SensorModel, a 2-D lens polynomial, and counts of the sunshine sensor."""

import re
from datetime import UTC, datetime

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import Multispectral, SensorModel, SunshineCounts
from worker.decode import tags
from worker.decode.irradiance import read_counts
from worker.decode.packet import (
    Packet,
    describe_band,
    first_problem,
    read_geometry,
    read_polynomial,
    read_text,
)
from worker.decode.tiff import Directory
from worker.decode.xmp import Xmp

IDENTITIES = ("camera:CaptureUUID", "camera:FlightUUID")
_SENSOR_BITS = 10


def knows(packet: Packet) -> bool:
    return bool(packet.xmp.numbers("camera:SensorModel")) or packet.make.lower() == "parrot"


def read(packet: Packet) -> Multispectral:
    xmp = packet.xmp
    model, no_model = xmp.require("camera:SensorModel", 3)
    lens, no_lens = read_polynomial(xmp)
    counts = _read_counts(xmp)
    capture, flight = IDENTITIES
    return Multispectral(
        system="sequoia",
        **describe_band(packet, sensor_bits=_SENSOR_BITS),
        capture_id=xmp.text(capture),
        flight_id=xmp.text(flight),
        sensor_model=SensorModel(a=model[0], b=model[1], c=model[2]) if model else None,
        vignetting_polynomial=lens,
        problem=first_problem((no_model, no_lens)),
        sunshine_serial=xmp.text("camera:SunshineSerialNumber"),
        sunshine_missing=counts if isinstance(counts, str) else "",
        counts=None if isinstance(counts, str) else counts,
        exposed_at_us=_read_monotonic_time(packet.main),
        geometry=read_geometry(packet, reference=xmp.index("camera:RigCameraIndex") == 0),
    )


def _read_counts(xmp: Xmp) -> SunshineCounts | str:
    encoded = xmp.whole("camera:IrradianceList")
    if encoded is None:
        return "the file has no IrradianceList: no sunshine sensor was connected"
    return read_counts(encoded, xmp.numbers("camera:IrradianceCalibrationMeasurement"))


def _read_monotonic_time(main: Directory) -> int | None:
    """A Sequoia writes the clock of its sunshine records as the time of digitisation, counted from 1970."""
    try:
        exif = main.directory(tags.EXIF)
        if exif is None:
            return None
        text = read_text(exif, tags.DATE_TIME_DIGITIZED)
        fraction = read_text(exif, tags.SUB_SEC_TIME_DIGITIZED)
        stamp = datetime.strptime(text, "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC)
    except (InputRejected, ValueError):
        return None
    if stamp.year != 1970 or not re.fullmatch(r"[0-9]{0,6}", fraction):
        return None
    return int(stamp.timestamp()) * 1_000_000 + int(fraction.ljust(6, "0"))
