"""The checklist over HTTP."""

import pytest

from tests.support.campaigns import calibrated_campaign

pytestmark = pytest.mark.either_database


def patch(client, campaign, body):
    return client.patch(f"/v1/campaigns/{campaign['id']}/checklist", json=body)


def items_of(answer):
    return {item["key"]: item for item in answer["items"]}


def test_the_service_ticks_people_tick_and_one_signs(house, staged):
    campaign = {"id": staged(calibrated_campaign)["campaign_id"]}
    path = f"/v1/campaigns/{campaign['id']}/checklist"
    before = house.get(path)
    assert (before["done"], before["open"], len(before["items"])) == (22, 26, 48)
    ticks = [{"key": "equipment_lamp", "done": True, "note": "40 W halogen"}]
    answer = patch(house.http, campaign, {"items": ticks, "signature": {"name": "A. Meier"}})
    assert answer.status_code == 200
    assert answer.json() == house.get(path)
    lamp = items_of(answer.json())["equipment_lamp"]
    assert lamp["note"] == "40 W halogen"
    assert lamp["done_by"].startswith("key_")
    assert answer.json()["done"] == 23
    signature = answer.json()["signature"]
    assert (signature["name"], signature["changed"], len(signature["state_sha256"])) == (
        "A. Meier",
        False,
        64,
    )
    readings = f"/v1/campaigns/{campaign['id']}/readings"
    house.http.delete(f"/v1/readings/{house.get(readings)['items'][0]['id']}")
    assert house.get(path)["signature"] == signature | {"changed": True}


def test_a_step_that_the_record_shows_undone_is_not_ticked(house):
    campaign = house.campaign()
    path = f"/v1/campaigns/{campaign['id']}"
    open_steps = [each for each in house.get(f"{path}/checklist")["items"] if "missing" in each]
    answer = patch(house.http, campaign, {"items": [{"key": open_steps[0]["key"], "done": True}]})
    assert (answer.status_code, answer.json()["code"]) == (409, "step_not_done")
    assert open_steps[0]["missing"] in answer.json()["detail"]


def test_a_signed_list_changes_only_with_a_new_signature(house):
    campaign = house.campaign()
    assert patch(house.http, campaign, {"signature": {"name": "A. Meier"}}).status_code == 200
    ticks = {"items": [{"key": "equipment_lamp", "done": True}]}
    refused = patch(house.http, campaign, ticks)
    assert (refused.status_code, refused.json()["code"]) == (409, "checklist_signed")
    assert "A. Meier" in refused.json()["detail"]
    again = patch(house.http, campaign, ticks | {"signature": {"name": "B. Schulz"}}).json()
    assert items_of(again)["equipment_lamp"]["done_by"]
    assert again["signature"]["name"] == "B. Schulz"


@pytest.mark.parametrize(
    ("body", "field", "said"),
    [
        (
            {"items": [{"key": "equipment_lamp", "done": True}, {"key": "lamp", "done": True}]},
            "body.items.1.key",
            "'lamp'",
        ),
        ({"items": [{"key": "equipment_lamp", "done": "yes"}]}, "body.items.0.done", "true or false"),
        ({}, "body", "items, a signature"),
    ],
)
def test_what_is_wrong_is_named_and_nothing_is_ticked(house, body, field, said):
    campaign = house.campaign()
    answer = patch(house.http, campaign, body)
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["field"] == field
    assert said in error["message"]
    assert house.get(f"/v1/campaigns/{campaign['id']}/checklist")["done"] == 0
