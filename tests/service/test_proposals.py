"""The proposal for a card: method, role and scene of each frame."""

import pytest

from radiometry.methods import get_method
from tests.support.frames import write_frame

pytestmark = pytest.mark.either_database


def test_proposal_over_http(house, stranger):
    camera = house.post("/v1/cameras", {"make": "DJI", "model": "FC6520", "serial": "0K1XE8"})
    campaign = house.post("/v1/campaigns", {"camera_id": camera["id"], "method": "luminance"})
    rows = [
        {
            "name": f"DJI_{n}.DNG",
            "taken_s": 1e9 + 200 * (n // 3) + n,
            "exposure_time_s": 0.01,
            "signal_share": 0.2,
        }
        for n in range(6)
    ]
    asked = {"frames": rows, "camera_id": camera["id"], "campaign_id": campaign["id"]}
    found = house.post("/v1/proposals", asked, status=200)
    assert (found["method"], found["kind"]) == ("luminance", "calibration")
    assert [each["scene"] for each in found["frames"]] == ["Scene 1"] * 3 + ["Scene 2"] * 3
    for other in ("camera_id", "campaign_id"):
        answer = stranger.post("/v1/proposals", json={"frames": rows, other: asked[other]})
        assert answer.status_code == 404
    refused = house.post("/v1/proposals", {"frames": [{"name": "a.DNG", "f_number": 0}]}, status=422)
    assert "f_number" in refused["detail"]
    assert get_method(found["calibration_method"]).name == "luminance"


def test_a_card_that_is_there_already_names_its_campaign(house):
    """By name, size and time, of its camera alone."""
    path = write_frame(house.folder / "DJI_1.DNG")
    camera = house.post("/v1/cameras", {"make": "DJI", "model": "FC6520", "serial": "0K1XE8"})["id"]
    campaign = house.post("/v1/campaigns", {"camera_id": camera, "method": "luminance"})
    held = house.upload(campaign, path.read_bytes(), filename=path.name, role="light", scene="dusk")
    house.work()
    row = {"name": f"DCIM/{path.name}", "size_bytes": path.stat().st_size, "taken_s": 1777665600.25}
    others = [row | {"size_bytes": 1}, row | {"taken_s": 0}, row | {"name": "DJI_2.DNG"}, {"name": "a"}]
    asked = {"frames": [row, *others, row | {"taken_s": 1e300}], "camera_id": camera}
    found = house.post("/v1/proposals", asked, status=200)["frames"]
    assert [each.get("campaign_id") for each in found] == [campaign["id"], *[None] * 5]
    found = house.post("/v1/proposals", {"frames": [row]}, status=200)["frames"]
    assert "campaign_id" not in found[0]
    house.patch(f"/v1/frames/{held['id']}", {"withdrawn": True})
    assert "campaign_id" not in house.post("/v1/proposals", asked, status=200)["frames"][0]
