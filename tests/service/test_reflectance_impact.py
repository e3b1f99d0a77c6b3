"""What another version of a reflectance would change."""

import math

import pytest

from tests.support.campaigns import calibrate
from tests.support.data import data_file
from tests.support.every_method import (
    BANDS,
    PANEL_REFLECTANCE,
    PANEL_U,
    reflectance_campaign,
    register_panel,
)

AT = "2018-04-13T00:00:00Z"
GREEN = "IMG_180413_080658_0000_GRE.TIF"


def impact(house, version):
    return house.get(f"/v1/calibrations/{version['id']}/impact", at="2018-04-13T08:00:00Z")


def measure(house, campaign, version, **more):
    frame = next(
        frame
        for frame in house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"]
        if frame["filename"] == GREEN
    )
    return house.measure(frame_id=frame["id"], calibration_id=version["id"], **more)


@pytest.fixture(scope="module")
def versions(sqlite_house):
    """Three of one campaign: by one panel, by the same with another angle, and by a panel 10 % brighter."""
    house = sqlite_house
    panel = register_panel(house)
    brighter = register_panel(house, serial="P-20", reflectance=1.1 * PANEL_REFLECTANCE)
    campaign = reflectance_campaign(house)
    first = calibrate(house, campaign, panel_id=panel["id"])
    tilted = calibrate(house, campaign, panel_id=panel["id"], incidence_angle_deg=30)
    other = calibrate(house, campaign, panel_id=brighter["id"])
    house.publish(first, valid_from=AT)
    return campaign, first, tilted, other


def test_k_changes_by_band_and_one_panel_cancels(sqlite_house, versions):
    _, first, tilted, _ = versions
    answer = impact(sqlite_house, tilted)
    assert answer["meter_calibration"] == "common"
    assert {row["band"] for row in answer["coefficients"]} == BANDS.keys()
    for row in answer["coefficients"]:
        assert row["change"]["value"] == pytest.approx(100 * (math.cos(math.radians(30)) - 1), rel=1e-9)
        ratio = row["new"]["value"] / row["old"]["value"]
        m = PANEL_U / PANEL_REFLECTANCE
        shares = [each["standard_uncertainty"] / each["value"] for each in (row["old"], row["new"])]
        expected = 100 * ratio * math.sqrt(sum(share**2 for share in shares) - 2 * m**2)
        assert row["change"]["standard_uncertainty"] == pytest.approx(expected, rel=1e-9)
    assert first["coefficients"][0]["name"] == "reflectance_k"


def test_another_panel_counts_in_both(sqlite_house, versions):
    answer = impact(sqlite_house, versions[3])
    assert answer["meter_calibration"] == "separate"
    for row in answer["coefficients"]:
        assert row["change"]["value"] == pytest.approx(10.0, rel=1e-9)
        shares = [each["standard_uncertainty"] / each["value"] for each in (row["old"], row["new"])]
        assert row["change"]["standard_uncertainty"] == pytest.approx(110 * math.hypot(*shares), rel=1e-9)


def test_a_measured_reflectance_changes_as_it_would_measured_anew(sqlite_house, versions):
    campaign, first, tilted, other = versions
    made = measure(sqlite_house, campaign, first)
    for version in (tilted, other):
        again = measure(sqlite_house, campaign, version)
        (touched,) = impact(sqlite_house, version)["measurements"]
        assert touched["measurement_id"] == made["id"]
        assert touched["basis"] == "signal"
        expected = 100 * (again["mean"]["value"] / made["mean"]["value"] - 1)
        assert touched["change"]["value"] == pytest.approx(expected, rel=1e-9)
        k = next(row for row in impact(sqlite_house, version)["coefficients"] if row["band"] == "green")
        # of the ratio: that of K has the angle's cosine in it, which the measurement takes out again
        shares = [
            change["standard_uncertainty"] / (100 + change["value"])
            for change in (touched["change"], k["change"])
        ]
        assert shares[0] == pytest.approx(shares[1], rel=1e-9)
        assert "why" not in touched


def test_a_band_that_the_other_version_lacks_is_said(sqlite_house, versions):
    campaign, first, *_ = versions
    measure(sqlite_house, campaign, first)
    alone = sqlite_house.post("/v1/campaigns", {"camera_id": campaign["camera_id"], "method": "reflectance"})
    region = {"polygon": [[600, 440], [680, 440], [680, 520], [600, 520]]}
    sqlite_house.http.put(f"/v1/campaigns/{alone['id']}/roi", json=region)
    red = GREEN.replace("GRE", "RED")
    sqlite_house.upload(alone, data_file(f"sequoia/{red}").read_bytes(), role="panel", filename=red)
    version = calibrate(sqlite_house, alone, panel_id=register_panel(sqlite_house)["id"])
    (touched,) = impact(sqlite_house, version)["measurements"]
    assert "change" not in touched
    assert touched["why"].startswith("The frame shows band green; this calibration holds red.")
