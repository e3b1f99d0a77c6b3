"""A real Sequoia capture of four bands, over HTTP: what its files say, its fit, its coefficients."""

import math

import pytest

from tests.support.data import data_file

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


@pytest.fixture
def contents():
    return {band: data_file(f"sequoia/{name}").read_bytes() for band, name in NAMES.items()}


def begin(house, contents, *, panel=True, **more):
    camera = house.camera(**CAMERA)
    if panel:
        house.post("/v1/panels", PANEL)
    campaign = house.post("/v1/campaigns", {"camera_id": camera["id"], "method": "reflectance", **more})
    house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=CENTRE)
    for band, content in contents.items():
        house.upload(campaign, content, role="panel", filename=NAMES[band])
    house.work()
    return campaign


def frames_of(house, campaign):
    return {frame["band"]: frame for frame in house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"]}


def fit(house, campaign, **params):
    job = house.post(f"/v1/campaigns/{campaign['id']}/calibrations", params, status=202)
    house.work()
    job = house.get(f"/v1/jobs/{job['id']}")
    assert job["state"] == "succeeded", job
    return house.get(f"/v1/calibrations/{job['result']['calibration_id']}")


def test_a_capture_becomes_one_k_a_band(house, contents):
    campaign = begin(house, contents)
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

    version = fit(house, campaign)
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

    at = {"valid_from": "2018-04-13T00:00:00Z", "valid_to": "2018-04-14T00:00:00Z", "reason": "flight 1"}
    house.post(f"/v1/calibrations/{version['id']}/publish", at, status=200)
    path = f"/v1/cameras/{campaign['camera_id']}/coefficients"
    found = house.get(path, method="reflectance", band="nir", at="2018-04-13T08:00:00Z")["items"]
    assert [(row["band"], row["value"]) for row in found] == [("nir", ks["nir"]["value"])]


def test_what_is_missing_is_said_by_name(house, contents):
    campaign = begin(house, {"green": contents["green"]}, panel=False)
    answer = house.get(f"/v1/campaigns/{campaign['id']}")
    assert answer["missing"] == ["the panel has no reflectance for band green"]
    (frame,) = frames_of(house, campaign).values()
    # what lies in the middle of this field is no panel, and looks it
    assert [reason["code"] for reason in frame["verdict"]["reasons"]] == ["panel_uneven", "panel_unknown"]
    house.post("/v1/panels", PANEL)
    answer = house.get(f"/v1/campaigns/{campaign['id']}")
    assert answer["missing"] == []
    assert any("once" in advice for advice in answer["advice"])


def test_of_two_panels_one_must_be_named(house, contents):
    campaign = begin(house, {"green": contents["green"]})
    brighter = PANEL | {"serial": "P-50", "bands": [{"band": "green", "reflectance": 0.5}]}
    named = house.post("/v1/panels", brighter)
    assert "no reflectance" in house.get(f"/v1/campaigns/{campaign['id']}")["missing"][0]
    version = fit(house, campaign, panel_id=named["id"])
    assert version["inputs"]["panels"][0]["serial"] == "P-50"
    assert house.get(f"/v1/campaigns/{campaign['id']}")["panel_id"] == named["id"]


def test_parameters_of_another_method_are_refused_by_name(house, contents):
    campaign = begin(house, {"green": contents["green"]})
    path = f"/v1/campaigns/{campaign['id']}/calibrations"
    problem = house.post(path, {"model": "affine", "tolerance": 0.1}, status=422)
    assert {error["field"] for error in problem["errors"]} == {"body.model", "body.tolerance"}


def test_without_the_sunshine_sensor_k_holds_for_one_light(house, contents):
    campaign = begin(house, {"green": contents["green"]})
    version = fit(house, campaign, normalisation="panel_only")
    (row,) = version["coefficients"]
    assert row["value"] == pytest.approx(0.18 / I_SQ["green"], rel=1e-5)
    assert row["model"] == "panel_only"
    assert "panel_only" in row["flags"]
    assert "sunshine_sensor" not in version["configuration"]
