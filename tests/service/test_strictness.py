"""What is written loosely is refused: numbers in text, addresses with the wrong verb."""

import re

import pytest
from fastapi.routing import iter_route_contexts

CAMERA = {"make": "DJI", "model": "FC6520", "serial": "1"}
NO_NUMBERS = ["1_000", "\uff11\uff10", "1e5_0", "infinity", "-inf", "nan", "0x10", "1 000", "1e", ".", "٣"]


@pytest.fixture(scope="module")
def house(sqlite_house):
    """One for all: what is loose is refused before the database is asked."""
    return sqlite_house


def test_first_request_does_not_wait_for_the_whole_document(house, monkeypatch):
    monkeypatch.setattr(house.app, "openapi", None)
    house.app.state.operations.clear()
    assert house.http.get("/v1/cameras?limit=1").status_code == 200
    assert house.http.head(f"/v1/uploads/upl_1_{'0' * 64}").status_code == 404


@pytest.mark.parametrize("text", NO_NUMBERS)
def test_what_only_a_programmer_reads_as_a_number_is_none_in_a_table(house, text):
    path = f"/v1/campaigns/{house.campaign()['id']}/readings"
    table = f"scene;quantity;value;unit\na;luminance;{text};cd/m2\n"
    answer = house.http.post(path, content=table.encode(), headers={"Content-Type": "text/csv"})
    assert answer.status_code == 422, answer.text
    assert answer.json()["errors"] == [{"field": "line 2.value", "message": "must be a number"}]


@pytest.mark.parametrize("text", ["1.5", "+1.5", "1.5e0", "15E-1", "1,5", "001.50"])
def test_what_people_write_is_one(house, text):
    path = f"/v1/campaigns/{house.campaign()['id']}/readings"
    table = f"scene;quantity;value;unit\na;luminance;{text};cd/m2\n"
    answer = house.http.post(path, content=table.encode(), headers={"Content-Type": "text/csv"})
    assert answer.json()["items"][0]["value"] == 1.5


@pytest.mark.parametrize("text", NO_NUMBERS)
def test_nor_is_it_one_in_an_address(house, text):
    answer = house.http.get("/v1/cameras", params={"limit": text})
    assert (answer.status_code, answer.json()["code"]) == (422, "validation_failed"), answer.text
    assert answer.json()["errors"][0]["field"] == "query.limit"
    campaign = house.campaign()["id"]
    query = {"role": "light", "iso": text}
    answer = house.http.post(f"/v1/campaigns/{campaign}/frames", params=query, content=b"x")
    assert answer.json()["errors"] == [{"field": "query.iso", "message": "must be a number"}], answer.text


def test_no_address_takes_a_verb_that_it_does_not_name(house):
    """Every template of the application, with every verb that it does not have."""
    tried = 0
    routes = [route for route in iter_route_contexts(house.app.routes) if route.methods]
    for route in routes:
        taken = {method for each in routes if each.path == route.path for method in each.methods}
        taken |= {"HEAD"} if "GET" in taken else set()
        address = re.sub(r"{[^}]+}", "x", route.path)
        for method in {"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE"} - taken:
            answer = house.http.request(method, address)
            assert answer.status_code == 405, (method, route.path, answer.text)
            assert method == "HEAD" or answer.json()["code"] == "method_not_allowed"
            assert answer.headers["allow"] == ", ".join(sorted(taken)), route.path
            tried += 1
    assert tried > 200


@pytest.mark.parametrize(
    "condition", [{"If-Match": '"zzz"'}, {"If-Match": 'W/"a", "b"'}, {"If-None-Match": "*"}]
)
def test_no_change_is_made_on_a_condition_that_cannot_be_checked(house, condition):
    routes = [
        route for route in iter_route_contexts(house.app.routes) if (route.path or "").startswith("/v1/")
    ]
    changing = [
        (method, each.path) for each in routes for method in each.methods - {"GET", "OPTIONS", "HEAD"}
    ]
    assert {method for method, _ in changing} == {"POST", "PUT", "PATCH", "DELETE"}
    for method, path in changing:
        answer = house.http.request(method, re.sub(r"{[^}]+}", "x", path), headers=condition)
        assert (answer.status_code, answer.json()["code"]) == (412, "precondition_failed"), (method, path)
    camera = house.camera()
    path = f"/v1/cameras/{camera['id']}"
    assert house.http.patch(path, json={"note": "n"}, headers={"If-Match": "*"}).status_code == 200
    assert house.http.patch(path, json={"note": "m"}, headers=condition).status_code == 412
    assert house.get(path)["note"] == "n"
