"""DJI's P4 Multispectral and Mavic 3 Multispectral, as DJI's image processing guides describe their files."""

import math
from typing import Final

from radiometry.frame import multispectral
from worker.decode import metadata, tags
from worker.decode.packet import Packet, describe_band, first_problem, read_geometry, read_numbers

IDENTITIES = ("drone-dji:CaptureUUID", "drone-dji:FlightUUID")
# The P4's; of the Mavic's depth nothing is published, and the coarser one finds what is saturated in either.
_SENSOR_BITS: Final = 10
_DEWARP_NUMBERS, _MATRIX_NUMBERS = 9, 9
_MICROSECONDS: Final = 1e6
_SAME_REL: Final = 1e-3


def knows(packet: Packet) -> bool:
    return packet.make.lower() == "dji" and packet.xmp.text("drone-dji:BandName") is not None


def read(packet: Packet) -> multispectral.Multispectral:
    xmp = packet.xmp
    needed = ("SensorGain", "ExposureTime", "SensorGainAdjustment", "CalibratedOpticalCenterX")
    stated = [xmp.require(f"drone-dji:{name}", 1) for name in (*needed, "CalibratedOpticalCenterY")]
    terms, no_terms = xmp.require("drone-dji:VignettingData")
    values, problems = [value[0] if value else 0.0 for value, _ in stated], [each for _, each in stated]
    gain, time_us, adjustment, x_px, y_px = values
    black_dn = xmp.first_number("drone-dji:BlackLevel", "drone-dji:BlackCurrent", "camera:BlackCurrent")
    irradiance = _read_irradiance(xmp)
    names = ("DroneID", "DroneSerialNumber", "CameraSerialNumber")
    serials = [xmp.text(f"drone-dji:{name}") for name in names]
    return multispectral.Multispectral(
        system="dji",
        **describe_band(packet, sensor_bits=_SENSOR_BITS),
        capture_id=xmp.text(IDENTITIES[0]),
        flight_id=xmp.text(IDENTITIES[1]),
        gain_model=None
        if any(problems[:3])
        else multispectral.GainModel(
            gain=gain, exposure_time_s=time_us / _MICROSECONDS, adjustment=adjustment
        ),
        radial_gain=None
        if any(problems[3:]) or no_terms
        else multispectral.RadialVignetting(centre_x_px=x_px, centre_y_px=y_px, coefficients=terms),
        black_dn=black_dn,
        problem=first_problem((*problems, no_terms, _find_contradiction(packet, black_dn))),
        imager_serial=serials[2],
        sunshine_serial=serials[0] or serials[1],  # the sensor is part of the aircraft
        sunshine_missing="" if irradiance else "the file has no Irradiance of the sunlight sensor",
        irradiance=irradiance,
        geometry=_read_geometry(packet, x_px, y_px),
    )


def _find_contradiction(packet: Packet, black_dn: float | None) -> str:
    """Return what makes DJI's formula wrong for this file; "" for nothing."""
    if packet.xmp.number("drone-dji:VignettingFlag"):
        return "VignettingFlag says that the camera has corrected the vignetting already"
    if black_dn is None and not read_numbers(packet.main, tags.BLACK_LEVEL):
        return "neither BlackLevel nor BlackCurrent states a black level"
    return ""


def _read_irradiance(xmp: metadata.Xmp) -> multispectral.SunshineIrradiance | None:
    """The sunlight sensor's reading, in a unit of its own.

    Its attitude is the aircraft's unless the file states another; the P4 writes its sensor's as zeros.
    `SunSensor` is the reading before DJI's compensation.
    """
    if (value := xmp.first_number("drone-dji:Irradiance", "camera:Irradiance")) is None or not value > 0.0:
        return None
    before = xmp.first_number("drone-dji:SunSensor", "camera:SunSensor")
    same = before is None or math.isclose(before, value, rel_tol=_SAME_REL)
    yaw, pitch, roll = (
        xmp.first_number(
            f"camera:SunSensor{axis}", f"drone-dji:SunSensor{axis}", f"drone-dji:Flight{axis}Degree"
        )
        for axis in ("Yaw", "Pitch", "Roll")
    )
    return multispectral.SunshineIrradiance(
        relative_irradiance=value,
        quantity="spectral" if same else "compensated",
        unit_origin="own",
        yaw_deg=yaw,
        pitch_deg=pitch,
        roll_deg=roll,
        file_unit="DJI's own",
    )


def _read_geometry(packet: Packet, x_px: float, y_px: float) -> multispectral.RigGeometry | None:
    """The lens from DewarpData "date;fx,fy,cx,cy,k1,k2,p1,p2,k3", else from Pix4D's names."""
    xmp = packet.xmp
    text = xmp.text("drone-dji:DewarpData") or ""
    day, _, rest = text.rpartition(";")
    try:
        lens = tuple(float(word) for word in rest.split(","))
    except ValueError:
        lens = ()
    # tried on files of a P4 alone: of a Mavic, whose guide aligns by CalibratedHMatrix, no offset is taken
    later = xmp.numbers("drone-dji:CalibratedHMatrix")
    offset = [None if later else xmp.number(f"drone-dji:RelativeOpticalCenter{axis}") for axis in "XY"]
    matrix = later or xmp.numbers("drone-dji:DewarpHMatrix")
    if len(lens) != _DEWARP_NUMBERS or not all(map(math.isfinite, lens)):
        return read_geometry(packet, reference=False)
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = lens
    focal_px = xmp.number("drone-dji:CalibratedFocalLength")
    focal_mm = xmp.number("camera:PerspectiveFocalLength")
    per_mm = focal_px / focal_mm if focal_px and focal_mm else None
    return multispectral.RigGeometry(
        model="perspective",
        principal_point_px=(x_px + cx, y_px + cy),
        focal_length_px=fx,
        focal_length_y_px=fy,
        distortion=(k1, k2, k3, p1, p2),
        pixels_per_mm=(per_mm, per_mm) if per_mm else None,
        homography=matrix if len(matrix) == _MATRIX_NUMBERS else None,
        offset_px=(offset[0], offset[1]) if offset[0] is not None and offset[1] is not None else None,
        calibrated_on=day or None,
    )
