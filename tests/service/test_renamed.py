"""Old addresses of renamed resources: same answer, with the headers that name the new address."""

import pytest

SUCCESSORS = {
    "/v1/purges": "/v1/recalls",
    "/v1/purges/prg_none": "/v1/recalls/prg_none",
    "/v1/measurements/msr_none/contrast": "/v1/measurements/msr_none/comparison",
    "/measurements/contrast": "/measurements/comparison",
}


@pytest.mark.parametrize(("old", "new"), SUCCESSORS.items())
def test_old_address_answers_as_the_new_one_and_is_marked_deprecated(sqlite_house, old, new):
    former, current = (
        sqlite_house.http.get(path, params={"old": "msr_none"}, follow_redirects=False) for path in (old, new)
    )
    assert (former.status_code, former.text) == (current.status_code, current.text)
    assert former.headers["Deprecation"] == "@1795305600"
    assert former.headers["Link"] == f'<{new}>; rel="successor-version"'
    assert "Deprecation" not in current.headers


def test_old_address_takes_writes_and_answers_with_the_old_code(sqlite_house, monkeypatch):
    house = sqlite_house
    recall = house.post("/v1/purges", {"cause": {"software": "none"}, "reason": "rehearsal"}, status=201)
    assert house.get(f"/v1/recalls/{recall['id']}") == recall
    monkeypatch.setattr("store.recalls.find_versions", lambda *_: ["cal_later"])
    for path, code in (("purges", "purge_outdated"), ("recalls", "recall_outdated")):
        refused = house.http.post(f"/v1/{path}/{recall['id']}/confirm")
        assert (refused.status_code, refused.json()["code"]) == (409, code)
