"""What a multispectral camera's XMP says of its band, its light sensor and its calibration.

Nothing here can make a file unreadable: what is absent or nonsense reads as nothing, and the science says
what it lacks.
"""

import re
from datetime import UTC, datetime
from typing import Final

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import (
    Multispectral,
    RadialVignetting,
    RadianceModel,
    RigGeometry,
    SensorModel,
    SunshineCounts,
    SunshineIrradiance,
    VignettingPolynomial,
    name_band,
)
from worker.decode import limits, tags
from worker.decode.irradiance import read_counts
from worker.decode.tiff import Directory
from worker.decode.xmp import Properties, read_xmp

_MOST_TERMS: Final = 64
_LARGEST: Final = 1e15
_CONTAINER_BITS: Final = 16
# Both write the sensor's bits at the upper end of sixteen: saturated is 65472 or 65520, never 65535.
_SENSOR_BITS: Final = {"sequoia": 10, "micasense": 12}
# Pixels a millimetre: what no sensor has is no resolution.
_COARSEST, _FINEST = 10.0, 4000.0
_MM_PER_UNIT: Final = {2: 25.4, 3: 10.0, 4: 1.0}
_DLS2_W_PER_UW: Final = 0.01  # one uW/cm2/nm is 0.01 W/m2/nm


class Xmp:
    """The packet's values as texts and numbers."""

    def __init__(self, found: Properties) -> None:
        self._found = found

    def text(self, key: str) -> str | None:
        values = self._found.get(key, ("",))
        printable = "".join(letter if letter.isprintable() else " " for letter in values[0])
        return printable.strip()[: limits.MAX_TEXT].strip() or None

    def whole(self, key: str) -> str | None:
        """A text of any length, as it is."""
        return self._found[key][0] if key in self._found else None

    def numbers(self, key: str) -> tuple[float, ...]:
        """All numbers of a property, a list or between commas; one that is none makes all nothing."""
        words = [word for value in self._found.get(key, ()) for word in value.split(",")]
        try:
            numbers = tuple(float(word) for word in words[: _MOST_TERMS + 1])
        except ValueError:
            return ()
        sane = len(numbers) <= _MOST_TERMS and all(abs(number) < _LARGEST for number in numbers)
        return numbers if sane else ()

    def number(self, key: str) -> float | None:
        numbers = self.numbers(key)
        return numbers[0] if len(numbers) == 1 else None

    def first_number(self, name: str) -> float | None:
        """Of a light sensor's property, which firmware writes in its own family or in the camera's."""
        found = self.number(f"dls:{name}")
        return self.number(f"camera:{name}") if found is None else found

    def index(self, key: str) -> int | None:
        number = self.number(key)
        return int(number) if number is not None and number == int(number) and 0 <= number < 1000 else None


def read_multispectral(main: Directory, *, bits: int) -> Multispectral | None:
    """A Sequoia's or a MicaSense camera's band; None for any other file."""
    xmp = Xmp(read_xmp(main))
    band_name = xmp.text("camera:BandName")
    if band_name is None:
        return None
    make = _text(main, tags.MAKE).lower()
    if xmp.numbers("camera:SensorModel") or make == "parrot":
        return _read_sequoia(main, xmp, band_name, bits)
    if xmp.numbers("micasense:RadiometricCalibration") or make == "micasense":
        return _read_micasense(main, xmp, band_name, bits)
    return None


def _read_sequoia(main: Directory, xmp: Xmp, band_name: str, bits: int) -> Multispectral:
    model = xmp.numbers("camera:SensorModel")
    counts = _read_counts(xmp)
    return Multispectral(
        system="sequoia",
        band=name_band(band_name),
        band_name=band_name,
        wavelength_nm=xmp.number("camera:CentralWavelength"),
        width_nm=xmp.number("camera:WavelengthFWHM"),
        rig_camera_index=xmp.index("camera:RigCameraIndex"),
        capture_id=xmp.text("camera:CaptureUUID"),
        flight_id=xmp.text("camera:FlightUUID"),
        full_scale_dn=_full_scale("sequoia", bits),
        sensor_model=SensorModel(a=model[0], b=model[1], c=model[2]) if len(model) == 3 else None,
        vignetting_polynomial=_read_polynomial(xmp),
        sunshine_serial=xmp.text("camera:SunshineSerialNumber"),
        sunshine_missing=counts if isinstance(counts, str) else "",
        counts=None if isinstance(counts, str) else counts,
        exposed_at_us=_read_monotonic_time(main),
        geometry=_read_geometry(main, xmp, reference=xmp.index("camera:RigCameraIndex") == 0),
    )


