"""A real DJI P4 Multispectral over HTTP, and beside it what reflectance has no use for."""

import io
import json

import pytest
import tifffile
from PIL import Image

from store.tables import FrameRow
from tests.support.data import data_file
from tests.worker.decode.spectral_tiff import make_tiff, write_micasense_xmp, write_sequoia_xmp

CAMERA = {"make": "DJI", "model": "FC6360", "serial": "43e53d2eaaae3536b0fd1499da1d4389"}
NUMBERS = {"red": 3, "nir": 5}
# By DJI's guide, over rows 500 to 799 and columns 650 to 949: K of a panel of 0.5 is 0.5 over it.
CENTRE = {"red": 0.02423, "nir": 0.1594}
REGION = {"polygon": [[650, 500], [950, 500], [950, 800], [650, 800]]}
PANEL = {
    "serial": "P-50",
    "measured_on": "2020-06-01",
    "bands": [{"band": band, "reflectance": 0.5, "standard_uncertainty": 0.01} for band in NUMBERS],
}


def read(house, campaign, content, **query):
    sent = house.upload(campaign, content, **query)
    house.work()
    return house.get(f"/v1/frames/{sent['id']}")


@pytest.fixture(scope="module")
def campaign(sqlite_house):
    camera = sqlite_house.camera(**CAMERA)
    sqlite_house.post("/v1/panels", PANEL)
    return sqlite_house.post("/v1/campaigns", {"camera_id": camera["id"], "method": "reflectance"})


@pytest.fixture(scope="module")
def frames(sqlite_house, campaign):
    return {
        band: read(
            sqlite_house,
            campaign,
            data_file(f"p4m/DJI_001{number}.TIF").read_bytes(),
            role="panel",
            filename=band,
        )
        for band, number in NUMBERS.items()
    }


def test_a_p4_multispectral_is_read_shown_fitted_and_measured(sqlite_house, campaign, frames):
    house = sqlite_house
    for band, frame in frames.items():
        assert (frame["state"], frame["band"]) == ("read", band)
        assert (frame["black_level_dn"], frame["white_level_dn"]) == (4096.0, 65472.0)
        assert frame["sunshine"]["unit"] == "1"
        answer = house.http.get(f"/v1/frames/{frame['id']}/preview.png")
        shown = Image.open(io.BytesIO(answer.content))
        assert shown.size[0] / shown.size[1] == pytest.approx(1600 / 1300, rel=0.01)
    house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=REGION)
    house.work()
    (row,) = house.get(f"/v1/frames/{frames['nir']['id']}")["statistics"]
    assert (row["n"], row["channel"], row["saturated_share"]) == (90_000, "nir", 0.0)
    version = house.fit(campaign)
    assert version["configuration"]["sunshine_sensor"]["serial"] == CAMERA["serial"]
    for row in version["coefficients"]:
        (point,) = (each for each in version["points"] if each["band"] == row["band"])
        k = 0.5 / CENTRE[row["band"]] * point["i_ss"] / point["i_ss_oriented"]
        assert (row["unit"], row["value"]) == ("s", pytest.approx(k, rel=3e-4))
    body = {"frame_id": frames["nir"]["id"], "calibration_id": version["id"]}
    found = house.measure(**body)
    assert found["mean"]["value"] == pytest.approx(0.5, rel=1e-9)
    # this camera states light without a unit, and a signal without a scale
    assert found["reflected"]["i_ss_basis"] == "levelled"
    assert (found["place"]["height_source"], found["place"]["attitude_source"]) == ("take_off", "gimbal")
    for more, code in [
        ({"quantity": "radiance"}, "radiance_unknown"),
        ({"ground_altitude_m": 300}, "height_unusable"),
    ]:
        refused = house.http.post("/v1/measurements", json=body | more)
        assert (refused.status_code, refused.json()["code"]) == (422, code)
    mapped = house.measure(**body, products=["bands"], ground_altitude_m=143.26)
    place = mapped["place"]
    assert (place["form"], place["height_above_ground_m"]) == ("affine", pytest.approx(60.0))
    content = house.http.get(f"/v1/measurements/{mapped['id']}/map.tif").content
    with tifffile.TiffFile(io.BytesIO(content)) as file:
        keys = file.pages[0].geotiff_tags
        told = json.loads(file.pages[0].description)["place"]
    assert keys["GeographicTypeGeoKey"] == 4326
    matrix = keys["ModelTransformation"]
    assert [matrix[0][3], matrix[1][3]] == place["transform"][::3]
    assert told == place
    item = house.get(f"/v1/measurements/{mapped['id']}/stac.json")
    assert item["geometry"]["coordinates"][0][:0:-1] == place["corners"]
    a, b, c, d, e, f = place["transform"]
    shown = item["assets"]["map"]
    assert shown["proj:transform"] == [b, c, a, e, f, d]
    assert [(each["name"], each["center_wavelength"]) for each in shown["eo:bands"]] == [
        ("NIR", 0.84),
        ("Red", 0.65),
    ]
    # 11:01 at a place whose zone the file does not state
    interval = [item["properties"][f"{end}_datetime"] for end in ("start", "end")]
    assert interval == ["2020-06-04T21:01:00Z", "2020-06-05T23:01:00Z"]


