"""Files of one band as a Parrot Sequoia writes them: 16 bits, EXIF, GPS, and all else in XMP."""

import base64
import math
import struct
from datetime import UTC, datetime, timedelta
from pathlib import Path
from xml.sax.saxutils import escape

from radiometry.frame import FrameHeader
from radiometry.frame.multispectral import Multispectral, RigGeometry, SunshineCounts, VignettingPolynomial
from simulation.camera import Taken
from simulation.sequoia import PIXELS_PER_MM
from simulation.tiff import (
    ASCII,
    BYTE,
    LONG,
    RATIONAL,
    SHORT,
    Entries,
    TiffWriter,
    append_strip,
    approximate,
    describe_exposure,
    describe_image,
)

_RECORD = struct.Struct("<QHHHHfff")
_FILE_NAMES = {"green": "GRE", "red": "RED", "red_edge": "REG", "nir": "NIR"}

Numbers = tuple[float, ...]


def name_file(number: int, header: FrameHeader) -> str:
    """Return the name that the camera gives: IMG_180413_080000_0000_GRE.TIF."""
    taken = datetime.fromisoformat(header.taken_at or "")
    return f"IMG_{taken:%y%m%d_%H%M%S}_{number:04}_{_FILE_NAMES[read_band(header).band]}.TIF"


def write_sequoia(path: Path, shot: Taken) -> None:
    """Write one band, from which a reader gets the same header and the same samples."""
    band = read_band(shot.header)
    tags: Entries = {
        50714: (RATIONAL, (round(shot.header.black_level_dn[0] * 10_000), 10_000)),  # BlackLevel
        50735: (ASCII, shot.header.serial),  # CameraSerialNumber
    }
    # The camera writes its monotonic clock, that of the sunshine records, as the time of digitisation.
    clock = datetime.fromtimestamp(0, UTC) + timedelta(microseconds=band.exposed_at_us or 0)
    exif: Entries = {
        36868: (ASCII, f"{clock:%Y:%m:%d %H:%M:%S}"),  # DateTimeDigitized
        37522: (ASCII, f"{clock:%f}"),  # SubSecTimeDigitized
        41486: (RATIONAL, approximate(PIXELS_PER_MM)),  # FocalPlaneXResolution
        41487: (RATIONAL, approximate(PIXELS_PER_MM)),  # FocalPlaneYResolution
        41488: (SHORT, 4),  # FocalPlaneResolutionUnit: millimetres
    }
    write_band(path, shot, packet=_packet(band), exif=exif, tags=tags)


def write_band(path: Path, shot: Taken, *, packet: bytes, exif: Entries, tags: Entries) -> None:
    """Write one band with its XMP packet, and the entries that its maker adds."""
    header, samples = shot.header, shot.frame.samples_dn
    writer = TiffWriter()
    taken_at = datetime.fromisoformat(header.taken_at or "")
    exposure = describe_exposure(shot.exposure.on_basis("nominal"), taken_at)
    tags |= {
        271: (ASCII, header.make),
        272: (ASCII, header.model),
        305: (ASCII, header.software),
        700: (BYTE, packet),  # XMP
        34665: (LONG, writer.directory(exposure | exif)),
        34853: (LONG, writer.directory(_locate(header))),
    }
    image = describe_image(samples, photometric=1) | append_strip(writer, samples)
    path.write_bytes(writer.finish(writer.directory(image | tags)))


def read_band(header: FrameHeader) -> Multispectral:
    """Return what the header of a simulated frame says of its band."""
    assert header.multispectral is not None  # noqa: S101  every simulated rig has one
    return header.multispectral


def _locate(header: FrameHeader) -> Entries:
    """Return the GPS entries of a position."""
    latitude, longitude = header.latitude_deg or 0.0, header.longitude_deg or 0.0
    return {
        1: (ASCII, "N" if latitude >= 0.0 else "S"),
        2: (RATIONAL, [approximate(abs(latitude)), (0, 1), (0, 1)]),
        3: (ASCII, "E" if longitude >= 0.0 else "W"),
        4: (RATIONAL, [approximate(abs(longitude)), (0, 1), (0, 1)]),
    }


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