def _read_counts(xmp: Xmp) -> SunshineCounts | str:
    encoded = xmp.whole("camera:IrradianceList")
    if encoded is None:
        return "the file has no IrradianceList: no sunshine sensor was connected"
    return read_counts(encoded, xmp.numbers("camera:IrradianceCalibrationMeasurement"))


def _read_polynomial(xmp: Xmp) -> VignettingPolynomial | None:
    powers = xmp.numbers("camera:VignettingPolynomial2DName")
    coefficients = xmp.numbers("camera:VignettingPolynomial2D")
    whole = [int(power) for power in powers if power == int(power) and 0 <= power <= 8]
    if not coefficients or len(whole) != len(powers) or len(powers) != 2 * len(coefficients):
        return None
    pairs = tuple(zip(whole[::2], whole[1::2], strict=True))
    return VignettingPolynomial(exponents=pairs, coefficients=coefficients)


def _read_micasense(main: Directory, xmp: Xmp, band_name: str, bits: int) -> Multispectral:
    calibration = xmp.numbers("micasense:RadiometricCalibration")
    centre, terms = xmp.numbers("camera:VignettingCenter"), xmp.numbers("camera:VignettingPolynomial")
    irradiance = _read_irradiance(main, xmp)
    return Multispectral(
        system="micasense",
        band=name_band(band_name),
        band_name=band_name,
        wavelength_nm=xmp.number("camera:CentralWavelength"),
        width_nm=xmp.number("camera:WavelengthFWHM"),
        rig_camera_index=xmp.index("camera:RigCameraIndex"),
        capture_id=xmp.text("micasense:CaptureId"),
        flight_id=xmp.text("micasense:FlightId"),
        full_scale_dn=_full_scale("micasense", bits),
        radiance_model=RadianceModel(a1=calibration[0], a2=calibration[1], a3=calibration[2])
        if len(calibration) == 3
        else None,
        radial_vignetting=RadialVignetting(centre_x_px=centre[0], centre_y_px=centre[1], coefficients=terms)
        if len(centre) == 2 and terms
        else None,
        sunshine_serial=xmp.text("dls:Serial"),
        sunshine_missing="" if irradiance else "the file has no reading of a light sensor (DLS)",
        irradiance=irradiance,
        panel_serial=xmp.text("micasense:PanelSerial") or xmp.text("camera:PanelSerial"),
        panel_albedo=xmp.number("camera:Albedo"),
        geometry=_read_geometry(main, xmp, reference=False),
    )


def _read_irradiance(main: Directory, xmp: Xmp) -> SunshineIrradiance | None:
    """The light sensor's reading in SI units.

    The first generation writes W/m2/nm, the second uW/cm2/nm, a hundred to one: newer files state the scale,
    older ones tell their generation by whether the camera worked out the horizontal irradiance.
    """
    horizontal, spectral = xmp.first_number("HorizontalIrradiance"), xmp.first_number("SpectralIrradiance")
    if spectral is None:
        spectral = xmp.number("camera:Irradiance")
    scale = xmp.first_number("IrradianceScaleToSIUnits")
    origin = "tag" if scale is not None else "dls1" if horizontal is None else "dls2"
    if scale is None:
        scale = 1.0 if origin == "dls1" else _DLS2_W_PER_UW
    trusted = horizontal if horizontal and _trusts_horizontal(main) else None
    value = trusted or spectral
    if not value or not value > 0 or not scale > 0:
        return None
    angles = [xmp.number(f"camera:Irradiance{axis}") for axis in ("Yaw", "Pitch", "Roll")]
    return SunshineIrradiance(
        irradiance_w_m2_nm=value * scale,
        quantity="horizontal" if trusted else "spectral",
        unit_origin=origin,
        yaw_deg=angles[0],
        pitch_deg=angles[1],
        roll_deg=angles[2],
    )


