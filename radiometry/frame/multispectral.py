"""What a multispectral camera writes beside its pixels: plain fields only, None or "" for what is absent.

Two families are known: Parrot's Sequoia and MicaSense's RedEdge and Altum. Each file holds one band.
"""

import re
from dataclasses import dataclass
from typing import Final, Literal, get_args

System = Literal["sequoia", "micasense"]
Index = Literal["ndvi", "ndre", "gndvi"]
INDICES: tuple[Index, ...] = get_args(Index)

_BAND_ALIASES: Final = {"gre": "green", "reg": "red_edge", "rededge": "red_edge"}


def name_band(text: str) -> str:
    """Give a band's one name, however it is written: "Red edge" is red_edge, "Blue-444" blue_444."""
    plain = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
    return _BAND_ALIASES.get(plain, plain) or "unnamed"


@dataclass(frozen=True, kw_only=True)
class SensorModel:
    """A Sequoia band's response, p = (A eps gamma + C) I / f^2 + B: eps [s], gamma ISO, I arbitrary."""

    a: float
    b: float
    c: float


@dataclass(frozen=True, kw_only=True)
class VignettingPolynomial:
    """A Sequoia lens's share of light, V = sum c_n (x/W)^i_n (y/H)^j_n, with x the column and y the row."""

    exponents: tuple[tuple[int, int], ...]  # (i, j)
    coefficients: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class RadialVignetting:
    """A MicaSense lens's share of light, 1 + k0 r + k1 r^2 + ... + k5 r^6, r [px] from the centre."""

    centre_x_px: float
    centre_y_px: float
    coefficients: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class RadianceModel:
    """A MicaSense band's calibration: a1 the scale, a2 and a3 the growth of the signal along the rows."""

    a1: float
    a2: float
    a3: float


@dataclass(frozen=True, kw_only=True)
class SunshineRecord:
    """One reading of a Sequoia's sunshine sensor.

    ``time_us`` : of the camera's monotonic clock; ``gain_index``, ``integration_time_s`` : None in records of
        firmware that did not write them; angles [deg]: None where the record has none
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
    """The sunshine sensor's counts at one gain, all rows of a file at equal light."""

    gain_index: int
    integration_time_s: float
    ch0: int
    ch1: int


@dataclass(frozen=True, kw_only=True)
class SunshineCounts:
    """A Sequoia's irradiance list and gain table.

    ``record_bytes`` : 28, 24 or 20; ``cut_short`` : the list ended within a record, which was left out
    ``gains`` : rows of IrradianceCalibrationMeasurement, empty where the file has none
    """

    record_bytes: int
    cut_short: bool
    records: tuple[SunshineRecord, ...]
    gains: tuple[GainMeasurement, ...]


@dataclass(frozen=True, kw_only=True)
class SunshineIrradiance:
    """A MicaSense light sensor's reading in SI units [W/m2/nm].

    ``quantity`` : "horizontal" (tilt corrected by the camera) | "spectral" (as the sensor hung)
    ``unit_origin`` : "tag" (the file states its scale) | "dls1" (SI) | "dls2" (uW/cm2/nm, 100 to one)
    """

    irradiance_w_m2_nm: float
    quantity: str
    unit_origin: str
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None


@dataclass(frozen=True, kw_only=True)
class RigGeometry:
    """How a band's lens draws, and how it is turned against the others.

    ``principal_point_px`` : (x, y)
    ``fisheye_affine``, ``fisheye_polynomial`` : (C, D, E, F) [px] and (p0, p1, ...), of a fisheye lens
    ``focal_length_px``, ``distortion`` : f and (k1, k2, k3, p1, p2), of a perspective lens
    ``rotation_deg`` : (omega, phi, kappa) into the rig's reference band; None where the file is silent
    ``pixels_per_mm`` : (x, y), of the sensor
    """

    model: str  # "fisheye" | "perspective"
    principal_point_px: tuple[float, float]
    fisheye_affine: tuple[float, ...] = ()
    fisheye_polynomial: tuple[float, ...] = ()
    focal_length_px: float | None = None
    distortion: tuple[float, ...] = ()
    rotation_deg: tuple[float, float, float] | None = None
    pixels_per_mm: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Multispectral:
    """One band of one capture.

    ``band`` : its name in small letters and underscores, such as "red_edge"; ``band_name`` : as in the file
    ``capture_id`` : the same in all bands of one capture
    ``sunshine_serial`` : of the sunshine or light sensor
    ``sunshine_missing`` : why there is neither ``counts`` nor ``irradiance``; "" where there is one
    ``exposed_at_us`` : the exposure on the clock of the sunshine records
    ``full_scale_dn`` : the largest number that the sensor writes, below the container's largest
    ``panel_serial``, ``panel_albedo`` : of a panel that the camera itself recognised
    """

    system: System
    band: str
    band_name: str
    wavelength_nm: float | None = None
    width_nm: float | None = None
    rig_camera_index: int | None = None
    capture_id: str | None = None
    flight_id: str | None = None
    full_scale_dn: float | None = None
    sensor_model: SensorModel | None = None
    vignetting_polynomial: VignettingPolynomial | None = None
    radiance_model: RadianceModel | None = None
    radial_vignetting: RadialVignetting | None = None
    sunshine_serial: str | None = None
    sunshine_missing: str = ""
    counts: SunshineCounts | None = None
    irradiance: SunshineIrradiance | None = None
    exposed_at_us: int | None = None
    panel_serial: str | None = None
    panel_albedo: float | None = None
    geometry: RigGeometry | None = None
