"""One normalised band of a multispectral camera, whoever made it; None or "" for what is absent.

Each file holds one band. Each maker's dialect is read by the module of its name in
`worker.decode.dialects`, into these parts: black, response and relative illumination
make the signal of the raw values, and the light sensor's reading stands beside it.
"""

from dataclasses import dataclass, field
from typing import Final, Literal

from radiometry.frame.bands import Kind
from radiometry.frame.light import SunshineCounts, SunshineIrradiance
from radiometry.specification.stored import LATER

CAMERAS: Final = {
    "sequoia": "Parrot Sequoia",
    "micasense_2d": "MicaSense RedEdge-P and Altum-PT",
    "micasense": "MicaSense RedEdge, RedEdge-M, RedEdge-MX and Altum",
    "dji": "DJI P4 Multispectral and Mavic 3 Multispectral",
}
"""Cameras of each dialect by the name of its module; the first that knows a file reads it."""


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
    """Relative illumination of a lens, V = sum c_n (x/W)^i_n (y/H)^j_n.

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
    """A polynomial about a lens's centre, 1 + k0 r + k1 r^2 + ... + k5 r^6.

    It is the relative illumination V of a MicaSense lens, and 1/V of a DJI one.

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
class GainModel:
    """Response of a DJI band, signal = adjustment (p - B) / (2^bits gain t).

    Attributes
    ----------
    gain : float
        Gain of the sensor.
    exposure_time_s : float
        Exposure time t of this band [s].
    adjustment : float
        Factor that makes bodies and bands comparable.
    """

    gain: float
    exposure_time_s: float
    adjustment: float


Response = SensorModel | RadianceModel | GainModel


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
    focal_length_y_px : float or None, default: None
        Focal length along the columns, where it differs from `focal_length_px`.
    homography : tuple of float or None, default: None
        The nine numbers of a projective matrix, row by row, from this band's
        undistorted pixels to those of the rig's reference.
    offset_px : tuple[float, float] or None, default: None
        By how much (x, y) this band shows the same place moved against the rig's
        reference band, as the camera states it for this capture [px].
    calibrated_on : str or None, default: None
        Day of the lens's calibration.
    """

    model: str
    principal_point_px: tuple[float, float]
    fisheye_affine: tuple[float, ...] = ()
    fisheye_polynomial: tuple[float, ...] = ()
    focal_length_px: float | None = None
    distortion: tuple[float, ...] = ()
    rotation_deg: tuple[float, float, float] | None = None
    pixels_per_mm: tuple[float, float] | None = None
    focal_length_y_px: float | None = field(default=None, metadata=LATER)
    homography: tuple[float, ...] | None = field(default=None, metadata=LATER)
    offset_px: tuple[float, float] | None = field(default=None, metadata=LATER)
    calibrated_on: str | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class Alignment:
    """How a band was aligned onto the first of its capture.

    Attributes
    ----------
    band : str
        Name of the band.
    by : str
        Lens data of the files, their refinement by correlation, or correlation alone.
    residual_px : float
        Root mean square distance that remains [px]; assumed without a refinement.
    shift_px : tuple[float, float]
        Correction by correlation (x, y) in the middle of the frame [px].
    patches, tried : int
        Number of patches in which the bands agree, and of those that were searched.
    matrix : tuple of float, default: identity
        (a, b, c, d, e, f): the band shows what the first shows at (x, y) where its lens data put
        (a x + b y + c, d x + e y + f) [px].
    """

    band: str
    by: Literal["lens_data", "lens_data_and_correlation", "correlation"]
    residual_px: float
    shift_px: tuple[float, float]
    patches: int
    tried: int
    matrix: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Multispectral:
    """One band of one capture.

    Attributes
    ----------
    system : str
        Dialect of the file, a key of `CAMERAS`.
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
    sensor_model, radiance_model, gain_model : Response or None, default: None
        Response of the band; at most one is there.
    vignetting_polynomial, radial_vignetting : VignettingPolynomial or RadialVignetting, default: None
        Relative illumination V of the lens.
    radial_gain : RadialVignetting or None, default: None
        Reciprocal of V, by which the signal is multiplied.
    black_dn : float or None, default: None
        Black level that the camera states for the band beside the file's tag [DN].
    kind : Kind or None, default: None
        Kind of a band without reflectance; None for a band of reflected light.
    problem : str or None, default: None
        What is wrong with the file's statements about response or lens.
    imager_serial : str or None, default: None
        Serial number of the imager, where it differs from the body's.
    sunshine_serial : str or None, default: None
        Serial number of the sunshine or light sensor, or of the aircraft that it is
        part of.
    sunshine_missing : str, default: ""
        Reason why there is neither `counts` nor `irradiance`; "" if there is one.
    counts : SunshineCounts or None, default: None
        Readings of a Sequoia's sunshine sensor.
    irradiance : SunshineIrradiance or None, default: None
        Reading of a light sensor.
    exposed_at_us : int or None, default: None
        Time of the exposure since the camera's start [us]: the clock of a Sequoia's sunshine records.
    panel_serial, panel_albedo : str or float, or None, default: None
        Serial number and albedo of a panel that the camera itself recognised.
    panel_region : tuple of tuple[float, float] or None, default: None
        Corners (x, y) of that panel [px].
    geometry : RigGeometry or None, default: None
        Projection and rotation of the band's lens.
    """

    system: str
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
    gain_model: GainModel | None = field(default=None, metadata=LATER)
    radial_gain: RadialVignetting | None = field(default=None, metadata=LATER)
    black_dn: float | None = field(default=None, metadata=LATER)
    kind: Kind | None = field(default=None, metadata=LATER)
    problem: str | None = field(default=None, metadata=LATER)
    imager_serial: str | None = field(default=None, metadata=LATER)
    sunshine_serial: str | None = None
    sunshine_missing: str = ""
    counts: SunshineCounts | None = None
    irradiance: SunshineIrradiance | None = None
    exposed_at_us: int | None = None
    panel_serial: str | None = None
    panel_albedo: float | None = None
    panel_region: tuple[tuple[float, float], ...] | None = field(default=None, metadata=LATER)
    geometry: RigGeometry | None = None

    @property
    def response(self) -> Response | None:
        """Response of the band; None if the file states none."""
        return self.sensor_model or self.radiance_model or self.gain_model
