"""Angles of camera, gimbal and light sensor, under the names that the file gives them."""

import io

import numpy as np
import pytest
import tifffile

from tests.support.data import data_file
from worker.decode import reader

DJI = """<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description rdf:about="DJI Meta Data" xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/"
 drone-dji:RelativeAltitude="+50.10" drone-dji:GimbalRollDegree="+0.00" drone-dji:GimbalYawDegree="-12.30"
 drone-dji:GimbalPitchDegree="-89.90" drone-dji:FlightYawDegree="{yaw}"/></rdf:RDF></x:xmpmeta>"""


def read_angles(folder, xmp):
    out, packet = io.BytesIO(), xmp.encode()
    tifffile.imwrite(
        out, np.full((32, 48), 900, np.uint16), extratags=[(700, 1, len(packet), packet, True)], metadata=None
    )
    path = folder / "picture.tif"
    path.write_bytes(out.getvalue())
    return {angle.name: angle.value for angle in reader.read_header(path).attitude}


def test_a_gimbal_s_and_its_aircraft_s(tmp_path):
    assert read_angles(tmp_path, DJI.format(yaw="+171.20")) == {
        "drone-dji:GimbalYawDegree": -12.3,
        "drone-dji:GimbalPitchDegree": -89.9,
        "drone-dji:GimbalRollDegree": 0.0,
        "drone-dji:FlightYawDegree": 171.2,
    }


@pytest.mark.parametrize("yaw", ["nan", "inf", "1e9", "", "north", "12,5", "&lt;b&gt;"])
def test_what_is_no_angle_is_left_out(tmp_path, yaw):
    found = read_angles(tmp_path, DJI.format(yaw=yaw))
    assert len(found) == 3
    assert "drone-dji:FlightYawDegree" not in found


@pytest.mark.parametrize("xmp", ["", "<x", "<!DOCTYPE x><x/>"])
def test_no_packet_no_angles(tmp_path, xmp):
    assert read_angles(tmp_path, xmp or " ") == {}


@pytest.mark.parametrize(
    ("name", "angles"),
    [
        (
            "sequoia/IMG_180413_080658_0000_GRE.TIF",
            {"camera:Yaw": -63.782867, "camera:Pitch": 0.457283, "camera:Roll": 1.283353},
        ),
        (
            "rededge/0000SET_000_IMG_0001_4.tif",
            {
                "camera:IrradianceYaw": -21.110888465668392,
                "camera:IrradiancePitch": -0.552849606695601,
                "camera:IrradianceRoll": -1.5354035422683689,
                "dls:Yaw": -0.36845451174720734,
                "dls:Pitch": -0.009649045905193925,
                "dls:Roll": -0.026797847159366964,
            },
        ),
    ],
)
def test_real_files(name, angles):
    assert {each.name: each.value for each in reader.read_header(data_file(name)).attitude} == angles
