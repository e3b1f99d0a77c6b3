"""One normalised band of a multispectral camera, whoever made it; None or "" for what is absent.

Each file holds one band. Each maker's dialect is read by the module of its name in
`worker.decode.dialects`, into these parts: black, response and relative illumination
make the signal of the raw values, and the light sensor's reading stands beside it.
"""

import re
from typing import Final, Literal

from radiometry.records import Record, about, later

# The surface of an irradiance: levelled by stilb, on a level surface by the camera, corrected by the camera
# as its maker does not state, or as the sensor was oriented.
LightBasis = Literal["levelled", "horizontal", "compensated", "oriented"]


class SunshineRecord(Record):
    """One reading of a Sequoia's sunshine sensor."""

    time_us: int  #: Time of the camera's monotonic clock [us]
    ch0: int  #: Counts of the two channels
    ch1: int
    gain_index: int | None = None  #: None in records of firmware that did not write it
    integration_time_s: float | None = None  #: Integration time [s]; None in the same records
    yaw_deg: float | None = None  #: Attitude [deg]; None if the record has none
    pitch_deg: float | None = None
    roll_deg: float | None = None


class GainMeasurement(Record):
    """Counts of the sunshine sensor at one gain; all rows of a file were taken at equal light."""

    gain_index: int
    integration_time_s: float
    ch0: int  #: Counts of the two channels
    ch1: int


class SunshineCounts(Record):
    """Irradiance list and gain table of a Sequoia."""

    record_bytes: int  #: Size of a record: 28, 24 or 20 bytes
    cut_short: bool  #: True if the list ended within a record, which was left out
    records: tuple[SunshineRecord, ...]  #: Readings of the list
    #: Rows of IrradianceCalibrationMeasurement; empty if the file has none
    gains: tuple[GainMeasurement, ...]


class SunshineIrradiance(Record):
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


Kind = Literal["thermal", "panchromatic"]
# Vegetation indices by name, as formulas of reflectances
NAMED_INDICES: Final = {
    "ndvi": "(nir - red) / (nir + red)",
    "ndre": "(nir - red_edge) / (nir + red_edge)",
    "gndvi": "(nir - green) / (nir + green)",
    "evi2": "2.5 * (nir - red) / (nir + 2.4 * red + 1)",
    "savi": "1.5 * (nir - red) / (nir + red + 0.5)",
}
MOST_LETTERS: Final = 200  # Longest formula of an index
_THERMAL_NM: Final = 3000.0
_PANCHROMATIC_WIDTH_NM: Final = 200.0
_BAND_ALIASES: Final = {"gre": "green", "reg": "red_edge", "rededge": "red_edge"}
# Serial number of a MicaSense panel; from RP04 on its code continues with reflectances
PANEL_SERIAL: Final = re.compile(r"RP(\d{2})-\d{7}-[A-Z]{2}", re.ASCII)


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


def label_band(name: str) -> str:
    """Return the name of a band in words: red_edge is "red edge".

    Parameters
    ----------
    name : str
        Of the band.
    """
    return name.replace("_", " ")


def name_panel(text: str) -> str:
    """Return the serial number of a reflectance panel as it is compared.

    Parameters
    ----------
    text : str
        As engraved, typed in, or read from a file or a code.

    Returns
    -------
    str
        Upper case, single blanks; of a MicaSense code the serial number without the reflectances behind it.
    """
    plain = " ".join(text.split()).upper()
    serial = PANEL_SERIAL.match(plain)
    return serial[0] if serial else plain


def classify_band(band: str, *, wavelength_nm: float | None, width_nm: float | None) -> Kind | None:
    """Return the kind of a band that has no reflectance.

    Parameters
    ----------
    band : str
        Canonical name of the band.
    wavelength_nm, width_nm : float or None
        Centre wavelength and bandwidth [nm].

    Returns
    -------
    Kind or None
        "thermal" beyond 3 um, "panchromatic" for 200 nm and wider, or by their
        names; None for a band of reflected light.
    """
    if (wavelength_nm or 0.0) > _THERMAL_NM or band in ("lwir", "thermal"):
        return "thermal"
    return "panchromatic" if (width_nm or 0.0) >= _PANCHROMATIC_WIDTH_NM or "panchro" in band else None


# Cameras of each dialect by the name of its module; the first that knows a file reads it
CAMERAS: Final = {
    "sequoia": "Parrot Sequoia",
    "micasense_2d": "MicaSense RedEdge-P and Altum-PT",
    "micasense": "MicaSense RedEdge, RedEdge-M, RedEdge-MX and Altum",
    "dji": "DJI P4 Multispectral and Mavic 3 Multispectral",
}


class SensorModel(Record):
    """Response of a Sequoia band, p = (A eps gamma + C) I / f^2 + B.

    Here eps is the exposure time [s], gamma the ISO value, and I the irradiance in an arbitrary unit.
    """

    a: float  #: Coefficients A, B and C
    b: float
    c: float


class VignettingPolynomial(Record):
    """Relative illumination of a lens, V = sum c_n (x/W)^i_n (y/H)^j_n.

    Here x is the column and y the row.
    """

    exponents: tuple[tuple[int, int], ...]  #: Pairs (i, j)
    coefficients: tuple[float, ...]  #: Coefficients c_n


