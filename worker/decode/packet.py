"""Parts that the dialects of multispectral cameras share: packet, band name, lens and levels."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import RigGeometry, VignettingPolynomial, classify_band, name_band
from worker.decode import metadata, tags, tiff

_CONTAINER_BITS: Final = 16
_HIGHEST_POWER: Final = 8
_LONGEST: Final = 40
# Pixels a millimetre: what no sensor has is no resolution.
_COARSEST, _FINEST = 10.0, 4000.0
_MM_PER_UNIT: Final = {2: 25.4, 3: 10.0, 4: 1.0}


@dataclass(frozen=True, kw_only=True)
class Packet:
    """A file's directory and XMP, and what both say of the camera; "" for what is absent."""

    main: tiff.Directory
    xmp: metadata.Xmp
    bits: int
    make: str
    model: str
    software: str
    band_name: str


def open_packet(main: tiff.Directory, *, bits: int) -> Packet | None:
    """None for a file that names no band."""
    xmp = metadata.Xmp(metadata.read_xmp(main))
    band_name = xmp.text("camera:BandName") or xmp.text("drone-dji:BandName")
    if band_name is None:
        return None
    make, model, software = (read_text(main, tag) for tag in (tags.MAKE, tags.MODEL, tags.SOFTWARE))
    return Packet(
        main=main, xmp=xmp, bits=bits, make=make, model=model, software=software, band_name=band_name
    )


def describe_band(packet: Packet, *, sensor_bits: int) -> dict[str, Any]:
    """The fields that all makers write alike; ``sensor_bits`` are at the upper end of sixteen."""
    xmp, band = packet.xmp, name_band(packet.band_name)
    wavelength_nm, width_nm = xmp.number("camera:CentralWavelength"), xmp.number("camera:WavelengthFWHM")
    full_dn = float(((1 << sensor_bits) - 1) << (_CONTAINER_BITS - sensor_bits))
    return {
        "band": band,
        "band_name": packet.band_name,
        "wavelength_nm": wavelength_nm,
        "width_nm": width_nm,
        "kind": classify_band(band, wavelength_nm=wavelength_nm, width_nm=width_nm),
        "rig_camera_index": xmp.index("camera:RigCameraIndex"),
        "full_scale_dn": full_dn if packet.bits == _CONTAINER_BITS else None,
    }


def first_problem(problems: Iterable[str]) -> str | None:
    return next(filter(None, problems), None)


def read_polynomial(xmp: metadata.Xmp) -> tuple[VignettingPolynomial | None, str]:
    """The 2-D polynomial in x/W and y/H, or what is wrong with it."""
    powers, problem = xmp.require("camera:VignettingPolynomial2DName")
    coefficients, other = xmp.require("camera:VignettingPolynomial2D")
    if problem or other:
        return None, problem or other
    whole = [int(power) for power in powers if power == int(power) and 0 <= power <= _HIGHEST_POWER]
    if len(whole) != len(powers):
        return None, f"VignettingPolynomial2DName has exponents that are not whole from 0 to {_HIGHEST_POWER}"
    if len(powers) != 2 * len(coefficients):
        counts = f"{len(powers)} exponents for {len(coefficients)} coefficients"
        return None, f"VignettingPolynomial2DName has {counts}"
    pairs = tuple(zip(whole[::2], whole[1::2], strict=True))
    return VignettingPolynomial(exponents=pairs, coefficients=coefficients), ""


def read_numbers(directory: tiff.Directory, tag: int) -> list[float]:
    try:
        return [number for number in directory.numbers(tag, at_most=64) if number is not None]
    except InputRejected:
        return []


def read_text(directory: tiff.Directory, tag: int) -> str:
    try:
        text = directory.raw(tag, at_most=256).split(b"\0")[0].decode("latin-1")
    except InputRejected:
        return ""
    return "".join(letter if letter.isprintable() else " " for letter in text)[:_LONGEST].strip()


def read_geometry(packet: Packet, *, reference: bool) -> RigGeometry | None:
    """The lens as Pix4D's names describe it; ``reference`` : rotations are counted from this band."""
    main, xmp = packet.main, packet.xmp
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


def _pixels_per_mm(main: tiff.Directory) -> tuple[float, float] | None:
    try:
        if (exif := main.directory(tags.EXIF)) is None:
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
