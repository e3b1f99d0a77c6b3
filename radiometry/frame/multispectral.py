"""Metadata that a multispectral camera writes beside its pixels; None or "" for what is absent.

Two families are supported: Parrot's Sequoia and MicaSense's RedEdge and Altum. Each
file holds one band.
"""

import re
from dataclasses import dataclass
from typing import Final, Literal, get_args

System = Literal["sequoia", "micasense"]
Index = Literal["ndvi", "ndre", "gndvi"]
INDICES: tuple[Index, ...] = get_args(Index)

_BAND_ALIASES: Final = {"gre": "green", "reg": "red_edge", "rededge": "red_edge"}


def name_band(text: str) -> str:
    """Return the canonical name of a band.

    Parameters
    ----------
    text : str
        Name as written in a file: "Red edge" is red_edge, "Blue-444" is blue_444.

    Returns
    -------
    str
        Lower-case name with underscores; "unnamed" for an empty one.
    """
    plain = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
    return _BAND_ALIASES.get(plain, plain) or "unnamed"


@dataclass(frozen=True, kw_only=True)
class SensorModel:
    """Response of a Sequoia band, p = (A eps gamma + C) I / f^2 + B.

    Here eps is the exposure time [s], gamma the ISO value, and I the irradiance in
    an arbitrary unit.

    Attributes
    ----------
    a, b, c : float
        Coefficients A, B and C.
    """

    a: float
    b: float
    c: float


@dataclass(frozen=True, kw_only=True)
class VignettingPolynomial:
    """Relative illumination of a Sequoia lens, V = sum c_n (x/W)^i_n (y/H)^j_n.

    Here x is the column and y the row.

    Attributes
    ----------
    exponents : tuple of tuple[int, int]
        Pairs (i, j).
    coefficients : tuple of float
        Coefficients c_n.
    """

    exponents: tuple[tuple[int, int], ...]
    coefficients: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class RadialVignetting:
    """Relative illumination of a MicaSense lens, 1 + k0 r + k1 r^2 + ... + k5 r^6.

    Attributes
    ----------
    centre_x_px, centre_y_px : float
        Centre from which r is counted [px].
    coefficients : tuple of float
        Coefficients k0 to k5.
    """

    centre_x_px: float
    centre_y_px: float
    coefficients: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class RadianceModel:
    """Radiometric calibration of a MicaSense band.

    Attributes
    ----------
    a1 : float
        Scale of the signal.
    a2, a3 : float
        Growth of the signal along the rows.
    """

    a1: float
    a2: float
    a3: float


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
    """Reading of a MicaSense light sensor in SI units.

    Attributes
    ----------
    irradiance_w_m2_nm : float
        Spectral irradiance [W/m2/nm].
    quantity : str
        "horizontal" (tilt corrected by the camera) or "spectral" (as the sensor was
        oriented).
    unit_origin : str
        "tag" (the file states its scale), "dls1" (SI) or "dls2" (uW/cm2/nm, 100 to
        one).
    yaw_deg, pitch_deg, roll_deg : float or None, default: None
        Attitude [deg]; None if the file has none.
    """

    irradiance_w_m2_nm: float
    quantity: str
    unit_origin: str
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None


@dataclass(frozen=True, kw_only=True)
class RigGeometry:
    """Projection of a band's lens, and its rotation against the other bands.

    Attributes
    ----------
    model : str
        "fisheye" or "perspective".
    principal_point_px : tuple[float, float]
        Principal point (x, y) [px].
    fisheye_affine : tuple of float, default: ()
        (C, D, E, F) of a fisheye lens [px].
    fisheye_polynomial : tuple of float, default: ()
        (p0, p1, ...) of a fisheye lens.
    focal_length_px : float or None, default: None
        Focal length f of a perspective lens [px].
    distortion : tuple of float, default: ()
        (k1, k2, k3, p1, p2) of a perspective lens.
    rotation_deg : tuple[float, float, float] or None, default: None
        (omega, phi, kappa) into the rig's reference band [deg]; None if the file
        does not state it.
    pixels_per_mm : tuple[float, float] or None, default: None
        Pixels per millimetre of the sensor, (x, y).
    """

    model: str
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

    Attributes
    ----------
    system : System
        Family of the camera.
    band : str
        Name in lower case with underscores, such as "red_edge".
    band_name : str
        Name as in the file.
    wavelength_nm, width_nm : float or None, default: None
        Centre wavelength and bandwidth [nm].
    rig_camera_index : int or None, default: None
        Index of the band's camera in the rig.
    capture_id : str or None, default: None
        Identifier shared by all bands of one capture.
    flight_id : str or None, default: None
        Identifier of the flight.
    full_scale_dn : float or None, default: None
        Largest value that the sensor writes, below the container's largest [DN].
    sensor_model : SensorModel or None, default: None
        Response of a Sequoia band.
    vignetting_polynomial : VignettingPolynomial or None, default: None
        Relative illumination of a Sequoia lens.
    radiance_model : RadianceModel or None, default: None
        Calibration of a MicaSense band.
    radial_vignetting : RadialVignetting or None, default: None
        Relative illumination of a MicaSense lens.
    sunshine_serial : str or None, default: None
        Serial number of the sunshine or light sensor.
    sunshine_missing : str, default: ""
        Reason why there is neither `counts` nor `irradiance`; "" if there is one.
    counts : SunshineCounts or None, default: None
        Readings of a Sequoia's sunshine sensor.
    irradiance : SunshineIrradiance or None, default: None
        Reading of a MicaSense light sensor.
    exposed_at_us : int or None, default: None
        Time of the exposure on the clock of the sunshine records [us].
    panel_serial, panel_albedo : str or float, or None, default: None
        Serial number and albedo of a panel that the camera itself recognised.
    geometry : RigGeometry or None, default: None
        Projection and rotation of the band's lens.
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
