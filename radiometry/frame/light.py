"""Readings of the sensor on top of the aircraft that looks at the sky."""

from dataclasses import dataclass
from typing import Literal

from radiometry.specification.stored import later

__all__ = ["GainMeasurement", "LightBasis", "SunshineCounts", "SunshineIrradiance", "SunshineRecord"]

# The surface of an irradiance: levelled by stilb, on a level surface by the camera, corrected by the camera
# as its maker does not state, or as the sensor was oriented.
LightBasis = Literal["levelled", "horizontal", "compensated", "oriented"]


@dataclass(frozen=True, kw_only=True)
class SunshineRecord:
    """One reading of a Sequoia's sunshine sensor."""

    time_us: int  #: Time of the camera's monotonic clock [us]
    ch0: int  #: Counts of the two channels
    ch1: int
    gain_index: int | None = None  #: None in records of firmware that did not write it
    integration_time_s: float | None = None  #: Integration time [s]; None in the same records
    yaw_deg: float | None = None  #: Attitude [deg]; None if the record has none
    pitch_deg: float | None = None
    roll_deg: float | None = None


@dataclass(frozen=True, kw_only=True)
class GainMeasurement:
    """Counts of the sunshine sensor at one gain; all rows of a file were taken at equal light."""

    gain_index: int
    integration_time_s: float
    ch0: int  #: Counts of the two channels
    ch1: int


@dataclass(frozen=True, kw_only=True)
class SunshineCounts:
    """Irradiance list and gain table of a Sequoia."""

    record_bytes: int  #: Size of a record: 28, 24 or 20 bytes
    cut_short: bool  #: True if the list ended within a record, which was left out
    records: tuple[SunshineRecord, ...]  #: Readings of the list
    #: Rows of IrradianceCalibrationMeasurement; empty if the file has none
    gains: tuple[GainMeasurement, ...]


@dataclass(frozen=True, kw_only=True)
class SunshineIrradiance:
    """One reading of a light sensor as irradiance; in SI units, or in the sensor's own."""

    #: Irradiance [W/m2/nm]; None if the sensor's scale to SI is not known
    irradiance_w_m2_nm: float | None = None
    #: Irradiance in the sensor's own unit, if `irradiance_w_m2_nm` is None
    relative_irradiance: float | None = later()
    #: "horizontal" (on a level surface, computed by the camera), "spectral" (as the sensor was oriented) or
    #: "compensated" (corrected by the camera in a way that its maker does not state)
    quantity: str
    #: Origin of the unit: "tag" (the file states the scale), "model" (the camera works with one kind of
    #: sensor), "dls1" (taken for W/m2/nm), "dls2" (taken for uW/cm2/nm) or "own" (not known)
    unit_origin: str
    yaw_deg: float | None = None  #: Attitude of the sensor [deg]; None if the file has none
    pitch_deg: float | None = None
    roll_deg: float | None = None
    #: Unit in which the file states the irradiance
    file_unit: str | None = later()
    #: Why a horizontal irradiance that the file states was not used; None if it was, or if there is none
    distrust: str | None = later()
    #: Irradiance as oriented, and on a level surface, as the file states them [W/m2/nm]
    spectral_w_m2_nm: float | None = later()
    horizontal_w_m2_nm: float | None = later()
    #: Direct light on a plane normal to the sun [W/m2/nm]
    direct_w_m2_nm: float | None = later()
    #: Scattered light on a level surface [W/m2/nm]
    scattered_w_m2_nm: float | None = later()
    #: Position of the sun as the file states it [deg]
    solar_elevation_deg: float | None = later()
    solar_azimuth_deg: float | None = later()

    @property
    def value(self) -> float:
        known = self.irradiance_w_m2_nm
        return (self.relative_irradiance or 0.0) if known is None else known

    @property
    def unit(self) -> str:
        """Unit of `value`; "1" for the sensor's own."""
        return "1" if self.irradiance_w_m2_nm is None else "W/(m2*nm)"
