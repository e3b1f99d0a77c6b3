"""Parrot's Sequoia: SensorModel, a 2-D lens polynomial, and counts of the sunshine sensor."""

import base64
import binascii
import itertools
import re
import struct
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import Final

from radiometry.findings import InputRejected
from radiometry.frame import multispectral
from worker.decode import packet as packets
from worker.decode import tags, tiff

# time [us], CH0, CH1, [gain index, integration [ms],] yaw, pitch[, roll]: newest firmware first.
_LAYOUTS: Final = (struct.Struct("<QHHHHfff"), struct.Struct("<QHHfff"), struct.Struct("<QHHff"))
_WITH_GAIN: Final = 28
MAX_RECORDS: Final = 2_000
_MOST_GAINS: Final = 16
# Readings follow each other every 0.2 s; a gap of a few is still a list, another layout's times are not.
_SHORTEST_STEP_US: Final = 20_000
_LONGEST_STEP_US: Final = 5_000_000
_LATEST_US: Final = 10**15  # thirty years since the camera was switched on


def read_counts(encoded: str, measurement: Sequence[float]) -> multispectral.SunshineCounts | str:
    """The readings, or a sentence saying why there are none."""
    if not (raw := _decode(encoded)):
        return "the file's IrradianceList is empty or not base64"
    if not (fitting := [layout for layout in _LAYOUTS if _is_list(raw, layout)]):
        return "the records of the file's IrradianceList have none of the known lengths"
    # A list that its records fill exactly is more certain than one that was cut short.
    layout = min(fitting, key=lambda each: (len(raw) % each.size > 0, _LAYOUTS.index(each)))
    rows = list(_unpack(raw, layout))[:MAX_RECORDS]
    return multispectral.SunshineCounts(
        record_bytes=layout.size,
        cut_short=len(raw) % layout.size > 0,
        records=tuple(_record(row, with_gain=layout.size == _WITH_GAIN) for row in rows),
        gains=read_gains(measurement),
    )


def read_gains(measurement: Sequence[float]) -> tuple[multispectral.GainMeasurement, ...]:
    """Rows of gain index, integration time [ms], CH0, CH1; none where they are not whole rows of counts."""
    whole = [int(number) for number in measurement if number == int(number) and 0 <= number <= 0xFFFF]
    if len(whole) != len(measurement) or len(whole) % 4 or len(whole) > 4 * _MOST_GAINS:
        return ()
    rows = zip(*[iter(whole)] * 4, strict=True)
    return tuple(
        multispectral.GainMeasurement(gain_index=index, integration_time_s=time_ms / 1000, ch0=ch0, ch1=ch1)
        for index, time_ms, ch0, ch1 in rows
    )


def _decode(encoded: str) -> bytes:
    """Firmware breaks lines; the procedure tells of a dot before and after; a cut text ends in a quarter."""
    text = re.sub(r"\s", "", encoded).strip(".").rstrip("=")
    text = text[: len(text) - (len(text) % 4 == 1)]
    try:
        return base64.b64decode(text + "=" * (-len(text) % 4), validate=True)
    except (binascii.Error, ValueError):
        return b""


def _unpack(raw: bytes, layout: struct.Struct) -> Iterator[tuple[float, ...]]:
    return layout.iter_unpack(raw[: len(raw) - len(raw) % layout.size])


def _is_list(raw: bytes, layout: struct.Struct) -> bool:
    """Return True if the times of the records rise as readings do; a single one is told by its length."""
    times = [int(row[0]) for row in _unpack(raw, layout)]
    if len(times) < 2:
        return len(raw) == layout.size and times[0] < _LATEST_US
    steps = [after - before for before, after in itertools.pairwise(times)]
    return times[-1] < _LATEST_US and all(_SHORTEST_STEP_US <= step <= _LONGEST_STEP_US for step in steps)


def _record(row: tuple[float, ...], *, with_gain: bool) -> multispectral.SunshineRecord:
    time_us, ch0, ch1, *rest = row
    gain, integration_ms = (rest.pop(0), rest.pop(0)) if with_gain else (None, None)
    # degrees, or nothing: NaN and what no attitude is
    yaw, pitch, roll = (
        (angle if angle is not None and abs(angle) <= 360 else None) for angle in (*rest, None)[:3]
    )
    return multispectral.SunshineRecord(
        time_us=int(time_us),
        ch0=int(ch0),
        ch1=int(ch1),
        gain_index=None if gain is None else int(gain),
        integration_time_s=None if integration_ms is None else integration_ms / 1000,
        yaw_deg=yaw,
        pitch_deg=pitch,
        roll_deg=roll,
    )


IDENTITIES = ("camera:CaptureUUID", "camera:FlightUUID")
_SENSOR_BITS = 10


def knows(packet: packets.Packet) -> bool:
    return bool(packet.xmp.numbers("camera:SensorModel")) or packet.make.lower() == "parrot"


def read(packet: packets.Packet) -> multispectral.Multispectral:
    xmp = packet.xmp
    model, no_model = xmp.require("camera:SensorModel", 3)
    lens, no_lens = packets.read_polynomial(xmp)
    encoded = xmp.whole("camera:IrradianceList")
    counts: multispectral.SunshineCounts | str
    if encoded is None:
        counts = "the file has no IrradianceList: no sunshine sensor was connected"
    else:
        counts = read_counts(encoded, xmp.numbers("camera:IrradianceCalibrationMeasurement"))
    capture, flight = IDENTITIES
    return multispectral.Multispectral(
        system="sequoia",
        **packets.describe_band(packet, sensor_bits=_SENSOR_BITS),
        capture_id=xmp.text(capture),
        flight_id=xmp.text(flight),
        sensor_model=multispectral.SensorModel(a=model[0], b=model[1], c=model[2]) if model else None,
        vignetting_polynomial=lens,
        problem=packets.first_problem((no_model, no_lens)),
        sunshine_serial=xmp.text("camera:SunshineSerialNumber"),
        sunshine_missing=counts if isinstance(counts, str) else "",
        counts=None if isinstance(counts, str) else counts,
        exposed_at_us=_read_monotonic_time(packet.main),
        geometry=packets.read_geometry(packet, reference=xmp.index("camera:RigCameraIndex") == 0),
    )


def _read_monotonic_time(main: tiff.Directory) -> int | None:
    """A Sequoia writes the clock of its sunshine records as the time of digitisation, counted from 1970."""
    try:
        if (exif := main.directory(tags.EXIF)) is None:
            return None
        text = packets.read_text(exif, tags.DATE_TIME_DIGITIZED)
        fraction = packets.read_text(exif, tags.SUB_SEC_TIME_DIGITIZED)
        stamp = datetime.strptime(text, "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC)
    except (InputRejected, ValueError):
        return None
    if stamp.year != 1970 or not re.fullmatch(r"[0-9]{0,6}", fraction):
        return None
    return int(stamp.timestamp()) * 1_000_000 + int(fraction.ljust(6, "0"))
