"""Readings of the sensor on top of the aircraft that looks at the sky."""

from dataclasses import dataclass, field
from typing import Literal

from radiometry.specification.stored import LATER

# The surface of an irradiance: levelled by stilb, on a level surface by the camera, corrected by the camera
# as its maker does not state, or as the sensor was oriented.
LightBasis = Literal["levelled", "horizontal", "compensated", "oriented"]


@dataclass(frozen=True, kw_only=True)
class SunshineRecord:
    """One reading of a Sequoia's sunshine sensor.

    Attributes
    ----------
    time_us : int
        Time of the camera's monotonic clock [us].
    ch0, ch1 : int
        Counts of the two channels.
    gain_index : int or None, default: None
        None in records of firmware that did not write it.
    integration_time_s : float or None, default: None
        Integration time [s]; None in the same records.
    yaw_deg, pitch_deg, roll_deg : float or None, default: None
        Attitude [deg]; None if the record has none.
    """

    time_us: int
    ch0: int
    ch1: int
    gain_index: int | None = None
    integration_time_s: float | None = None
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None


@dataclass(frozen=True, kw_only=True)
class GainMeasurement:
    """Counts of the sunshine sensor at one gain; all rows of a file were taken at equal light.

    Attributes
    ----------
    gain_index : int
        Index of the gain.
    integration_time_s : float
        Integration time [s].
    ch0, ch1 : int
        Counts of the two channels.
    """

    gain_index: int
    integration_time_s: float
    ch0: int
    ch1: int


@dataclass(frozen=True, kw_only=True)
class SunshineCounts:
    """Irradiance list and gain table of a Sequoia.

    Attributes
    ----------
    record_bytes : int
        Size of a record: 28, 24 or 20 bytes.
    cut_short : bool
        True if the list ended within a record, which was left out.
    records : tuple of SunshineRecord
        Readings of the list.
    gains : tuple of GainMeasurement
        Rows of IrradianceCalibrationMeasurement; empty if the file has none.
    """

    record_bytes: int
    cut_short: bool
    records: tuple[SunshineRecord, ...]
    gains: tuple[GainMeasurement, ...]


@dataclass(frozen=True, kw_only=True)
class SunshineIrradiance:
    """One reading of a light sensor as irradiance; in SI units, or in the sensor's own.

    Attributes
    ----------
    irradiance_w_m2_nm : float or None, default: None
        Irradiance [W/m2/nm]; None if the sensor's scale to SI is not known.
    relative_irradiance : float or None, default: None
        Irradiance in the sensor's own unit, if `irradiance_w_m2_nm` is None.
    quantity : str
        "horizontal" (on a level surface, computed by the camera), "spectral" (as the
        sensor was oriented) or "compensated" (corrected by the camera in a way that
        its maker does not state).
    unit_origin : str
        Origin of the unit: "tag" (the file states the scale), "model" (the camera
        works with one kind of sensor), "dls1" (taken for W/m2/nm), "dls2" (taken for
        uW/cm2/nm) or "own" (not known).
    yaw_deg, pitch_deg, roll_deg : float or None, default: None
        Attitude of the sensor [deg]; None if the file has none.
    file_unit : str or None, default: None
        Unit in which the file states the irradiance.
    distrust : str or None, default: None
        Why a horizontal irradiance that the file states was not used; None if it was,
        or if there is none.
    spectral_w_m2_nm, horizontal_w_m2_nm : float or None, default: None
        Irradiance as oriented, and on a level surface, as the file states them
        [W/m2/nm].
    direct_w_m2_nm : float or None, default: None
        Direct light on a plane normal to the sun [W/m2/nm].
    scattered_w_m2_nm : float or None, default: None
        Scattered light on a level surface [W/m2/nm].
    solar_elevation_deg, solar_azimuth_deg : float or None, default: None
        Position of the sun as the file states it [deg].
    """

    irradiance_w_m2_nm: float | None = None
    relative_irradiance: float | None = field(default=None, metadata=LATER)
    quantity: str
    unit_origin: str
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None
    file_unit: str | None = field(default=None, metadata=LATER)
    distrust: str | None = field(default=None, metadata=LATER)
    spectral_w_m2_nm: float | None = field(default=None, metadata=LATER)
    horizontal_w_m2_nm: float | None = field(default=None, metadata=LATER)
    direct_w_m2_nm: float | None = field(default=None, metadata=LATER)
    scattered_w_m2_nm: float | None = field(default=None, metadata=LATER)
    solar_elevation_deg: float | None = field(default=None, metadata=LATER)
    solar_azimuth_deg: float | None = field(default=None, metadata=LATER)

    @property
    def value(self) -> float:
        """Irradiance in `unit`."""
        known = self.irradiance_w_m2_nm
        return (self.relative_irradiance or 0.0) if known is None else known

    @property
    def unit(self) -> str:
        """Unit of `value`; "1" for the sensor's own."""
        return "1" if self.irradiance_w_m2_nm is None else "W/(m2*nm)"
