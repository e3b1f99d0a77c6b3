"""A real Sequoia capture of four bands, over HTTP: what its files say, its fit, its coefficients."""

import math

import numpy as np
import pytest

from store.tables import FrameRow
from tests.support.data import data_file
from tests.support.measuring import read_map

pytestmark = pytest.mark.either_database

NAMES = {
    "green": "IMG_180413_080658_0000_GRE.TIF",
    "red": "IMG_180413_080658_0000_RED.TIF",
    "red_edge": "IMG_180413_080658_0000_REG.TIF",
    "nir": "IMG_180413_080658_0000_NIR.TIF",
}
I_SQ = {"green": 0.531310, "red": 0.231775, "red_edge": 0.259554, "nir": 0.224353}
CAMERA = {"make": "Parrot", "model": "Sequoia", "serial": "PI040378AA6C000181"}
CENTRE = {"polygon": [[600, 440], [680, 440], [680, 520], [600, 520]]}
PANEL = {
    "serial": "P-18",
    "measured_on": "2018-03-01",
    "bands": [{"band": band, "reflectance": 0.18, "standard_uncertainty": 0.002} for band in NAMES],
}


def read_contents(bands=tuple(NAMES)):
    return {band: data_file(f"sequoia/{NAMES[band]}").read_bytes() for band in bands}


@pytest.fixture
def contents():
    return read_contents()


def begin(house, bands=tuple(NAMES), *, panel=True, **more):
    camera = house.camera(**CAMERA)
    if panel:
        house.post("/v1/panels", PANEL)
    campaign = house.post("/v1/campaigns", {"camera_id": camera["id"], "method": "reflectance", **more})
    house.put(f"/v1/campaigns/{campaign['id']}/roi", CENTRE)
    for band, content in read_contents(bands).items():
        house.upload(campaign, content, role="panel", filename=NAMES[band])
    house.work()
    return campaign


