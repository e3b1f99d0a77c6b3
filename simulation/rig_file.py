"""Files of one band as MicaSense and DJI cameras write them: 16 bits, EXIF, GPS, and all else in XMP."""

import math
from pathlib import Path
from xml.sax.saxutils import escape

from radiometry.frame import FrameHeader
from radiometry.frame.multispectral import Multispectral, SunshineIrradiance
from simulation.camera import Taken
from simulation.sequoia_file import read_band, write_band
from simulation.tiff import ASCII, RATIONAL, SHORT, Entries, approximate

_W_PER_UW = 0.01
_ADDRESSES = {
    "Camera": "http://pix4d.com/camera/1.0",
    "MicaSense": "http://micasense.com/MicaSense/1.0/",
    "DLS": "http://micasense.com/DLS/1.0/",
    "drone-dji": "http://www.dji.com/drone-dji/1.0/",
}

Values = dict[str, str | float | tuple[float, ...] | None]


def name_rig_file(number: int, header: FrameHeader) -> str:
    """Return a name as MicaSense gives: IMG_0004_2.tif."""
    band = read_band(header)
    return f"IMG_{number:04}_{(band.rig_camera_index or 0) + 1}_{band.band.upper()}.TIF"


def write_rig(path: Path, shot: Taken) -> None:
    """Write one band, from which a reader gets the same header and the same samples."""
    band = read_band(shot.header)
    lens = band.geometry
    exif: Entries = {42033: (ASCII, shot.header.serial)}  # BodySerialNumber
    if lens is not None and lens.pixels_per_mm is not None and band.gain_model is None:
        exif |= {
            41486: (RATIONAL, approximate(lens.pixels_per_mm[0])),  # FocalPlaneXResolution
            41487: (RATIONAL, approximate(lens.pixels_per_mm[1])),  # FocalPlaneYResolution
            41488: (SHORT, 4),  # FocalPlaneResolutionUnit: millimetres
        }
    black: Entries = {50714: (SHORT, round(shot.header.black_level_dn[0]))}  # BlackLevel
    write_band(path, shot, packet=_packet(band), exif=exif, tags=black)


def _packet(band: Multispectral) -> bytes:
    values: Values = {
        "Camera:BandName": band.band_name,
        "Camera:CentralWavelength": band.wavelength_nm,
        "Camera:WavelengthFWHM": band.width_nm,
        "Camera:RigCameraIndex": band.rig_camera_index,
    }
    assert band.irradiance is not None  # noqa: S101  every simulated rig has one
    values |= (
        _describe_dji(band, band.irradiance)
        if band.gain_model
        else _describe_micasense(band, band.irradiance)
    )
    elements = "".join(
        f"<{name}>{escape(value) if isinstance(value, str) else _write(value)}</{name}>"
        for name, value in values.items()
        if value is not None
    )
    families = " ".join(f'xmlns:{prefix}="{address}"' for prefix, address in _ADDRESSES.items())
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description {families}>{elements}</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def _write(value: float | tuple[float, ...]) -> str:
    return ",".join(map(repr, value)) if isinstance(value, tuple) else repr(value)


def _describe_micasense(band: Multispectral, light: SunshineIrradiance) -> Values:
    model, lens, radial, flat = (
        band.radiance_model,
        band.geometry,
        band.radial_vignetting,
        band.vignetting_polynomial,
    )
    assert model is not None  # noqa: S101  every simulated rig has these
    assert lens is not None  # noqa: S101
    assert lens.pixels_per_mm is not None  # noqa: S101
    values: Values = {
        "MicaSense:CaptureId": band.capture_id,
        "MicaSense:RadiometricCalibration": (model.a1, model.a2, model.a3),
        "Camera:ModelType": lens.model,
        "Camera:PrincipalPoint": tuple(
            at / per_mm for at, per_mm in zip(lens.principal_point_px, lens.pixels_per_mm, strict=True)
        ),
        "Camera:PerspectiveFocalLength": lens.focal_length_px,
        "Camera:PerspectiveDistortion": lens.distortion,
        "Camera:RigRelatives": lens.rotation_deg,
        "DLS:Serial": band.sunshine_serial,
        "Camera:IrradianceYaw": light.yaw_deg,
        "Camera:IrradiancePitch": light.pitch_deg,
        "Camera:IrradianceRoll": light.roll_deg,
    }
    if radial is not None:
        values["Camera:VignettingCenter"] = (radial.centre_x_px, radial.centre_y_px)
        values["Camera:VignettingPolynomial"] = radial.coefficients
    if flat is not None:
        values["Camera:VignettingPolynomial2DName"] = tuple(
            power for pair in flat.exponents for power in pair
        )
        values["Camera:VignettingPolynomial2D"] = flat.coefficients
    scale = 1.0 if light.unit_origin == "dls1" else _W_PER_UW
    for name, stated in (
        ("SpectralIrradiance", light.spectral_w_m2_nm),
        ("HorizontalIrradiance", light.horizontal_w_m2_nm),
        ("DirectIrradiance", light.direct_w_m2_nm),
        ("ScatteredIrradiance", light.scattered_w_m2_nm),
    ):
        values[f"DLS:{name}"] = None if stated is None else stated / scale
    for name, angle in (("Elevation", light.solar_elevation_deg), ("Azimuth", light.solar_azimuth_deg)):
        values[f"DLS:Solar{name}"] = None if angle is None else math.radians(angle)
    return values


def _describe_dji(band: Multispectral, light: SunshineIrradiance) -> Values:
    model, lens, gain = band.gain_model, band.geometry, band.radial_gain
    assert model is not None  # noqa: S101  every simulated rig has these
    assert gain is not None  # noqa: S101
    assert lens is not None  # noqa: S101
    assert lens.pixels_per_mm is not None  # noqa: S101
    x, y = lens.principal_point_px
    numbers = (
        *(lens.focal_length_px or 0.0, lens.focal_length_y_px or 0.0),
        *(x - gain.centre_x_px, y - gain.centre_y_px),
        *(lens.distortion[at] for at in (0, 1, 3, 4, 2)),
    )
    own: Values = {
        "BandName": band.band_name,
        "CaptureUUID": band.capture_id,
        "DroneID": band.sunshine_serial,
        "BlackLevel": band.black_dn,
        "SensorGain": model.gain,
        "ExposureTime": model.exposure_time_s * 1e6,
        "SensorGainAdjustment": model.adjustment,
        "CalibratedOpticalCenterX": gain.centre_x_px,
        "CalibratedOpticalCenterY": gain.centre_y_px,
        "VignettingData": gain.coefficients,
        "Irradiance": light.value,
        "FlightYawDegree": light.yaw_deg,
        "FlightPitchDegree": light.pitch_deg,
        "FlightRollDegree": light.roll_deg,
        "DewarpData": f"{lens.calibrated_on};{_write(numbers)}",
        "CalibratedFocalLength": lens.focal_length_px,
        "RelativeOpticalCenterX": lens.offset_px[0] if lens.offset_px else None,
        "RelativeOpticalCenterY": lens.offset_px[1] if lens.offset_px else None,
    }
    focal_mm = (lens.focal_length_px or 0.0) / lens.pixels_per_mm[0]
    return {f"drone-dji:{name}": value for name, value in own.items()} | {
        "Camera:PerspectiveFocalLength": focal_mm
    }