def _trusts_horizontal(main: Directory) -> bool:
    """Firmware before these worked the horizontal irradiance out wrongly, as its maker says."""
    version = re.match(r"v?([0-9]+)[.]([0-9]+)[.]([0-9]+)", _text(main, tags.SOFTWARE))
    good = (1, 2, 3) if _text(main, tags.MODEL).startswith("Altum") else (5, 1, 7)
    return version is not None and tuple(map(int, version.groups())) >= good


def _full_scale(system: str, bits: int) -> float | None:
    if bits != _CONTAINER_BITS:
        return None
    used = _SENSOR_BITS[system]
    return float(((1 << used) - 1) << (_CONTAINER_BITS - used))


def _read_monotonic_time(main: Directory) -> int | None:
    """A Sequoia writes the clock of its sunshine records as the time of digitisation, counted from 1970."""
    try:
        exif = main.directory(tags.EXIF)
        if exif is None:
            return None
        text = _text(exif, tags.DATE_TIME_DIGITIZED)
        fraction = _text(exif, tags.SUB_SEC_TIME_DIGITIZED)
        stamp = datetime.strptime(text, "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC)
    except (InputRejected, ValueError):
        return None
    if stamp.year != 1970 or not re.fullmatch(r"[0-9]{0,6}", fraction):
        return None
    return int(stamp.timestamp()) * 1_000_000 + int(fraction.ljust(6, "0"))


def _text(directory: Directory, tag: int) -> str:
    try:
        return directory.raw(tag, at_most=256).split(b"\0")[0].decode("latin-1").strip()
    except InputRejected:
        return ""


def _read_geometry(main: Directory, xmp: Xmp, *, reference: bool) -> RigGeometry | None:
    centre_mm, per_mm = xmp.numbers("camera:PrincipalPoint"), _pixels_per_mm(main)
    if len(centre_mm) != 2 or per_mm is None:
        return None
    turned = xmp.numbers("camera:RigRelatives")
    rotation = (turned[0], turned[1], turned[2]) if len(turned) == 3 else None
    if rotation is None and reference:
        rotation = (0.0, 0.0, 0.0)
    fisheye = (xmp.text("camera:ModelType") or "") == "fisheye"
    focal = xmp.number("camera:PerspectiveFocalLength")
    if focal is not None and xmp.text("camera:PerspectiveFocalLengthUnits") == "mm":
        focal *= per_mm[0]
    return RigGeometry(
        model="fisheye" if fisheye else "perspective",
        principal_point_px=(centre_mm[0] * per_mm[0], centre_mm[1] * per_mm[1]),
        fisheye_affine=xmp.numbers("camera:FisheyeAffineMatrix"),
        fisheye_polynomial=xmp.numbers("camera:FisheyePolynomial"),
        focal_length_px=focal,
        distortion=xmp.numbers("camera:PerspectiveDistortion"),
        rotation_deg=rotation,
        pixels_per_mm=per_mm,
    )


def _pixels_per_mm(main: Directory) -> tuple[float, float] | None:
    try:
        exif = main.directory(tags.EXIF)
        if exif is None:
            return None
        x = exif.numbers(tags.FOCAL_PLANE_X_RESOLUTION, at_most=1)
        y = exif.numbers(tags.FOCAL_PLANE_Y_RESOLUTION, at_most=1)
        unit = _MM_PER_UNIT.get(exif.integer(tags.FOCAL_PLANE_RESOLUTION_UNIT, 2))
    except InputRejected:
        return None
    if not x or not y or not x[0] or not y[0] or unit is None:
        return None
    per_mm = (x[0] / unit, y[0] / unit)
    return per_mm if all(_COARSEST <= each <= _FINEST for each in per_mm) else None
