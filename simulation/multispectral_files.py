"""Files of multispectral cameras, as Sequoia, MicaSense and DJI write them."""

import base64
import math
import struct
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from xml.sax.saxutils import escape

from radiometry.frame import FrameHeader, multispectral
from simulation import dng, sequoia
from simulation.camera import Taken

_RECORD = struct.Struct("<QHHHHfff")
_W_PER_UW = 0.01
_ADDRESSES = {
    "Camera": "http://pix4d.com/camera/1.0",
    "MicaSense": "http://micasense.com/MicaSense/1.0/",
    "DLS": "http://micasense.com/DLS/1.0/",
    "drone-dji": "http://www.dji.com/drone-dji/1.0/",
}
_SEQUOIA_ADDRESSES = {"Camera": "http://pix4d.com/camera/1.0/"}
_FILE_NAMES = {"green": "GRE", "red": "RED", "red_edge": "REG", "nir": "NIR"}

Value = str | float | tuple[float, ...] | list[float]
Values = dict[str, Value | None]


def name_file(number: int, header: FrameHeader) -> str:
    """Return the name that the camera gives: IMG_180413_080000_0000_GRE.TIF."""
    taken = datetime.fromisoformat(header.taken_at or "")
    return f"IMG_{taken:%y%m%d_%H%M%S}_{number:04}_{_FILE_NAMES[read_band(header).band]}.TIF"


def write_sequoia(path: Path, shot: Taken) -> None:
    """Write one band, from which a reader gets the same header and the same samples."""
    band = read_band(shot.header)
    tags: dng.Entries = {
        50714: (dng.RATIONAL, (round(shot.header.black_level_dn[0] * 10_000), 10_000)),  # BlackLevel
        50735: (dng.ASCII, shot.header.serial),  # CameraSerialNumber
    }
    # The camera writes its monotonic clock, that of the sunshine records, as the time of digitisation.
    clock = datetime.fromtimestamp(0, UTC) + timedelta(microseconds=band.exposed_at_us or 0)
    exif: dng.Entries = {
        36868: (dng.ASCII, f"{clock:%Y:%m:%d %H:%M:%S}"),  # DateTimeDigitized
        37522: (dng.ASCII, f"{clock:%f}"),  # SubSecTimeDigitized
        41486: (dng.RATIONAL, dng.approximate(sequoia.PIXELS_PER_MM)),  # FocalPlaneXResolution
        41487: (dng.RATIONAL, dng.approximate(sequoia.PIXELS_PER_MM)),  # FocalPlaneYResolution
        41488: (dng.SHORT, 4),  # FocalPlaneResolutionUnit: millimetres
    }
    write_band(path, shot, packet=_packet(_describe_sequoia(band), _SEQUOIA_ADDRESSES), exif=exif, tags=tags)


def write_band(path: Path, shot: Taken, *, packet: bytes, exif: dng.Entries, tags: dng.Entries) -> None:
    """Write one band with its XMP packet, and the entries that its maker adds."""
    header, samples = shot.header, shot.frame.samples_dn
    writer = dng.TiffWriter()
    taken_at = datetime.fromisoformat(header.taken_at or "")
    exposure = dng.describe_exposure(shot.exposure.on_basis("nominal"), taken_at)
    tags |= {
        271: (dng.ASCII, header.make),
        272: (dng.ASCII, header.model),
        305: (dng.ASCII, header.software),
        700: (dng.BYTE, packet),  # XMP
        34665: (dng.LONG, writer.directory(exposure | exif)),
        34853: (dng.LONG, writer.directory(_locate(header))),
    }
    image = dng.describe_image(samples, photometric=1) | dng.append_strip(writer, samples)
    path.write_bytes(writer.finish(writer.directory(image | tags)))


def read_band(header: FrameHeader) -> multispectral.Multispectral:
    """Return what the header of a simulated frame says of its band."""
    assert header.multispectral is not None  # noqa: S101  every simulated rig has one
    return header.multispectral


def _locate(header: FrameHeader) -> dng.Entries:
    """Return the GPS entries of a position."""
    latitude, longitude = header.latitude_deg or 0.0, header.longitude_deg or 0.0
    return {
        1: (dng.ASCII, "N" if latitude >= 0.0 else "S"),
        2: (dng.RATIONAL, [dng.approximate(abs(latitude)), (0, 1), (0, 1)]),
        3: (dng.ASCII, "E" if longitude >= 0.0 else "W"),
        4: (dng.RATIONAL, [dng.approximate(abs(longitude)), (0, 1), (0, 1)]),
    }


def _describe_sequoia(band: multispectral.Multispectral) -> Values:
    model = band.sensor_model
    return {
        "Camera:BandName": band.band_name,
        "Camera:CentralWavelength": band.wavelength_nm,
        "Camera:WavelengthFWHM": band.width_nm,
        "Camera:RigCameraIndex": band.rig_camera_index,
        "Camera:CaptureUUID": band.capture_id,
        "Camera:FlightUUID": band.flight_id,
        "Camera:SunshineSerialNumber": band.sunshine_serial,
        "Camera:SensorModel": [model.a, model.b, model.c] if model else None,
        **_lens(band.vignetting_polynomial),
        **_sunshine(band.counts),
        **_rig(band.geometry),
    }