def frames_of(house, campaign):
    return {frame["band"]: frame for frame in house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"]}


def begin_and_fit(house, bands=tuple(NAMES)):
    campaign = begin(house, bands)
    return campaign, house.fit(campaign)


def test_a_capture_becomes_one_k_a_band(house, staged):
    campaign, version = staged(begin_and_fit)
    frames = frames_of(house, campaign)
    assert frames.keys() == NAMES.keys()
    assert len({frame["capture_id"] for frame in frames.values()}) == 1
    for band, frame in frames.items():
        assert frame["state"] == "extracted"
        (row,) = frame["statistics"]
        assert row["channel"] == band
        assert row["i_sq"] == pytest.approx(I_SQ[band], rel=2e-6)
        assert frame["sunshine"]["readings"] == 10
        assert "exposure_not_manual" not in frame["warnings"]
    assert frames["green"]["statistics"][0]["mean_dn"] == pytest.approx(24125.28, abs=0.005)

    assert version["configuration"]["sunshine_sensor"]["serial"] == frames["green"]["sunshine"]["serial"]
    ks = {row["band"]: row for row in version["coefficients"]}
    assert [row["band"] for row in version["coefficients"]] == ["green", "red", "red_edge", "nir"]
    for band, row in ks.items():
        i_ss = frames[band]["sunshine"]["i_ss"]
        assert row["name"] == "reflectance_k"
        assert row["value"] == pytest.approx(0.18 * i_ss / I_SQ[band], rel=1e-5)
        # the panel alone is 0.002 of 0.18
        assert row["standard_uncertainty"] > row["value"] * 0.002 / 0.18
        assert math.isfinite(row["standard_uncertainty"])
    assert version["inputs"]["panels"][0]["serial"] == "P-18"
    assert {point["band"] for point in version["points"]} == NAMES.keys()
    assert all("frame_id" in point for point in version["points"])

    house.publish(version, valid_from="2018-04-13T00:00:00Z", valid_to="2018-04-14T00:00:00Z")
    path = f"/v1/cameras/{campaign['camera_id']}/coefficients"
    found = house.get(path, method="reflectance", band="NIR", at="2018-04-13T08:00:00Z")["items"]
    assert [(row["band"], row["value"]) for row in found] == [("nir", ks["nir"]["value"])]


@pytest.mark.both_databases
def test_the_panel_that_a_version_used_keeps_its_figures(house, staged):
    staged(begin_and_fit)
    other = PANEL | {"bands": [{"band": "green", "reflectance": 0.5}]}
    assert house.post("/v1/panels", other, status=409)["code"] == "panel_differs"
    house.post("/v1/panels", PANEL, status=200)


def test_what_is_missing_is_said_by_name(house):
    campaign = begin(house, ["green"], panel=False)
    answer = house.get(f"/v1/campaigns/{campaign['id']}")
    (said,) = answer["missing"]
    assert said.startswith("the panel's reflectance is not known (band green): register the panel")
    (frame,) = frames_of(house, campaign).values()
    # what lies in the middle of this field is no panel, and looks it
    assert [reason["code"] for reason in frame["verdict"]["reasons"]] == ["panel_uneven", "panel_unknown"]
    house.post("/v1/panels", PANEL)
    answer = house.get(f"/v1/campaigns/{campaign['id']}")
    assert answer["missing"] == []
    assert any("once" in advice for advice in answer["advice"])


def test_of_two_panels_one_must_be_named(house, staged):
    campaign = staged(begin, bands=("green",))
    brighter = PANEL | {"serial": "P-50", "bands": [{"band": "green", "reflectance": 0.5}]}
    named = house.post("/v1/panels", brighter)
    assert "name it (panel_id)" in house.get(f"/v1/campaigns/{campaign['id']}")["missing"][0]
    version = house.fit(campaign, panel_id=named["id"])
    assert version["inputs"]["panels"][0]["serial"] == "P-50"
    assert house.get(f"/v1/campaigns/{campaign['id']}")["panel_id"] == named["id"]


def test_without_the_sunshine_sensor_k_holds_for_one_light(house, staged):
    campaign = staged(begin, bands=("green",))
    version = house.fit(campaign, normalisation="panel_only")
    (row,) = version["coefficients"]
    assert row["value"] == pytest.approx(0.18 / I_SQ["green"], rel=1e-5)
    assert row["model"] == "panel_only"
    assert "panel_only" in row["flags"]
    assert "sunshine_sensor" not in version["configuration"]


def test_the_panel_measures_itself_and_the_map_agrees(house, staged):
    campaign, version = staged(begin_and_fit)
    frame = frames_of(house, campaign)["green"]
    found = house.measure(frame_id=frame["id"], calibration_id=version["id"], products=["map"])
    assert found["method"] == "reflectance"
    assert found["mean"]["value"] == pytest.approx(0.18, rel=1e-6)
    assert found["mean"]["unit"] == "1"
    assert found["reflected"]["i_sq"] == pytest.approx(I_SQ["green"], rel=2e-6)
    assert found["min"]["value"] < found["median"]["value"] < found["max"]["value"]
    assert sum(row["variance_share"] for row in found["budget"]) == pytest.approx(1.0)
    assert "shared_u_cd_m2" not in found

    plane, said, _ = read_map(house, found)
    assert (plane.dtype, plane.shape) == (np.float32, (960, 1280))
    assert float(plane[440:520, 600:680].mean(dtype=float)) == pytest.approx(0.18, rel=1e-5)
    counts = {
        "pixels": plane.size,
        "below_zero": int((plane < 0).sum()),
        "above_one": int((plane > 1).sum()),
        "saturated": int(np.isnan(plane).sum()),
    }
    assert found["map"] == counts
    assert (said["quantity"], said["unit"], said["band"], said["wavelength_nm"]) == (
        "reflectance",
        "1",
        "Green",
        550.0,
    )
    tilted = house.measure(frame_id=frame["id"], calibration_id=version["id"], incidence_angle_deg=60)
    assert tilted["mean"]["value"] == pytest.approx(0.36, rel=1e-6)
    # by one K, whose error is in both
    compared = house.get(f"/v1/measurements/{tilted['id']}/comparison", old=found["id"])
    assert (compared["common"], compared["change"]["value"]) == (["K"], pytest.approx(100.0, rel=1e-6))


def flight_of(house, campaign, contents):
    """The same capture as a flight of its own."""
    said = {"camera_id": campaign["camera_id"], "method": "reflectance", "comments": "flight"}
    flight = house.post("/v1/campaigns", said)
    for band, content in contents.items():
        house.upload(flight, content, role="field", filename=NAMES[band])
    house.work()
    return flight["id"]


def test_an_index_of_a_capture_is_that_of_its_maps(house, staged, contents):
    campaign, version = staged(begin_and_fit)
    frames = frames_of(house, campaign)
    once = house.post(
        f"/v1/campaigns/{flight_of(house, campaign, contents)}/measurements",
        {"calibration_id": version["id"], "index": "ndvi"},
        status=202,
    )
    assert (len(once["jobs"]), once["not_measured"]) == (1, [])
    with house.database.writing("test") as session:
        row = session.get_one(FrameRow, frames["nir"]["id"])
        row.header = {**row.header, "attitude": [{"name": "camera:Yaw", "value": -63.8}]}
    frame = frames["red"]
    found = house.measure(frame_id=frame["id"], calibration_id=version["id"], index="ndvi", products=["map"])
    assert found["index"]["name"] == "ndvi"
    assert [band["band"] for band in found["index"]["bands"]] == ["nir", "red"]
    a, b = (band["reflectance"] for band in found["index"]["bands"])
    total = a["value"] + b["value"]
    assert a["value"] == pytest.approx(0.18, rel=1e-6)
    assert found["mean"]["value"] == pytest.approx((a["value"] - b["value"]) / total, rel=1e-9)
    u = math.hypot(*(share["standard_uncertainty"] for share in found["budget"]))
    assert found["mean"]["standard_uncertainty"] == pytest.approx(u, rel=1e-9)
    # a sill half a metre away: the edges of the bands agree on no displacement
    assert "alignment_not_refined" in [flag["flag"] for flag in found["flags"]]
    assert [(each["by"], each["residual_px"]) for each in found["alignment"]] == [("lens_data", 5.0)]
    plane, said, tags = read_map(house, found)
    assert said["quantity"] == "ndvi"
    assert b' Camera:Yaw="-63.8"' in tags["XMP"]
    assert b"BandName" not in tags["XMP"]  # it shows two
    assert plane.shape == (960, 1280)
    assert found["map"] == {"pixels": plane.size, "undefined": int(np.isnan(plane).sum())}
    assert np.isfinite(plane).sum() > 0.9 * plane.size
    # the region's red is what the map compares with there, not the same pixels of a band that looks aside
    alone = house.measure(frame_id=frames["nir"]["id"], calibration_id=version["id"], products=["map"])
    nir, *_ = read_map(house, alone)
    centre = np.s_[440:520, 600:680]
    red = nir[centre] * (1 - plane[centre]) / (1 + plane[centre])
    assert b["value"] == pytest.approx(float(red.mean(dtype=float)), rel=2e-3)
    assert abs(b["value"] - 0.18) > 0.02
    # nothing is clipped: where one band's noise falls below zero the index leaves [-1, 1]
    assert np.mean(np.abs(plane[np.isfinite(plane)]) <= 1.0) > 0.99


def test_a_flight_is_one_request_and_each_frame_that_fails_is_named(house, contents):
    campaign = begin(house, ["green", "red"])
    fit_of_green = house.fit(campaign, exclude=[])
    plot = f"/v1/calibrations/{fit_of_green['id']}/plot.svg"
    before = house.http.get(plot)
    flight_id = flight_of(house, campaign, {band: contents[band] for band in ("green", "nir")})
    body = {"calibration_id": fit_of_green["id"]}
    answer = house.post(f"/v1/campaigns/{flight_id}/measurements", body, status=202)
    assert len(answer["jobs"]) == 1
    assert [(each["filename"], each["code"]) for each in answer["not_measured"]] == [
        (NAMES["nir"], "band_not_calibrated")
    ]
    house.work()
    (row,) = house.get("/v1/measurements", campaign_id=flight_id)["items"]
    assert row["region_origin"] == "whole_frame"
    assert row["pixels"] == 960 * 1280
    lines = house.http.get(f"/v1/series/measurements?campaign_id={flight_id}&format=csv").text.splitlines()
    columns = dict(zip(lines[0].split(","), lines[1].split(","), strict=True))
    assert float(columns["mean_reflectance"]) == pytest.approx(row["mean"]["value"])
    for name in ("effective_dof", "coverage_factor", "expanded_uncertainty"):
        assert float(columns[name]) == row[name]
    assert [line["source"] for line in row["budget"] if line["source"] == "drift"] == ["drift"]
    # its time is now on the version's plot, which a browser must ask for again, and on the certificate
    after = house.http.get(plot, headers={"If-None-Match": before.headers["ETag"]})
    assert after.status_code == 200
    assert ["frames of the flight" in each.text for each in (before, after)] == [False, True]
    assert house.http.get(plot, headers={"If-None-Match": after.headers["ETag"]}).status_code == 304
    certificate = house.get(f"/v1/calibrations/{fit_of_green['id']}/certificate.json")
    assert [at[:19] for at in certificate["flight"]] == ["2018-04-13T08:06:58"]


def test_an_index_of_a_flight_names_what_has_not_been_read(house, staged, contents):
    campaign, version = staged(begin_and_fit)
    body = {"calibration_id": version["id"], "index": "ndvi"}
    cut = contents | {"red": contents["red"][:-9000]}
    flight_id = flight_of(house, campaign, {band: cut[band] for band in ("nir", "red")})
    late = house.upload({"id": flight_id}, contents["green"], role="field", filename="late.TIF")
    answer = house.post(f"/v1/campaigns/{flight_id}/measurements", body, status=202)
    assert answer["jobs"] == []
    assert [(each["filename"], each["code"]) for each in answer["not_measured"]] == [
        (NAMES["nir"], "capture_incomplete"),
        (NAMES["red"], "frame_not_read"),
        ("late.TIF", "frame_not_read"),
    ]
    problem = house.post("/v1/measurements", body | {"frame_id": late["id"]}, status=422)
    assert problem["code"] == "frame_not_read"


def test_what_cannot_be_measured_is_said_before_the_job(house, staged):
    campaign, version = staged(begin_and_fit, bands=("green",))
    (frame,) = frames_of(house, campaign).values()
    named = {"frame_id": frame["id"], "calibration_id": version["id"]}
    for body, code in (
        ({"reflectance": 0.5}, "option_not_of_method"),
        ({"index": "ndvi"}, "capture_incomplete"),
    ):
        assert house.post("/v1/measurements", named | body, status=422)["code"] == code
