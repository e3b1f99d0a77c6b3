"""The grid of a campaign: columns, gaps, and frames that are moved, left out, withdrawn and restored."""

import re

import pytest

from tests.service.test_frames import patch, set_roi
from tests.support.campaigns import ROI

pytestmark = pytest.mark.either_database

SETTINGS = {"iso": 3200, "exposure_time_s": 0.05}


def grid(house, campaign, **query):
    answer = house.get(f"/v1/campaigns/{campaign['id']}/grid", **query)
    frames = answer["frames"]
    return [dict(zip(frames, values, strict=True)) for values in zip(*frames.values(), strict=True)], answer


def change(house, campaign, frames, **said):
    body = {"frame_ids": [frame["id"] for frame in frames], **said}
    return house.patch(f"/v1/campaigns/{campaign['id']}/frames", body)


@pytest.fixture
def campaign(house):
    """Two scenes at two apertures of which one is lacking, and no dark frame."""
    campaign = house.campaign()
    set_roi(house, campaign, ROI)
    for seed, (scene, f_number, signal) in enumerate([("a", 4.0, 900), ("a", 5.6, 450), ("b", 4.0, 300)]):
        content = house.frame_bytes(f_number=f_number, signal_dn=signal, seed=seed, **SETTINGS)
        house.upload(campaign, content, role="light", scene=scene, filename=f"{scene}-{f_number:g}.dng")
    house.work()
    return campaign


def test_grid_pages_columns_and_gaps_with_exposure(house, campaign):
    rows, answer = grid(house, campaign)
    assert [(row["filename"], row["scene"], row["iso"], row["f_number"]) for row in rows] == [
        ("a-4.dng", "a", 3200, 4.0),
        ("a-5.6.dng", "a", 3200, 5.6),
        ("b-4.dng", "b", 3200, 4.0),
    ]
    assert {(row["state"], row["code"]) for row in rows} == {("extracted", "reading_missing")}
    assert rows[0]["signal_dn"] > rows[1]["signal_dn"] > 0
    lacking, dark = answer["gaps"]
    assert (lacking["at"], lacking["role"]) == ({"scene": "b", "iso": 3200, "f_number": 5.6}, "light")
    # half the span at f/5.6, where 300 DN came in 0.05 s at f/4
    assert lacking["exposure_time_s"] > 0.1
    assert (dark["role"], dark["at"]["iso"], dark["exposure_time_s"]) == ("dark", 3200, 0.05)
    page = grid(house, campaign, limit=2)[1]
    assert len(page["frames"]["id"]) == 2
    rest = house.http.get(page["next"]).json()
    assert (rest["frames"]["id"], rest["next"]) == ([rows[2]["id"]], None)


def test_grid_is_not_sent_again_until_the_campaign_changes(house):
    campaign = house.campaign()
    house.upload(campaign, house.frame_bytes(), role="light", scene="a")
    path = f"/v1/campaigns/{campaign['id']}/grid"
    first = house.http.get(path)
    again = {"If-None-Match": first.headers["etag"]}
    assert house.http.get(path, headers=again).status_code == 304
    change(house, campaign, [{"id": first.json()["frames"]["id"][0]}], scene="c")
    assert house.http.get(path, headers=again).json()["frames"]["scene"][0] == "c"


def test_what_has_changed_in_the_grid_is_asked_for_alone(house, campaign):
    held = {row["id"]: row for row in grid(house, campaign)[0]}
    since = grid(house, campaign)[1]["since"]

    def look():
        """Read what has changed, and hold it to the whole grid; return the names of what was read."""
        nonlocal since
        rows, answer = grid(house, campaign, since=since)
        if not answer["partial"]:
            held.clear()
        held.update((row["id"], row) for row in rows)
        whole, complete = grid(house, campaign)
        assert list(held.values()) == whole
        assert answer["gaps"] == complete["gaps"]
        since = answer["since"]
        return {row["filename"] for row in rows}, answer["partial"]

    assert look() == (set(), True)
    first, second, third = held.values()
    change(house, campaign, [third], left_out=True, reason="a bird")
    assert look() == ({"b-4.dng"}, True)
    said = {"scene": "a", "quantity": "luminance", "value": 54.4, "unit": "cd/m2"}
    reading = house.post(f"/v1/campaigns/{campaign['id']}/readings", said)
    assert look() == ({"a-4.dng", "a-5.6.dng", "b-4.dng"}, True)
    house.http.delete(f"/v1/readings/{reading['id']}")
    assert look() == ({"a-4.dng", "a-5.6.dng", "b-4.dng"}, True)
    change(house, campaign, [first], withdrawn=True)
    change(house, campaign, [second], scene="c")
    assert look() == ({"a-4.dng", "a-5.6.dng"}, True)
    house.http.put(f"/v1/frames/{second['id']}/roi", json={"polygon": [[8, 8], [60, 8], [60, 50], [8, 50]]})
    look()
    house.work()
    assert look() == ({"a-5.6.dng"}, True)
    # a region of the campaign is that of all its frames
    set_roi(house, campaign, {"polygon": [[8, 8], [50, 8], [50, 40]]})
    assert look()[1] is False
    house.work()
    assert look() == ({"b-4.dng"}, True)
    for never in ("0-0", "999999-x", "x"):
        assert grid(house, campaign, since=never)[1]["partial"] is False