def _packet(values: Values, addresses: Mapping[str, str]) -> bytes:
    """Return the XMP packet, without the properties that are None; a list is a sequence of elements."""
    elements = "".join(
        f"<{name}>{_write(value)}</{name}>" for name, value in values.items() if value is not None
    )
    families = " ".join(f'xmlns:{prefix}="{address}"' for prefix, address in addresses.items())
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description {families}>{elements}</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def _write(value: Value) -> str:
    if isinstance(value, str):
        return escape(value)
    if isinstance(value, list):
        return f"<rdf:Seq>{''.join(f'<rdf:li>{number!r}</rdf:li>' for number in value)}</rdf:Seq>"
    return ",".join(map(repr, value)) if isinstance(value, tuple) else repr(value)


def _lens(lens: multispectral.VignettingPolynomial | None) -> Values:
    if lens is None:
        return {}
    powers = ",".join(str(power) for pair in lens.exponents for power in pair)
    return {
        "Camera:VignettingPolynomial2DName": powers,
        "Camera:VignettingPolynomial2D": ",".join(repr(coefficient) for coefficient in lens.coefficients),
    }


def _sunshine(counts: multispectral.SunshineCounts | None) -> Values:
    """Return the readings as records of 28 bytes, and the counts at each gain under one light."""
    if counts is None:
        return {}
    records = b"".join(
        _RECORD.pack(
            record.time_us,
            record.ch0,
            record.ch1,
            record.gain_index or 0,
            round(1000.0 * (record.integration_time_s or 0.0)),
            *(_angle(angle) for angle in (record.yaw_deg, record.pitch_deg, record.roll_deg)),
        )
        for record in counts.records
    )
    rows = (
        (row.gain_index, round(1000.0 * row.integration_time_s), row.ch0, row.ch1) for row in counts.gains
    )
    return {
        "Camera:IrradianceList": base64.b64encode(records).decode(),
        "Camera:IrradianceCalibrationMeasurement": ",".join(str(number) for row in rows for number in row)
        or None,
    }


def _rig(geometry: multispectral.RigGeometry | None) -> Values:
    if geometry is None:
        return {}
    x_px, y_px = geometry.principal_point_px
    return {
        "Camera:ModelType": geometry.model,
        "Camera:PrincipalPoint": f"{x_px / sequoia.PIXELS_PER_MM!r},{y_px / sequoia.PIXELS_PER_MM!r}",
        "Camera:FisheyeAffineMatrix": ",".join(map(repr, geometry.fisheye_affine)) or None,
        "Camera:FisheyePolynomial": ",".join(map(repr, geometry.fisheye_polynomial)) or None,
        "Camera:RigRelatives": ",".join(map(repr, geometry.rotation_deg)) if geometry.rotation_deg else None,
    }


def _angle(angle_deg: float | None) -> float:
    return math.nan if angle_deg is None else angle_deg


def name_rig_file(number: int, header: FrameHeader) -> str:
    """Return a name as MicaSense gives: IMG_0004_2.tif."""
    band = read_band(header)
    return f"IMG_{number:04}_{(band.rig_camera_index or 0) + 1}_{band.band.upper()}.TIF"


def write_rig(path: Path, shot: Taken) -> None:
    """Write one band, from which a reader gets the same header and the same samples."""
    band = read_band(shot.header)
    lens = band.geometry
    exif: dng.Entries = {42033: (dng.ASCII, shot.header.serial)}  # BodySerialNumber
    if lens is not None and lens.pixels_per_mm is not None and band.gain_model is None:
        exif |= {
            41486: (dng.RATIONAL, dng.approximate(lens.pixels_per_mm[0])),  # FocalPlaneXResolution
            41487: (dng.RATIONAL, dng.approximate(lens.pixels_per_mm[1])),  # FocalPlaneYResolution
            41488: (dng.SHORT, 4),  # FocalPlaneResolutionUnit: millimetres
        }
    assert band.irradiance is not None  # noqa: S101  every simulated rig has one
    values: Values = {
        "Camera:BandName": band.band_name,
        "Camera:CentralWavelength": band.wavelength_nm,
        "Camera:WavelengthFWHM": band.width_nm,
        "Camera:RigCameraIndex": band.rig_camera_index,
        **(_describe_dji if band.gain_model else _describe_micasense)(band, band.irradiance),
    }
    black: dng.Entries = {50714: (dng.SHORT, round(shot.header.black_level_dn[0]))}  # BlackLevel
    write_band(path, shot, packet=_packet(values, _ADDRESSES), exif=exif, tags=black)


def _describe_micasense(band: multispectral.Multispectral, light: multispectral.SunshineIrradiance) -> Values:
    model, lens = band.radiance_model, band.geometry
    radial, flat = band.radial_vignetting, band.vignetting_polynomial
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


def _describe_dji(band: multispectral.Multispectral, light: multispectral.SunshineIrradiance) -> Values:
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
