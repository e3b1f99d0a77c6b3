"""Small TIFF files as Sequoia and MicaSense cameras write them, with the XMP that a test wants."""

import base64
import struct

from simulation.dng import ASCII, BYTE, LONG, RATIONAL, SHORT, TiffWriter

ROWS, COLS = 24, 32

CALIBRATION = "0,600,11,3,1,600,330,84,2,600,3990,1506,3,600,65535,38630"
SEQUOIA = {
    "SensorModel": "310316.1,3067.5,4773.6",
    "BandName": "Green",
    "CentralWavelength": "550.0",
    "WavelengthFWHM": "40.0",
    "VignettingPolynomial2DName": "0,0,1,0,0,1",
    "VignettingPolynomial2D": "0.9,0.05,-0.1",
    "SunshineSerialNumber": "PI040379AA6E000358",
    "CaptureUUID": "BE5AB0AB",
    "RigCameraIndex": "0",
    "IrradianceCalibrationMeasurement": CALIBRATION,
}


def pack_records(layout, rows):
    """``rows`` : all fields of each record, time first."""
    return base64.b64encode(b"".join(struct.pack(layout, *row) for row in rows)).decode()


def write_sequoia_xmp(**changes):
    """The properties above, changed; None leaves one out."""
    properties = {key: value for key, value in (SEQUOIA | changes).items() if value is not None}
    elements = "".join(
        f"<Camera:{key}><rdf:Seq><rdf:li>{value}</rdf:li></rdf:Seq></Camera:{key}>"
        if key in ("SensorModel", "BandName")
        else f"<Camera:{key}>{value}</Camera:{key}>"
        for key, value in properties.items()
    )
    return wrap(f'<rdf:Description xmlns:Camera="http://pix4d.com/camera/1.0/">{elements}</rdf:Description>')


def wrap(description):
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'{description}</rdf:RDF></x:xmpmeta>   <?xpacket end="w"?>'
    )


def write_micasense_xmp(*, band="Red edge", lens=True, **dls):
    radial = (
        "<Camera:VignettingCenter>16,12</Camera:VignettingCenter>"
        "<Camera:VignettingPolynomial>-1e-4,0,0,0,0,0</Camera:VignettingPolynomial>"
    )
    properties = "".join(f"<DLS:{key}>{value}</DLS:{key}>" for key, value in dls.items())
    return wrap(
        '<rdf:Description xmlns:MicaSense="http://micasense.com/MicaSense/1.0/"'
        ' xmlns:Camera="http://pix4d.com/1.0" xmlns:DLS="http://micasense.com/DLS/1.0/">'
        "<MicaSense:RadiometricCalibration><rdf:Seq><rdf:li>0.0001</rdf:li><rdf:li>1e-07</rdf:li>"
        "<rdf:li>1e-06</rdf:li></rdf:Seq></MicaSense:RadiometricCalibration>"
        f"<Camera:BandName>{band}</Camera:BandName>{radial if lens else ''}{properties}</rdf:Description>"
    )


DJI = {
    "BandName": "NIR",
    "BlackLevel": "3200",
    "SensorGain": "2.000",
    "ExposureTime": "1250",
    "SensorGainAdjustment": "1.25",
    "CalibratedOpticalCenterX": "16.0",
    "CalibratedOpticalCenterY": "12.0",
    "VignettingData": "0.0001, 1e-6, 0, 0, 0, 0",
    "VignettingFlag": "0",
    "Irradiance": "9741.7",
    "CaptureUUID": "123e4567",
    "DroneSerialNumber": "1581F5FK",
    "CameraSerialNumber": "5A1B2C",
    "FlightYawDegree": "+95.50",
    "FlightPitchDegree": "-1.20",
    "FlightRollDegree": "+0.50",
}


def write_dji_xmp(**changes):
    """As a Mavic 3 Multispectral's; the properties above, changed; None leaves one out."""
    properties = {key: value for key, value in (DJI | changes).items() if value is not None}
    attributes = " ".join(f'drone-dji:{key}="{value}"' for key, value in properties.items())
    return wrap(
        f'<rdf:Description xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/" {attributes}'
        ' xmlns:Camera="http://pix4d.com/camera/1.0"><Camera:CentralWavelength>860</Camera:CentralWavelength>'
        "</rdf:Description>"
    )


def make_tiff(xmp, *, make="Parrot", model="Sequoia", software="v1.4.1", black=True, brightest=None):
    """Sixteen bits, grey, uncompressed; ``brightest`` : the last sample."""
    writer = TiffWriter()
    samples = list(range(5000, 5000 + ROWS * COLS))
    samples[-1] = brightest or samples[-1]
    strip = writer.append(struct.pack(f"<{ROWS * COLS}H", *samples))
    largest = 2**31 - 1
    exif = writer.directory(
        {
            33434: (RATIONAL, (6442451, largest)),
            33437: (RATIONAL, (largest, 976128896)),
            34855: (SHORT, 206),
            36868: (ASCII, "1970:01:01 00:02:30"),
            37522: (ASCII, "128607"),
        }
    )
    entries = {
        256: (SHORT, COLS),
        257: (SHORT, ROWS),
        258: (SHORT, 16),
        259: (SHORT, 1),
        262: (SHORT, 1),
        271: (ASCII, make),
        272: (ASCII, model),
        273: (LONG, strip),
        277: (SHORT, 1),
        279: (LONG, ROWS * COLS * 2),
        305: (ASCII, software),
        700: (BYTE, xmp.encode() if isinstance(xmp, str) else xmp),
        34665: (LONG, exif),
    }
    if black:
        entries |= {50713: (SHORT, [2, 2]), 50714: (LONG, [4953, 4981, 4994, 4965])}
    return writer.finish(writer.directory(entries))
