"""What is deprecated says so: old addresses of renamed resources, and operations that will end."""

from datetime import date

import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

from service.http.middleware import Deprecations, deprecated

POLICY = "/docs/http#changes-of-the-api"
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
    assert former.headers["Link"].startswith(
        f'<{new}>; rel="successor-version", <{POLICY}>; rel="deprecation"'
    )
    assert "Deprecation" not in current.headers


def test_deprecated_operation_states_since_when_and_until_when():
    def answer() -> None:
        return None

    app = FastAPI()
    app.add_middleware(Deprecations)
    for name, dates in {
        "old": {"since": date(2027, 1, 1), "ends": date(2027, 7, 1)},
        "older": {"since": date(2026, 1, 1)},
    }.items():
        app.get(f"/{name}", **deprecated(**dates))(answer)
    app.get("/new")(answer)
    client = TestClient(app)
    old, older, new = (client.get(f"/{name}").headers for name in ("old", "older", "new"))
    assert (old["Deprecation"], old["Sunset"]) == ("@1798761600", "Thu, 01 Jul 2027 00:00:00 GMT")
    link = f'<{POLICY}>; rel="{{}}"; type="text/html"'
    assert old["Link"] == f"{link.format('deprecation')}, {link.format('sunset')}"
    assert (older["Deprecation"], older["Link"]) == ("@1767225600", link.format("deprecation"))
    assert {"Deprecation", "Sunset", "Link"}.isdisjoint(name.title() for name in new)
    marks = {
        path: methods["get"].get("deprecated", False) for path, methods in app.openapi()["paths"].items()
    }
    assert marks == {"/old": True, "/older": True, "/new": False}


def test_policy_that_they_link_to_is_a_page(sqlite_house):
    page, _, part = POLICY.partition("#")
    assert f'id="{part}"' in sqlite_house.http.get(page).text


def test_old_address_takes_writes_and_answers_with_the_old_code(sqlite_house, monkeypatch):
    house = sqlite_house
    recall = house.post("/v1/purges", {"cause": {"software": "none"}, "reason": "rehearsal"}, status=201)
    assert house.get(f"/v1/recalls/{recall['id']}") == recall
    monkeypatch.setattr("store.impact.find_versions", lambda *_: ["cal_later"])
    for path, code in (("purges", "purge_outdated"), ("recalls", "recall_outdated")):
        refused = house.http.post(f"/v1/{path}/{recall['id']}/confirm")
        assert (refused.status_code, refused.json()["code"]) == (409, code)
