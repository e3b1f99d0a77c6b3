"""The registry of findings over HTTP."""

from radiometry.methods.findings import FINDINGS


def test_every_finding_is_listed_with_sentence_and_remedy(house):
    items = {item["code"]: item for item in house.get("/v1/findings")["items"]}
    assert [*items] == [*FINDINGS]
    assert items["lamp_drift"] == {
        "code": "lamp_drift",
        "severity": "warn",
        "where": ["verdict", "calibration"],
        "sentence": FINDINGS["lamp_drift"].sentence,
        "remedy": FINDINGS["lamp_drift"].remedy,
        "retryable": False,
    }
    assert (items["not_found"]["status"], items["storage_full"]["retryable"]) == (404, True)
    assert items["place_missing"]["where"] == ["certificate"]


def test_an_unchanged_registry_is_not_sent_again(house):
    tag = house.http.get("/v1/findings").headers["ETag"]
    assert house.http.get("/v1/findings", headers={"If-None-Match": tag}).status_code == 304
