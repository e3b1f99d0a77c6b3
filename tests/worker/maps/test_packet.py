"""The XMP of a map: band, lens and attitude come back as the camera's file told them, and nothing else."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from radiometry.frame import StatedAngle
from radiometry.frame.multispectral import Multispectral
from tests.support import reader
from tests.support.data import data_file
from worker.decode.dialects import read_multispectral
from worker.decode.metadata import parse_xmp, read_metadata
from worker.decode.packet import _pixels_per_mm
from worker.decode.tiff import read_directories
from worker.maps.packet import write_packet
from worker.maps.tiff import MapFacts, encode_band, write_tiff

FILES = ["sequoia/IMG_180413_080658_0000_RED.TIF", "rededge/0000SET_000_IMG_0001_4.tif"]
ANGLES = {"sequoia": 3, "micasense": 6}  # the RedEdge's are of its light sensor, in degrees and in radians
KEPT = (
    *("system", "band", "band_name", "wavelength_nm", "width_nm"),
    *("rig_camera_index", "capture_id", "flight_id"),
)


@pytest.mark.parametrize("name", FILES)
def test_a_map_says_of_band_and_lens_what_the_camera_s_file_says(name, tmp_path):
    header = reader.read_header(data_file(name))
    told = header.multispectral
    target = tmp_path / "map.tif"
    tiles = encode_band(np.zeros((256, header.width_px), np.float32))
    facts = MapFacts(
        header=replace(header, height_px=256),
        exposure=None,
        software="stilb",
        description={},
        packet=write_packet(header, [told]),
    )
    write_tiff(target, tiles, facts)
    (main,) = read_directories(target.read_bytes())
    found = read_multispectral(main, bits=32)
    assert [getattr(found, field) for field in KEPT] == [getattr(told, field) for field in KEPT]
    assert found.geometry.principal_point_px == pytest.approx(told.geometry.principal_point_px, rel=1e-8)
    assert found.geometry.pixels_per_mm == pytest.approx(told.geometry.pixels_per_mm, rel=1e-8)
    assert len(header.attitude) == ANGLES[told.system]
    again = read_metadata(main)
    assert (again["attitude"], again["taken_at"]) == (header.attitude, header.taken_at)
    names = ("latitude_deg", "longitude_deg", "altitude_m")
    place, told_place = (tuple(map(each.get, names)) for each in (again, vars(header)))
    # the Sequoia's file says no place
    assert place == (told_place if None in told_place else pytest.approx(told_place, rel=1e-9))
    assert (None in place) == (told.system == "sequoia")
    same = {"principal_point_px": (0.0, 0.0), "pixels_per_mm": None}
    assert replace(found.geometry, **same) == replace(told.geometry, **same)


@pytest.mark.parametrize("name", FILES)
def test_what_the_map_has_taken_in_is_not_said_again(name):
    header = reader.read_header(data_file(name))
    kept = {angle.name for angle in header.attitude}
    properties = set(parse_xmp(write_packet(header, [header.multispectral]))) - kept
    words = ("Vignetting", "SensorModel", "Radiometric", "Irradiance", "Sunshine", "Albedo")
    assert not [key for key in properties if any(word in key for word in words)]


def make_header(**more):
    return replace(reader.read_header(data_file(FILES[1])), **({"attitude": ()} | more))


def test_attitude_alone_is_a_packet_and_nothing_is_none():
    angles = (StatedAngle(name="drone-dji:GimbalYawDegree", value=-12.3),)
    packet = write_packet(make_header(attitude=angles))
    assert parse_xmp(packet) == {"drone-dji:GimbalYawDegree": ("-12.3",)}
    assert b' drone-dji:GimbalYawDegree="-12.3"' in packet
    assert write_packet(make_header()) == b""


def test_a_name_cannot_break_out_of_the_packet():
    band = Multispectral(system="micasense", band="x", band_name="</Camera:BandName>&\"'<x>")
    assert parse_xmp(write_packet(make_header(), [band])) == {"camera:BandName": (band.band_name,)}


def test_captures_and_fixes_are_written_as_the_cameras_write_them():
    """OpenDroneMap finds a DJI's and a Sequoia's capture as an attribute alone, a RedEdge's as an element."""
    header = reader.read_header(data_file("p4m/DJI_0014.TIF"))
    packet = write_packet(header, [header.multispectral]).decode()
    capture = header.multispectral.capture_id
    assert f' drone-dji:CaptureUUID="{capture}"' in packet
    assert ' drone-dji:RtkFlag="50"' in packet
    assert ' drone-dji:RtkStdHgt="0.02043"' in packet
    assert ' Camera:GPSXYAccuracy="0.0123"' in packet
    assert ' Camera:PerspectiveFocalLengthUnits="mm"' in packet
    rededge = reader.read_header(data_file(FILES[1]))
    packet = write_packet(rededge, [rededge.multispectral]).decode()
    assert f"<MicaSense:CaptureId>{rededge.multispectral.capture_id}</" in packet
    assert "<DLS:Yaw>" in packet


def test_several_bands_are_a_sequence_and_keep_one_lens():
    headers = [reader.read_header(data_file(f"rededge/0000SET_000_IMG_0001_{n}.tif")) for n in (4, 3)]
    found = parse_xmp(write_packet(headers[0], [each.multispectral for each in headers]))
    assert found["camera:BandName"] == ("NIR", "Red")
    assert [float(each) for each in found["camera:CentralWavelength"]] == [840, 668]
    assert "camera:RigCameraIndex" not in found
    assert found["micasense:CaptureId"] == (headers[0].multispectral.capture_id,)


@pytest.mark.parametrize("resolution", [0.0, -266.0, 9.0, 1e9, float("inf")])
def test_a_resolution_that_no_sensor_has_is_none(resolution):
    exif = SimpleNamespace(numbers=lambda *_, **__: (resolution,), integer=lambda *_: 4)
    assert _pixels_per_mm(SimpleNamespace(directory=lambda _: exif)) is None
