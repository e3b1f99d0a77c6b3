"""The checklist over HTTP."""

import pytest

from tests.support.campaigns import calibrated_campaign

pytestmark = pytest.mark.either_database


def patch(house, campaign, body, **expected):
    return house.patch(f"/v1/campaigns/{campaign['id']}/checklist", body, **expected)


def items_of(answer):
    return {item["key"]: item for item in answer["items"]}


def test_the_service_ticks_people_tick_and_one_signs(house, staged):
    campaign = {"id": staged(calibrated_campaign, isos=(3200,))["campaign_id"]}
    path = f"/v1/campaigns/{campaign['id']}/checklist"
    before = house.get(path)
    assert (before["done"], before["open"], len(before["items"])) == (22, 26, 48)
    ticks = [{"key": "equipment_lamp", "done": True, "note": "40 W halogen"}]
    answer = patch(house, campaign, {"items": ticks, "signature": {"name": "A. Meier"}})
    assert answer == house.get(path)
    lamp = items_of(answer)["equipment_lamp"]
    assert lamp["note"] == "40 W halogen"
    assert lamp["done_by"].startswith("key_")
    assert answer["done"] == 23
    signature = answer["signature"]
    assert (signature["name"], signature["changed"]) == ("A. Meier", False)
    assert len(signature["state_sha256"]) == 64
    readings = f"/v1/campaigns/{campaign['id']}/readings"
    house.http.delete(f"/v1/readings/{house.get(readings)['items'][0]['id']}")
    assert house.get(path)["signature"] == signature | {"changed": True}


def test_a_step_that_the_record_shows_undone_is_not_ticked(house):
    campaign = house.campaign()
    path = f"/v1/campaigns/{campaign['id']}"
    open_steps = [each for each in house.get(f"{path}/checklist")["items"] if "missing" in each]
    ticks = [{"key": open_steps[0]["key"], "done": True}]
    refused = patch(house, campaign, {"items": ticks}, status=409)
    assert refused["code"] == "step_not_done"
    assert open_steps[0]["missing"] in refused["detail"]


def test_a_signed_list_changes_only_with_a_new_signature(house):
    campaign = house.campaign()
    patch(house, campaign, {"signature": {"name": "A. Meier"}})
    ticks = {"items": [{"key": "equipment_lamp", "done": True}]}
    refused = patch(house, campaign, ticks, status=409)
    assert refused["code"] == "checklist_signed"
    assert "A. Meier" in refused["detail"]
    again = patch(house, campaign, ticks | {"signature": {"name": "B. Schulz"}})
    assert items_of(again)["equipment_lamp"]["done_by"]
    assert again["signature"]["name"] == "B. Schulz"


def test_what_is_wrong_is_named_and_nothing_is_ticked(house):
    campaign, lamp = house.campaign(), {"key": "equipment_lamp", "done": True}
    for body, field, said in (
        ({"items": [lamp, {"key": "lamp", "done": True}]}, "body.items.1.key", "'lamp'"),
        ({"items": [lamp | {"done": "yes"}]}, "body.items.0.done", "true or false"),
        ({}, "body", "items, a signature"),
    ):
        (error,) = patch(house, campaign, body, status=422)["errors"]
        assert error["field"] == field
        assert said in error["message"]
    assert house.get(f"/v1/campaigns/{campaign['id']}/checklist")["done"] == 0
