"""The XMP of a band's map: which band of which capture it is, and how its lens draws.

Written anew from what was read of the frame. What the map has already taken in, such as vignetting, the
sensor's model and the light, is left out: photogrammetry software would correct for it a second time.
"""

from typing import Final
from xml.sax.saxutils import escape

from radiometry.multispectral import Multispectral, RigGeometry

Value = str | float | tuple[float, ...] | None

_CAMERA: Final = "http://pix4d.com/camera/1.0/"
_MICASENSE: Final = "http://micasense.com/MicaSense/1.0/"


def write_packet(band: Multispectral) -> bytes:
    """In the words of the camera's own files, so that whatever reads those reads the map."""
    camera: dict[str, Value] = {
        "BandName": band.band_name,
        "CentralWavelength": band.wavelength_nm,
        "WavelengthFWHM": band.width_nm,
        "RigCameraIndex": band.rig_camera_index,
        **(_describe_lens(band.geometry) if band.geometry else {}),
    }
    elements = _elements("Camera", camera)
    match band.system:
        case "sequoia":
            elements += _elements("Camera", {"CaptureUUID": band.capture_id, "FlightUUID": band.flight_id})
        case "micasense":
            elements += _elements("MicaSense", {"CaptureId": band.capture_id, "FlightId": band.flight_id})
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about="" xmlns:Camera="{_CAMERA}" xmlns:MicaSense="{_MICASENSE}">'
        f'{elements}</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def _describe_lens(lens: RigGeometry) -> dict[str, Value]:
    found: dict[str, Value] = {
        "ModelType": lens.model,
        "FisheyeAffineMatrix": lens.fisheye_affine,
        "FisheyePolynomial": lens.fisheye_polynomial,
        "PerspectiveFocalLength": lens.focal_length_px,
        "PerspectiveDistortion": lens.distortion,
        "RigRelatives": lens.rotation_deg,
    }
    if lens.pixels_per_mm is not None:
        # read back with the focal plane's resolution, which EXIF holds
        pairs = zip(lens.principal_point_px, lens.pixels_per_mm, strict=True)
        found["PrincipalPoint"] = tuple(at_px / per_mm for at_px, per_mm in pairs)
    return found


def _elements(family: str, values: dict[str, Value]) -> str:
    return "".join(
        f"<{family}:{name}>{_text(value)}</{family}:{name}>"
        for name, value in values.items()
        if value is not None and value != ()
    )


def _text(value: Value) -> str:
    return ",".join(map(repr, value)) if isinstance(value, tuple) else escape(str(value))