def test_frames_are_moved_left_out_withdrawn_and_restored(house, campaign):
    rows, _ = grid(house, campaign)
    assert change(house, campaign, rows[:2], scene="c") == {"frames": 2, "read_again": 0}
    assert change(house, campaign, rows[:1], left_out=True, reason="a bird") == {"frames": 1, "read_again": 0}
    assert change(house, campaign, rows[2:], withdrawn=True)["read_again"] == 0
    after, _ = grid(house, campaign)
    assert [(row["scene"], row["left_out"], row["withdrawn"]) for row in after] == [
        ("c", "a bird", False),
        ("c", None, False),
        ("b", None, True),
    ]
    path = f"/v1/campaigns/{campaign['id']}"
    assert house.get(path)["frames"]["received"] == 2
    assert [len(house.get(f"{path}/frames", withdrawn=each)["items"]) for each in (True, False)] == [1, 2]
    # the same file sent again is the frame again
    content = house.frame_bytes(f_number=4.0, signal_dn=300, seed=2, **SETTINGS)
    assert house.upload(campaign, content, status=200, role="light")["id"] == rows[2]["id"]
    change(house, campaign, rows[2:], withdrawn=True)
    assert change(house, campaign, rows[2:], withdrawn=False)["read_again"] == 1
    house.work()
    restored = grid(house, campaign)[0][2]
    assert (restored["state"], restored["withdrawn"]) == ("extracted", False)
    assert patch(house, rows[0], left_out=False, scene="")["state"] == "extracted"
    assert (grid(house, campaign)[0][0]["left_out"], grid(house, campaign)[0][0]["scene"]) == (None, None)


def test_frames_that_are_not_as_the_request_says_are_not_changed(house, campaign):
    rows, _ = grid(house, campaign)
    change(house, campaign, rows[:1], expected={"scene": "a", "withdrawn": False}, scene="b")
    stale = {"scene": "a", "role": "light", "left_out": False, "withdrawn": False}
    body = {"frame_ids": [row["id"] for row in rows[:2]], "expected": stale, "withdrawn": True}
    answer = house.patch(f"/v1/campaigns/{campaign['id']}/frames", body, status=409)
    assert answer["code"] == "changed_meanwhile"
    assert re.search(r"^a-4\.dng was changed by .+ meanwhile: its scene is b\.", answer["detail"])
    assert not any(row["withdrawn"] for row in grid(house, campaign)[0])
    # and a frame of another campaign is refused
    other = house.campaign()
    body = {"frame_ids": [rows[0]["id"]], "scene": "x"}
    assert house.patch(f"/v1/campaigns/{other['id']}/frames", body, status=422)["code"] == "validation_failed"


def test_a_withdrawn_reading_is_restored(house):
    campaign = house.campaign()
    said = {"scene": "a", "quantity": "luminance", "value": 54.4, "unit": "cd/m2"}
    reading = house.post(f"/v1/campaigns/{campaign['id']}/readings", said)
    path = f"/v1/readings/{reading['id']}"
    assert "withdrawn_at" in house.http.delete(path).json()
    assert "withdrawn_at" not in house.http.post(f"{path}/restore").json()
    assert house.get(f"/v1/campaigns/{campaign['id']}")["readings"] == 1


def test_a_campaign_takes_another_camera_without_sending_again(house):
    wrong = house.camera(serial="another")
    campaign = house.campaign(camera_id=wrong["id"], place="attic")
    frame = house.upload(campaign, house.frame_bytes(), role="dark")
    house.work()
    assert house.get(f"/v1/frames/{frame['id']}")["refusal"]["code"] == "wrong_camera"
    assert house.get(f"/v1/campaigns/{campaign['id']}")["frames"]["refused"] == 1
    path = f"/v1/campaigns/{campaign['id']}"
    said = house.http.patch(
        path, json={"camera_id": house.camera()["id"], "place": "", "archived": True}
    ).json()
    assert ("place" in said, "archived_at" in said) == (False, True)
    house.work()
    assert house.get(f"/v1/frames/{frame['id']}")["state"] == "read"
    assert [len(house.get("/v1/campaigns", archived=each)["items"]) for each in (True, False)] == [1, 0]


def test_a_camera_is_renamed_and_its_frames_are_checked_again(house):
    camera = house.camera(serial="mistyped")
    campaign = house.post("/v1/campaigns", {"camera_id": camera["id"], "method": "luminance"})
    frame = house.upload(campaign, house.frame_bytes(), role="dark")
    house.work()
    path = f"/v1/cameras/{camera['id']}"
    lens = {"make": "DJI", "model": "MFT 15 mm"}
    changed = house.http.patch(path, json={"serial": "0K1XE8", "lens": lens, "pixel_pitch_um": 3.4}).json()
    assert (changed["lens"], changed["pixel_pitch_um"]) == (lens, 3.4)
    house.work()
    assert house.get(f"/v1/frames/{frame['id']}")["state"] == "read"
    other = house.camera(serial="other")
    refused = house.http.patch(f"/v1/cameras/{other['id']}", json={"serial": "0K1XE8"})
    assert (refused.status_code, refused.json()["errors"][0]["field"]) == (422, "body.serial")
