"""Before an upload a client asks by hash what is there already."""

import hashlib

import pytest

from service.uploads.routes import MOST_HASHES

pytestmark = pytest.mark.either_database

OTHER = hashlib.sha256(b"not there").hexdigest()


@pytest.fixture
def sent(house):
    campaign = house.campaign()
    content = house.frame_bytes()
    frame = house.upload(campaign, content, role="light", scene="level-1", filename="a.DNG")
    return campaign, frame


def ask(house, campaign, *hashes, status=200, **headers):
    body = {"sha256": list(hashes)}
    return house.post(f"/v1/campaigns/{campaign['id']}/frames/known", body, status=status, **headers)


def test_known_files_are_told_from_unknown_ones_each_once_in_the_order_asked(house, sent):
    campaign, frame = sent
    later = hashlib.sha256(b"later").hexdigest()
    answer = ask(house, campaign, later, frame["sha256"], OTHER, later, frame["sha256"])
    assert answer["unknown"] == [later, OTHER]
    assert answer["known"] == [
        {
            "sha256": frame["sha256"],
            "frame_id": frame["id"],
            "filename": "a.DNG",
            "role": "light",
            "scene": "level-1",
            "state": "received",
            "job_id": frame["job_id"],
            "campaign_id": campaign["id"],
        }
    ]


def test_another_campaigns_files_are_unknown_to_this_one_and_known_to_the_organisation(house, sent):
    campaign, frame = sent
    anywhere = house.post("/v1/uploads/known", {"sha256": [OTHER, frame["sha256"]]}, status=200)
    assert anywhere["unknown"] == [OTHER]
    assert [known["campaign_id"] for known in anywhere["known"]] == [campaign["id"]]
    assert ask(house, house.campaign(), frame["sha256"]) == {"known": [], "unknown": [frame["sha256"]]}


def test_the_answer_is_never_an_old_one(house, sent):
    """What was unknown then may have arrived since, whatever key the request bears."""
    campaign, _ = sent
    content = house.frame_bytes(seed=2)
    sha256 = hashlib.sha256(content).hexdigest()
    key = {"Idempotency-Key": "asked before"}
    assert ask(house, campaign, sha256, **key)["unknown"] == [sha256]
    house.upload(campaign, content, role="dark")
    assert [known["role"] for known in ask(house, campaign, sha256, **key)["known"]] == ["dark"]


def test_what_is_no_list_of_hashes_is_refused(house, sent):
    campaign, _ = sent
    for hashes in ([], ["0" * 63], ["A" * 64], ["0" * 64] * (MOST_HASHES + 1)):
        problem = ask(house, campaign, *hashes, status=422)
        assert problem["code"] == "validation_failed"
        assert len(hashes) != 1 or problem["errors"] == [
            {"field": "body.sha256.0", "message": "must be a SHA-256: 64 digits, each 0 to 9 or a to f"}
        ]


def test_as_many_as_a_request_may_hold(house, sent):
    campaign, frame = sent
    many = [hashlib.sha256(bytes([n // 256, n % 256])).hexdigest() for n in range(MOST_HASHES - 1)]
    answer = ask(house, campaign, *many, frame["sha256"])
    assert answer["unknown"] == many
    assert [known["frame_id"] for known in answer["known"]] == [frame["id"]]


def test_a_key_tells_whose_it_is_and_what_it_may(house):
    made = house.post("/v1/keys", {"name": "card reader", "scopes": ["upload"]})
    with house.with_key(made["secret"]) as client:
        own = client.get("/v1/keys/own").json()
    organisation = house.get("/v1/organisation")
    assert own.pop("last_used_at") >= made["created_at"]
    assert own == {
        "id": made["id"],
        "name": "card reader",
        "scopes": ["upload"],
        "organisation": {"id": organisation["id"], "name": organisation["name"]},
        "created_at": made["created_at"],
    }