def test_a_stated_zone_levels_the_light_of_a_p4(sqlite_house, campaign, frames):
    house, path = sqlite_house, f"/v1/campaigns/{campaign['id']}"
    house.http.put(f"{path}/roi", json=REGION)
    house.work()
    light = {}
    for zone in ("", "America/Chicago"):
        house.patch(path, {"time_zone": zone})
        version = house.fit(campaign)
        told = [each["code"] for each in version["findings"]]
        assert "tilt_not_correctable" not in told
        assert ("zone_unknown" in told) is not bool(zone)
        made = house.measure(frame_id=frames["nir"]["id"], calibration_id=version["id"])
        assert made["mean"]["value"] == pytest.approx(0.5, rel=1e-9)
        assert made["reflected"]["i_ss_basis"] == "levelled"
        light[zone] = made["reflected"]["i_ss"]
    assert light[""] == pytest.approx(light["America/Chicago"], rel=0.1)


def test_a_thermal_band_is_stored_and_left_out(sqlite_house):
    camera = sqlite_house.camera(make="MicaSense", model="Altum-PT", serial="A1")
    made = sqlite_house.post("/v1/campaigns", {"camera_id": camera["id"], "method": "reflectance"})
    content = make_tiff(write_micasense_xmp(band="LWIR", lens=False), make="MicaSense", model="Altum-PT")
    frame = read(sqlite_house, made, content, role="panel")
    assert (frame["state"], "frame_left_out" in frame["warnings"]) == ("read", True)
    (reason,) = frame["verdict"]["reasons"]
    assert (reason["code"], reason["detail"][:23]) == ("frame_left_out", "Band LWIR is thermal an")
    missing = sqlite_house.get(f"/v1/campaigns/{made['id']}")["missing"]
    assert not [each for each in missing if "region" in each]
    region = {"polygon": [[2, 2], [20, 2], [20, 20], [2, 20]]}
    sqlite_house.put(f"/v1/campaigns/{made['id']}/roi", region)
    sqlite_house.work()
    assert sqlite_house.get(f"/v1/frames/{frame['id']}")["state"] == "read"


@pytest.mark.parametrize(
    ("changes", "model", "said"),
    [
        ({"SensorModel": None}, "6X", "The camera Sentera 6X"),
        ({"SensorModel": "0,1,0"}, "Sequoia", "no positive"),
    ],
)
def test_what_cannot_be_used_is_refused_before_a_region_is_drawn(sqlite_house, changes, model, said):
    make = "Parrot" if model == "Sequoia" else "Sentera"
    camera = sqlite_house.camera(make=make, model=model, serial="S1")
    made = sqlite_house.post("/v1/campaigns", {"camera_id": camera["id"], "method": "reflectance"})
    frame = read(
        sqlite_house, made, make_tiff(write_sequoia_xmp(**changes), make=make, model=model), role="panel"
    )
    assert (frame["state"], frame["refusal"]["code"]) == ("refused", "sensor_model_unusable")
    assert said in frame["refusal"]["detail"]


def test_a_frame_that_an_older_reader_did_not_know_is_read_again(sqlite_house, frames):
    """Its stored metadata had no band: a region drawn now must not be refused for that."""
    with sqlite_house.database.writing("test") as session:
        row = session.get_one(FrameRow, frames["red"]["id"])
        row.header = row.header | {"multispectral": None}
    region = {"polygon": [[660, 510], [900, 510], [900, 700], [660, 700]]}
    sqlite_house.put(f"/v1/frames/{frames['red']['id']}/roi", region)
    sqlite_house.work()
    frame = sqlite_house.get(f"/v1/frames/{frames['red']['id']}")
    assert (frame["state"], frame["band"]) == ("extracted", "red")
    assert 240 * 190 in {row["n"] for row in frame["statistics"]}