class RadialVignetting(Record):
    """A polynomial about a lens's centre, 1 + k0 r + k1 r^2 + ... + k5 r^6.

    It is the relative illumination V of a MicaSense lens, and 1/V of a DJI one.
    """

    centre_x_px: float  #: Centre from which r is counted [px]
    centre_y_px: float
    coefficients: tuple[float, ...]  #: Coefficients k0 to k5


class RadianceModel(Record):
    """Radiometric calibration of a MicaSense band."""

    a1: float  #: Scale of the signal
    a2: float  #: Growth of the signal along the rows
    a3: float


class GainModel(Record):
    """Response of a DJI band, signal = adjustment (p - B) / (2^bits gain t)."""

    gain: float  #: Gain of the sensor
    exposure_time_s: float  #: Exposure time t of this band [s]
    adjustment: float  #: Factor that makes bodies and bands comparable


Response = SensorModel | RadianceModel | GainModel


class RigGeometry(Record):
    """Projection of a band's lens, and its rotation against the other bands."""

    model: str  #: "fisheye" or "perspective"
    principal_point_px: tuple[float, float]  #: Principal point (x, y) [px]
    fisheye_affine: tuple[float, ...] = ()  #: (C, D, E, F) of a fisheye lens [px]
    fisheye_polynomial: tuple[float, ...] = ()  #: (p0, p1, ...) of a fisheye lens
    focal_length_px: float | None = None  #: Focal length f of a perspective lens [px]
    distortion: tuple[float, ...] = ()  #: (k1, k2, k3, p1, p2) of a perspective lens
    #: (omega, phi, kappa) into the rig's reference band [deg]; None if the file does not state it
    rotation_deg: tuple[float, float, float] | None = None
    pixels_per_mm: tuple[float, float] | None = None  #: Pixels per millimetre of the sensor, (x, y)
    #: Focal length along the columns, where it differs from `focal_length_px`
    focal_length_y_px: float | None = later()
    #: The nine numbers of a projective matrix, row by row, from this band's undistorted pixels to those of
    #: the rig's reference
    homography: tuple[float, ...] | None = later()
    #: By how much (x, y) this band shows the same place moved against the rig's reference band, as the camera
    #: states it for this capture [px]
    offset_px: tuple[float, float] | None = later()
    calibrated_on: str | None = later()  #: Day of the lens's calibration


class Alignment(Record):
    """How a band was aligned onto the first of its capture."""

    band: str = about("Name of the band.")
    by: Literal["lens_data", "lens_data_and_correlation", "correlation"] = about(
        "Lens data of the files, their refinement by correlation, or correlation alone."
    )
    residual_px: float = about("Root mean square distance that remains [px]; assumed without a refinement.")
    shift_px: tuple[float, float] = about("Correction by correlation (x, y) in the middle of the frame [px].")
    patches: int = about("Number of patches in which the bands agree, and of those that were searched.")
    tried: int = about("Number of patches in which the bands agree, and of those that were searched.")
    matrix: tuple[float, ...] = about(
        "(a, b, c, d, e, f): the band shows what the first shows at (x, y) where its lens data put (a x "
        "+ b y + c, d x + e y + f) [px].",
        default=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0),
    )


class Multispectral(Record):
    """One band of one capture."""

    system: str  #: Dialect of the file, a key of `CAMERAS`
    band: str  #: Name in lower case with underscores, such as "red_edge"
    band_name: str  #: Name as in the file
    wavelength_nm: float | None = None  #: Centre wavelength and bandwidth [nm]
    width_nm: float | None = None
    rig_camera_index: int | None = None  #: Index of the band's camera in the rig
    capture_id: str | None = None  #: Identifier shared by all bands of one capture
    flight_id: str | None = None  #: Identifier of the flight
    #: Largest value that the sensor writes, below the container's largest [DN]
    full_scale_dn: float | None = None
    sensor_model: SensorModel | None = None  #: Response of the band; at most one is there
    vignetting_polynomial: VignettingPolynomial | None = None  #: Relative illumination V of the lens
    radiance_model: RadianceModel | None = None
    radial_vignetting: RadialVignetting | None = None
    gain_model: GainModel | None = later()
    #: Reciprocal of V, by which the signal is multiplied
    radial_gain: RadialVignetting | None = later()
    #: Black level that the camera states for the band beside the file's tag [DN]
    black_dn: float | None = later()
    #: Kind of a band without reflectance; None for a band of reflected light
    kind: Kind | None = later()
    #: What is wrong with the file's statements about response or lens
    problem: str | None = later()
    #: Serial number of the imager, where it differs from the body's
    imager_serial: str | None = later()
    #: Serial number of the sunshine or light sensor, or of the aircraft that it is part of
    sunshine_serial: str | None = None
    sunshine_missing: str = ""  #: Reason why there is neither `counts` nor `irradiance`; "" if there is one
    counts: SunshineCounts | None = None  #: Readings of a Sequoia's sunshine sensor
    irradiance: SunshineIrradiance | None = None  #: Reading of a light sensor
    #: Time of the exposure since the camera's start [us]: the clock of a Sequoia's sunshine records
    exposed_at_us: int | None = None
    panel_serial: str | None = None  #: Serial number and albedo of a panel that the camera itself recognised
    panel_albedo: float | None = None
    #: Corners (x, y) of that panel [px]
    panel_region: tuple[tuple[float, float], ...] | None = later()
    geometry: RigGeometry | None = None  #: Projection and rotation of the band's lens

    @property
    def response(self) -> Response | None:
        """Response of the band; None if the file states none."""
        return self.sensor_model or self.radiance_model or self.gain_model
