"""The XMP of a map: attitude and position of the camera, and its bands and lens.

Rewritten from what was read of the frame. What the map already contains, such as vignetting, the sensor's
model and the light, is left out: photogrammetry software would correct for it a second time.

Simple values are attributes, as Parrot and DJI write them, and MicaSense's own are elements: OpenDroneMap
compares texts instead of parsing XMP, and finds `drone-dji:CaptureUUID`, `drone-dji:RtkStdLat`,
`Camera:CaptureUUID` and `Camera:GPSXYAccuracy` as attributes only, `MicaSense:CaptureId` and `DLS:Yaw` as
elements only. Pix4D and Metashape accept both.
"""

from collections.abc import Sequence
from typing import Final
from xml.sax.saxutils import escape, quoteattr

from radiometry.frame import FrameHeader, PositionFix, multispectral
from worker.decode.dialects import BY_SYSTEM

Value = str | float | tuple[float, ...] | list[str] | None

# with the prefixes that cameras write: some programs look for these, and not for the addresses
_PREFIXES: Final = {"camera": "Camera", "micasense": "MicaSense", "dls": "DLS", "drone-dji": "drone-dji"}
_ADDRESSES: Final = {
    "camera": "http://pix4d.com/camera/1.0/",
    "micasense": "http://micasense.com/MicaSense/1.0/",
    "dls": "http://micasense.com/DLS/1.0/",
    "drone-dji": "http://www.dji.com/drone-dji/1.0/",
}
_ELEMENTS: Final = ("micasense", "dls")
_RTK_FLAGS: Final = {"none": 0, "single": 16, "float": 34, "fixed": 50}


def write_packet(header: FrameHeader, bands: Sequence[multispectral.Multispectral] = ()) -> bytes:
    """Return the packet in the words of the camera's own files; empty where nothing is known."""
    said: dict[str, Value] = {angle.name: angle.value for angle in header.attitude}
    if header.position_fix is not None:
        said |= _describe_fix(header.position_fix)
    said["drone-dji:RelativeAltitude"] = header.height_above_takeoff_m
    if bands:
        said |= _describe_bands(bands)
    written = {name: value for name, value in said.items() if value is not None and value not in ((), [])}
    if not written:
        return b""
    inside = [
        name for name, value in written.items() if isinstance(value, list) or _family(name) in _ELEMENTS
    ]
    elements = "".join(_element(name, written[name]) for name in inside)
    attributes = "".join(
        f" {_tag(name)}={quoteattr(_text(value))}" for name, value in written.items() if name not in inside
    )
    families = dict.fromkeys(_family(name) for name in written)
    spaces = "".join(f' xmlns:{_PREFIXES[family]}="{_ADDRESSES[family]}"' for family in families)
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about=""{spaces}{attributes}>'
        f'{elements}</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def _describe_fix(fix: PositionFix) -> dict[str, Value]:
    across = [u for u in (fix.u_latitude_m, fix.u_longitude_m) if u is not None]
    return {
        "drone-dji:RtkFlag": _RTK_FLAGS.get(fix.kind),
        "drone-dji:RtkStdLat": fix.u_latitude_m,
        "drone-dji:RtkStdLon": fix.u_longitude_m,
        "drone-dji:RtkStdHgt": fix.u_height_m,
        "camera:GPSXYAccuracy": max(across, default=None),
        "camera:GPSZAccuracy": fix.u_height_m,
    }


def _describe_bands(bands: Sequence[multispectral.Multispectral]) -> dict[str, Value]:
    first, *others = bands
    capture, flight = BY_SYSTEM[first.system].IDENTITIES
    lens = _describe_lens(first.geometry, turned=not others) if first.geometry is not None else {}
    found: dict[str, Value] = lens | {capture: first.capture_id, flight: first.flight_id}
    if others:
        columns: dict[str, list[str | float | None]] = {
            "camera:BandName": [each.band_name for each in bands],
            "camera:CentralWavelength": [each.wavelength_nm for each in bands],
            "camera:WavelengthFWHM": [each.width_nm for each in bands],
        }
        told = {name: [str(value) for value in of] for name, of in columns.items() if None not in of}
        return {**found, **told}
    return found | {
        "camera:BandName": first.band_name,
        "camera:CentralWavelength": first.wavelength_nm,
        "camera:WavelengthFWHM": first.width_nm,
        "camera:RigCameraIndex": first.rig_camera_index,
    }


def _describe_lens(lens: multispectral.RigGeometry, *, turned: bool) -> dict[str, Value]:
    found: dict[str, Value] = {
        "camera:ModelType": lens.model,
        "camera:FisheyeAffineMatrix": lens.fisheye_affine,
        "camera:FisheyePolynomial": lens.fisheye_polynomial,
        "camera:PerspectiveFocalLength": lens.focal_length_px,
        "camera:PerspectiveDistortion": lens.distortion,
        "camera:RigRelatives": lens.rotation_deg if turned else None,
    }
    if lens.pixels_per_mm is not None:
        # read back with the focal plane's resolution, which EXIF holds
        pairs = zip(lens.principal_point_px, lens.pixels_per_mm, strict=True)
        found["camera:PrincipalPoint"] = tuple(at_px / per_mm for at_px, per_mm in pairs)
        if lens.focal_length_px is not None:
            # the unit of Pix4D's specification; pixels without a unit are an old RedEdge's
            found["camera:PerspectiveFocalLength"] = lens.focal_length_px / lens.pixels_per_mm[0]
            found["camera:PerspectiveFocalLengthUnits"] = "mm"
    return found


def _family(name: str) -> str:
    return name.partition(":")[0]


def _tag(name: str) -> str:
    return f"{_PREFIXES[_family(name)]}:{name.partition(':')[2]}"


def _text(value: Value) -> str:
    return ",".join(map(repr, value)) if isinstance(value, tuple) else str(value)


def _element(name: str, value: Value) -> str:
    if not isinstance(value, list):
        return f"<{_tag(name)}>{escape(_text(value))}</{_tag(name)}>"
    items = "".join(f"<rdf:li>{escape(item)}</rdf:li>" for item in value)
    return f"<{_tag(name)}><rdf:Seq>{items}</rdf:Seq></{_tag(name)}>"
