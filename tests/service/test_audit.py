"""The audit trail over HTTP: of one organisation, for its admins, newest first."""


def test_who_did_what_newest_first_and_a_page_at_a_time(house):
    campaign = house.campaign()
    changed = house.http.patch(f"/v1/campaigns/{campaign['id']}", json={"recorder": "B. Schulz"})
    assert changed.status_code == 200
    entries = house.get("/v1/audit", subject_id=campaign["id"])["items"]
    assert [e["action"] for e in entries] == ["campaign.change", "campaign.create"]
    assert entries[0]["before"] == {"recorder": None}
    assert entries[0]["after"] == {"recorder": "B. Schulz"}
    assert entries[0]["actor"].startswith("key_")
    everything = house.get("/v1/audit")
    assert everything["next"] is None
    seqs = [e["seq"] for e in everything["items"]]
    assert seqs == sorted(seqs, reverse=True)
    paged, page = [], house.get("/v1/audit", limit=2)
    while True:
        paged += page["items"]
        if page["next"] is None:
            break
        page = house.http.get(page["next"]).json()
    assert paged == everything["items"]


def test_another_organisation_sees_its_own_only(house, stranger):
    campaign = house.campaign()
    own = stranger.post("/v1/cameras", json={"make": "DJI", "model": "X", "serial": "1"}).json()
    entries = stranger.get("/v1/audit").json()["items"]
    assert [e["subject_id"] for e in entries] == [own["id"]]
    assert stranger.get("/v1/audit", params={"subject_id": campaign["id"]}).json()["items"] == []


def test_only_an_admin_reads_it(house):
    key = house.post("/v1/keys", {"name": "dashboard", "scopes": ["read", "publish"]})
    with house.with_key(key["secret"]) as client:
        assert client.get("/v1/audit").json()["code"] == "scope_missing"


def test_a_cursor_that_is_none_is_refused(house):
    for cursor in ("x", -1, 2**63):
        assert house.get("/v1/audit", cursor=cursor, status=422)["code"] == "validation_failed"
