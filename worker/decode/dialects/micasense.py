"""MicaSense cameras whose lens is a radial polynomial: RedEdge, RedEdge-M, RedEdge-MX and Altum."""

import math
import re
from typing import Any, Final

from radiometry.frame.multispectral import Multispectral, RadialVignetting, RadianceModel, SunshineIrradiance
from worker.decode.metadata import Xmp
from worker.decode.packet import Packet, describe_band, first_problem, read_geometry

IDENTITIES = ("micasense:CaptureId", "micasense:FlightId")
_SENSOR_BITS: Final = 12
_W_PER_UW: Final = 0.01  # one uW/cm2/nm is 0.01 W/m2/nm
_BRIGHTEST_W: Final = 5.0  # outside the atmosphere the sun has 2.1 W/m2/nm at its brightest wavelength
_SI, _MICRO = "W/m2/nm", "uW/cm2/nm"
_CORNERS: Final = 4
_LONGEST_RUN_S: Final = 1e6
# The first firmware whose horizontal irradiance its maker trusts: earlier ones computed it wrongly. By the
# beginning of the model's name, longest first.
_TRUSTED: Final = {"Altum-PT": (1, 0, 0), "RedEdge-P": (1, 0, 0), "Altum": (1, 2, 3), "RedEdge": (5, 1, 7)}
# They were never made for the first light sensor, which writes SI units.
_ONLY_DLS2: Final = ("Altum", "RedEdge-P")


def knows(packet: Packet) -> bool:
    calibrated = bool(packet.xmp.numbers("micasense:RadiometricCalibration"))
    return calibrated or packet.make.lower() == "micasense"


def read(packet: Packet) -> Multispectral:
    centre, no_centre = packet.xmp.require("camera:VignettingCenter", 2)
    terms, no_terms = packet.xmp.require("camera:VignettingPolynomial")
    return read_band(
        packet,
        (no_centre, no_terms),
        system="micasense",
        radial_vignetting=RadialVignetting(centre_x_px=centre[0], centre_y_px=centre[1], coefficients=terms)
        if centre and terms
        else None,
    )


def read_band(packet: Packet, problems: tuple[str, ...], **lens: Any) -> Multispectral:  # noqa: ANN401
    """All but the lens, which MicaSense's two kinds of cameras state differently."""
    xmp = packet.xmp
    model, no_model = xmp.require("micasense:RadiometricCalibration", 3)
    irradiance = _read_irradiance(packet)
    reference = xmp.index("camera:RigRelativesReferenceRigCameraIndex")
    (capture, flight), started_s = IDENTITIES, xmp.number("micasense:BootTimestamp")
    # x and y of the panel's four corners
    numbers = xmp.numbers("camera:ReflectArea") or xmp.numbers("micasense:ReflectArea")
    return Multispectral(
        **describe_band(packet, sensor_bits=_SENSOR_BITS),
        **lens,
        capture_id=xmp.text(capture),
        flight_id=xmp.text(flight),
        radiance_model=RadianceModel(a1=model[0], a2=model[1], a3=model[2]) if model else None,
        problem=first_problem((no_model, *problems)),
        sunshine_serial=xmp.text("dls:Serial"),
        sunshine_missing=irradiance if isinstance(irradiance, str) else "",
        irradiance=None if isinstance(irradiance, str) else irradiance,
        exposed_at_us=round(started_s * 1e6) if started_s and 0.0 < started_s < _LONGEST_RUN_S else None,
        panel_serial=xmp.text("micasense:PanelSerial") or xmp.text("camera:PanelSerial"),
        panel_albedo=xmp.first_number("micasense:Albedo", "camera:Albedo"),
        panel_region=tuple(zip(numbers[::2], numbers[1::2], strict=True))
        if len(numbers) == 2 * _CORNERS
        else None,
        geometry=read_geometry(
            packet, reference=reference is not None and reference == xmp.index("camera:RigCameraIndex")
        ),
    )


def _read_irradiance(packet: Packet) -> SunshineIrradiance | str:
    """The light sensor's reading in SI units by its own words or its generation's, or why there is none."""
    xmp = packet.xmp

    def find(name: str) -> float | None:
        return xmp.first_number(f"dls:{name}", f"camera:{name}")

    horizontal, spectral = find("HorizontalIrradiance"), find("SpectralIrradiance")
    if spectral is None:
        spectral = xmp.number("camera:Irradiance")
    if (scale := find("IrradianceScaleToSIUnits")) is not None:
        origin = "tag"
    elif packet.model.startswith(_ONLY_DLS2):
        origin, scale = "model", _W_PER_UW
    else:
        # the second generation is known by the horizontal irradiance that the camera computes
        origin, scale = ("dls1", 1.0) if horizontal is None else ("dls2", _W_PER_UW)
    distrust = _distrust(packet) if horizontal and horizontal > 0.0 else None
    trusted = horizontal if horizontal and horizontal > 0.0 and not distrust else None
    value = trusted or spectral
    if not value or not value > 0 or not scale > 0:
        return "the file has no reading of a light sensor (DLS)"
    if value * scale > _BRIGHTEST_W:
        return f"{value * scale:g} W/m2/nm of the light sensor is no daylight: its unit may be another"

    def to_si(stated: float | None) -> float | None:
        return None if stated is None else stated * scale

    yaw, pitch, roll = (_read_angle(xmp, axis) for axis in ("Yaw", "Pitch", "Roll"))
    elevation, azimuth = xmp.number("dls:SolarElevation"), xmp.number("dls:SolarAzimuth")
    return SunshineIrradiance(
        irradiance_w_m2_nm=value * scale,
        quantity="horizontal" if trusted else "spectral",
        unit_origin=origin,
        yaw_deg=yaw,
        pitch_deg=pitch,
        roll_deg=roll,
        file_unit=_SI if scale == 1.0 else _MICRO if scale == _W_PER_UW else f"{scale:g} {_SI}",
        distrust=distrust,
        spectral_w_m2_nm=to_si(spectral),
        horizontal_w_m2_nm=to_si(horizontal),
        direct_w_m2_nm=to_si(find("DirectIrradiance")),
        scattered_w_m2_nm=to_si(find("ScatteredIrradiance")),
        solar_elevation_deg=None if elevation is None else math.degrees(elevation),
        solar_azimuth_deg=None if azimuth is None else math.degrees(azimuth),
    )


def _read_angle(xmp: Xmp, axis: str) -> float | None:
    """In degrees under the camera's name, in radians under the sensor's."""
    stated, radians = xmp.number(f"camera:Irradiance{axis}"), xmp.number(f"dls:{axis}")
    return math.degrees(radians) if stated is None and radians is not None else stated


def _distrust(packet: Packet) -> str | None:
    """Why the file's horizontal irradiance is not used; None where it is."""
    version = re.match(r"v?([0-9]{1,9})[.]([0-9]{1,9})[.]([0-9]{1,9})", packet.software)
    model = packet.model or "unnamed model"
    good = next((since for name, since in _TRUSTED.items() if model.startswith(name)), None)
    if version is not None and good is not None and tuple(map(int, version.groups())) >= good:
        return None
    firmware = f"{model}, firmware {packet.software or 'not stated'}"
    since = f"trusted from {'.'.join(map(str, good))}" if good else "not known to be right for this model"
    return f"HorizontalIrradiance of {firmware}: {since}"
