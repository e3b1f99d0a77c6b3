"""A Sequoia's IrradianceList and IrradianceCalibrationMeasurement: sunshine readings and their gain table."""

import base64
import binascii
import itertools
import re
import struct
from collections.abc import Sequence
from typing import Final

from radiometry.frame.multispectral import GainMeasurement, SunshineCounts, SunshineRecord

# time [us], CH0, CH1, [gain index, integration [ms],] yaw, pitch[, roll]: newest firmware first.
_LAYOUTS: Final = (struct.Struct("<QHHHHfff"), struct.Struct("<QHHfff"), struct.Struct("<QHHff"))
_WITH_GAIN: Final = 28
MAX_RECORDS: Final = 2_000
_MOST_GAINS: Final = 16
# Readings follow each other every 0.2 s; a gap of a few is still a list, another layout's times are not.
_SHORTEST_STEP_US: Final = 20_000
_LONGEST_STEP_US: Final = 5_000_000
_LATEST_US: Final = 10**15  # thirty years since the camera was switched on


def read_counts(encoded: str, measurement: Sequence[float]) -> SunshineCounts | str:
    """The readings, or a sentence saying why there are none."""
    raw = _decode(encoded)
    if not raw:
        return "the file's IrradianceList is empty or not base64"
    fitting = [layout for layout in _LAYOUTS if _is_list(raw, layout)]
    if not fitting:
        return "the records of the file's IrradianceList have none of the known lengths"
    # A list that its records fill exactly is more certain than one that was cut short.
    layout = min(fitting, key=lambda each: (len(raw) % each.size > 0, _LAYOUTS.index(each)))
    rows = list(_unpack(raw, layout))[:MAX_RECORDS]
    return SunshineCounts(
        record_bytes=layout.size,
        cut_short=len(raw) % layout.size > 0,
        records=tuple(_record(row, with_gain=layout.size == _WITH_GAIN) for row in rows),
        gains=read_gains(measurement),
    )


def read_gains(measurement: Sequence[float]) -> tuple[GainMeasurement, ...]:
    """Rows of gain index, integration time [ms], CH0, CH1; none where they are not whole rows of counts."""
    whole = [int(number) for number in measurement if number == int(number) and 0 <= number <= 0xFFFF]
    if len(whole) != len(measurement) or len(whole) % 4 or len(whole) > 4 * _MOST_GAINS:
        return ()
    rows = zip(*[iter(whole)] * 4, strict=True)
    return tuple(
        GainMeasurement(gain_index=index, integration_time_s=time_ms / 1000, ch0=ch0, ch1=ch1)
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


def _unpack(raw: bytes, layout: struct.Struct) -> "itertools.chain[tuple[float, ...]]":
    whole = len(raw) - len(raw) % layout.size
    return itertools.chain(layout.iter_unpack(raw[:whole]))


def _is_list(raw: bytes, layout: struct.Struct) -> bool:
    """Return True if the times of the records rise as readings do; a single one is told by its length."""
    times = [int(row[0]) for row in _unpack(raw, layout)]
    if len(times) < 2:
        return len(raw) == layout.size and times[0] < _LATEST_US
    steps = [after - before for before, after in itertools.pairwise(times)]
    return times[-1] < _LATEST_US and all(_SHORTEST_STEP_US <= step <= _LONGEST_STEP_US for step in steps)


def _record(row: tuple[float, ...], *, with_gain: bool) -> SunshineRecord:
    time_us, ch0, ch1, *rest = row
    gain, integration_ms = (rest.pop(0), rest.pop(0)) if with_gain else (None, None)
    yaw, pitch, roll = (_angle(angle) for angle in (*rest, None)[:3])
    return SunshineRecord(
        time_us=int(time_us),
        ch0=int(ch0),
        ch1=int(ch1),
        gain_index=None if gain is None else int(gain),
        integration_time_s=None if integration_ms is None else integration_ms / 1000,
        yaw_deg=yaw,
        pitch_deg=pitch,
        roll_deg=roll,
    )


def _angle(value: float | None) -> float | None:
    """Degrees, or nothing: NaN and what no attitude is."""
    return value if value is not None and abs(value) <= 360 else None
