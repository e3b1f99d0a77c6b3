"""Files of one band as a Parrot Sequoia writes them: 16 bits, EXIF, GPS, and all else in XMP."""

import base64
import math
import struct
from datetime import UTC, datetime, timedelta
from pathlib import Path
from xml.sax.saxutils import escape

import tifffile

from radiometry.frame import FrameHeader
from radiometry.frame.multispectral import Multispectral, RigGeometry, SunshineCounts, VignettingPolynomial
from simulation.camera import Taken
from simulation.sequoia import PIXELS_PER_MM
from simulation.tiff import (
    EXIF,
    GPS,
    Entry,
    append_directory,
    describe_exposure,
    rational,
    reserve,
    short,
    text,
)

_ASCII, _BYTE, _RATIONAL = 2, 1, 5
_XMP = 700
_PER_MILLIMETRE = 4
_RECORD = struct.Struct("<QHHHHfff")
_FILE_NAMES = {"green": "GRE", "red": "RED", "red_edge": "REG", "nir": "NIR"}

Numbers = tuple[float, ...]


def name_file(number: int, header: FrameHeader) -> str:
    """Return the name that the camera gives: IMG_180413_080000_0000_GRE.TIF."""
    taken = datetime.fromisoformat(header.taken_at or "")
    return f"IMG_{taken:%y%m%d_%H%M%S}_{number:04}_{_FILE_NAMES[_band(header).band]}.TIF"


def write_sequoia(path: Path, shot: Taken) -> None:
    """Write one band, from which a reader gets the same header and the same samples."""
    header = shot.header
    top, bottom = (round(header.black_level_dn[0] * 10_000), 10_000)
    with tifffile.TiffWriter(path, byteorder="<") as file:
        file.write(
            shot.frame.samples_dn,
            photometric="minisblack",
            metadata=None,
            software=header.software,
            extratags=[
                (271, _ASCII, 0, header.make, True),
                (272, _ASCII, 0, header.model, True),
                (_XMP, _BYTE, None, _packet(_band(header)), True),
                reserve(EXIF),
                reserve(GPS),
                (50714, _RATIONAL, 1, (top, bottom), True),  # BlackLevel
                (50735, _ASCII, 0, header.serial, True),  # CameraSerialNumber
            ],
        )
    append_directory(path, EXIF, _exif_entries(shot))
    append_directory(path, GPS, _gps_entries(header))


def _band(header: FrameHeader) -> Multispectral:
    assert header.multispectral is not None  # noqa: S101  every simulated Sequoia has one
    return header.multispectral


def _exif_entries(shot: Taken) -> list[Entry]:
    # The camera writes its monotonic clock, that of the sunshine records, as the time of digitisation.
    clock = datetime.fromtimestamp(0, UTC) + timedelta(microseconds=_band(shot.header).exposed_at_us or 0)
    taken_at = datetime.fromisoformat(shot.header.taken_at or "")
    return [
        *describe_exposure(shot.exposure.on_basis("nominal"), taken_at),
        text(36868, f"{clock:%Y:%m:%d %H:%M:%S}"),  # DateTimeDigitized
        text(37522, f"{clock:%f}"),  # SubSecTimeDigitized
        rational(41486, PIXELS_PER_MM),  # FocalPlaneXResolution
        rational(41487, PIXELS_PER_MM),  # FocalPlaneYResolution
        short(41488, _PER_MILLIMETRE),  # FocalPlaneResolutionUnit
    ]


def _gps_entries(header: FrameHeader) -> list[Entry]:
    latitude, longitude = header.latitude_deg or 0.0, header.longitude_deg or 0.0
    return [
        text(1, "N" if latitude >= 0.0 else "S"),
        rational(2, abs(latitude), 0.0, 0.0),
        text(3, "E" if longitude >= 0.0 else "W"),
        rational(4, abs(longitude), 0.0, 0.0),
    ]


def _packet(band: Multispectral) -> bytes:
    """Return the XMP packet, without the properties that are None."""
    values: dict[str, str | Numbers | None] = {
        "BandName": band.band_name,
        "CentralWavelength": _one(band.wavelength_nm),
        "WavelengthFWHM": _one(band.width_nm),
        "RigCameraIndex": None if band.rig_camera_index is None else str(band.rig_camera_index),
        "CaptureUUID": band.capture_id,
        "FlightUUID": band.flight_id,
        "SunshineSerialNumber": band.sunshine_serial,
        "SensorModel": (band.sensor_model.a, band.sensor_model.b, band.sensor_model.c)
        if band.sensor_model
        else None,
        **_lens(band.vignetting_polynomial),
        **_sunshine(band.counts),
        **_rig(band.geometry),
    }
    elements = "".join(_element(name, value) for name, value in values.items() if value is not None)
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        '<rdf:Description xmlns:Camera="http://pix4d.com/camera/1.0/">'
        f'{elements}</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def _element(name: str, value: str | Numbers) -> str:
    if isinstance(value, tuple):
        items = "".join(f"<rdf:li>{number!r}</rdf:li>" for number in value)
        value = f"<rdf:Seq>{items}</rdf:Seq>"
    else:
        value = escape(value)
    return f"<Camera:{name}>{value}</Camera:{name}>"


def _lens(lens: VignettingPolynomial | None) -> dict[str, str | Numbers | None]:
    if lens is None:
        return {}
    powers = ",".join(str(power) for pair in lens.exponents for power in pair)
    return {
        "VignettingPolynomial2DName": powers,
        "VignettingPolynomial2D": ",".join(repr(coefficient) for coefficient in lens.coefficients),
    }


def _sunshine(counts: SunshineCounts | None) -> dict[str, str | Numbers | None]:
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
        "IrradianceList": base64.b64encode(records).decode(),
        "IrradianceCalibrationMeasurement": ",".join(str(number) for row in rows for number in row) or None,
    }


def _rig(geometry: RigGeometry | None) -> dict[str, str | Numbers | None]:
    if geometry is None:
        return {}
    x_px, y_px = geometry.principal_point_px
    return {
        "ModelType": geometry.model,
        "PrincipalPoint": f"{x_px / PIXELS_PER_MM!r},{y_px / PIXELS_PER_MM!r}",
        "FisheyeAffineMatrix": ",".join(map(repr, geometry.fisheye_affine)) or None,
        "FisheyePolynomial": ",".join(map(repr, geometry.fisheye_polynomial)) or None,
        "RigRelatives": ",".join(map(repr, geometry.rotation_deg)) if geometry.rotation_deg else None,
    }


def _one(number: float | None) -> str | None:
    return None if number is None else repr(number)


def _angle(angle_deg: float | None) -> float:
    return math.nan if angle_deg is None else angle_deg
