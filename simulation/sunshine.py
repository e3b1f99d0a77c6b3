"""A sunshine sensor that counts light at several gains."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radiometry.frame.multispectral import GainMeasurement, SunshineCounts, SunshineRecord
from radiometry.reflectance.sun import Tilt, level_factor, sun_angle_deg
from radiometry.reflectance.sunshine import SATURATED_COUNT

_STEP_US = 200_000
_TABLE_TIME_S = 0.6
_INTEGRATION_S = 0.1


@dataclass(frozen=True, kw_only=True)
class SunshineSensor:
    """A sensor beside the camera that looks up.

    Attributes
    ----------
    gains : tuple of float
        True gains by index, relative to index 1.
    table_counts : int
        CH0 of row 1 of the gain table.
    sunshine_noise_rel : float
        Relative standard deviation of one reading.
    attitude_deg : tuple of float
        Yaw, pitch and roll, which its records state [deg].
    tilt : Tilt or None
        Sun and diffuser, for a reading that depends on the attitude; None: it does not.

    """

    sunshine_serial: str = "PI040379AA6E000358"
    gains: tuple[float, ...] = (0.0345, 1.0, 12.1, 145.0)
    table_counts: int = 3300
    sunshine_noise_rel: float = 0.01
    attitude_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tilt: Tilt | None = None

    def count(
        self, i_ss: float, random: np.random.Generator, *, gain_indices: Sequence[int]
    ) -> SunshineCounts:
        """Draw readings 0.2 s apart of a light ``i_ss`` [counts/s at gain index 1]: whole, 65535 at most."""
        yaw, pitch, roll = self.attitude_deg
        if self.tilt is not None:
            angle = sun_angle_deg(self.tilt.sun, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
            i_ss /= level_factor(angle, self.tilt)
        records = []
        for number, index in enumerate(gain_indices):
            counts = self.gains[index] * i_ss * (1.0 + self.sunshine_noise_rel * random.standard_normal())
            records.append(
                SunshineRecord(
                    time_us=100_000_000 + number * _STEP_US,
                    ch0=_whole(_INTEGRATION_S * counts),
                    ch1=_whole(_INTEGRATION_S * counts / 5.0),
                    gain_index=index,
                    integration_time_s=_INTEGRATION_S,
                    yaw_deg=yaw,
                    pitch_deg=pitch,
                    roll_deg=roll,
                )
            )
        table = tuple(
            GainMeasurement(
                gain_index=index,
                integration_time_s=_TABLE_TIME_S,
                ch0=_whole(self.table_counts * gain),
                ch1=_whole(self.table_counts * gain / 4.0),
            )
            for index, gain in enumerate(self.gains)
        )
        return SunshineCounts(record_bytes=28, cut_short=False, records=tuple(records), gains=table)


def _whole(counts: float) -> int:
    return round(min(counts, float(SATURATED_COUNT)))
