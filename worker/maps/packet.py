"""The XMP of a map: how the camera stood, and of a band which it is of which capture and how its lens draws.

Written anew from what was read of the frame. What the map has already taken in, such as vignetting, the
sensor's model and the light, is left out: photogrammetry software would correct for it a second time.
"""

from collections.abc import Sequence
from typing import Final
from xml.sax.saxutils import escape

from radiometry.frame import StatedAngle
from radiometry.frame.multispectral import Multispectral, RigGeometry
from worker.decode.dialects import BY_SYSTEM

Value = str | float | tuple[float, ...] | None

# with the prefixes that cameras write: some programs look for these, and not for the addresses
_PREFIXES: Final = {"camera": "Camera", "micasense": "MicaSense", "dls": "DLS", "drone-dji": "drone-dji"}
_ADDRESSES: Final = {
    "camera": "http://pix4d.com/camera/1.0/",
    "micasense": "http://micasense.com/MicaSense/1.0/",
    "dls": "http://micasense.com/DLS/1.0/",
    "drone-dji": "http://www.dji.com/drone-dji/1.0/",
}


def write_packet(attitude: Sequence[StatedAngle], band: Multispectral | None = None) -> bytes:
    """In the words of the camera's own files, so that whatever reads those reads the map.

    ``band`` : of a map that shows this band as its lens draws it. Empty where there is nothing to say.
    """
    said: dict[str, Value] = {angle.name: angle.value for angle in attitude}
    if band is not None:
        said |= _describe_band(band)
    elements = "".join(
        _element(name, value) for name, value in said.items() if value is not None and value != ()
    )
    if not elements:
        return b""
    families = "".join(
        f' xmlns:{prefix}="{_ADDRESSES[family]}"'
        for family, prefix in _PREFIXES.items()
        if f"<{prefix}:" in elements
    )
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about=""{families}>'
        f'{elements}</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def _describe_band(band: Multispectral) -> dict[str, Value]:
    found: dict[str, Value] = {
        "camera:BandName": band.band_name,
        "camera:CentralWavelength": band.wavelength_nm,
        "camera:WavelengthFWHM": band.width_nm,
        "camera:RigCameraIndex": band.rig_camera_index,
    }
    if band.geometry is not None:
        found |= _describe_lens(band.geometry)
    capture, flight = BY_SYSTEM[band.system].IDENTITIES
    return found | {capture: band.capture_id, flight: band.flight_id}


def _describe_lens(lens: RigGeometry) -> dict[str, Value]:
    found: dict[str, Value] = {
        "camera:ModelType": lens.model,
        "camera:FisheyeAffineMatrix": lens.fisheye_affine,
        "camera:FisheyePolynomial": lens.fisheye_polynomial,
        "camera:PerspectiveFocalLength": lens.focal_length_px,
        "camera:PerspectiveDistortion": lens.distortion,
        "camera:RigRelatives": lens.rotation_deg,
    }
    if lens.pixels_per_mm is not None:
        # read back with the focal plane's resolution, which EXIF holds
        pairs = zip(lens.principal_point_px, lens.pixels_per_mm, strict=True)
        found["camera:PrincipalPoint"] = tuple(at_px / per_mm for at_px, per_mm in pairs)
    return found


def _element(key: str, value: Value) -> str:
    family, _, local = key.partition(":")
    name = f"{_PREFIXES[family]}:{local}"
    text = ",".join(map(repr, value)) if isinstance(value, tuple) else escape(str(value))
    return f"<{name}>{text}</{name}>"
