"""Who asks is known before what is asked is read: every operation, for strangers and for callers."""

import re
import time
from itertools import cycle

import httpx
import pytest
from fastapi.routing import APIRoute, iter_route_contexts

from service import auth
from service.auth import get_caller
from service.limits import MAX_BODY_BYTES
from service.operations import is_called

HOSTILE = {
    "nothing": b"",
    "no JSON": b'{"a": ',
    "another type": b"[[1]]",
    "twice": b'{"a": 1, "a": 2}',
    "no UTF-8": b"\xff\xfe{",
    "not a number": b'{"a": NaN, "b": -Infinity}',
    "digits": b'{"a": ' + b"1" * 10_000 + b"}",
    "deep": b"[" * 60_000,
    "names": b'{"0":1' + b"".join(b',"%d":1' % n for n in range(5000)) + b"}",
    "a long text": b'{"a": "' + b"x" * 60_000 + b'"}',
}
HUGE = {
    "names": b'{"0":1' + b"".join(b',"%d":1' % n for n in range(390_000)) + b"}",
    "objects": b"[" + b",".join([b"{}"] * 1_300_000) + b"]",
    "wide objects": b"[" + b",".join([b'{"a":1,"b":1,"c":1}'] * 50_000) + b"]",
    "numbers": b"[" + b"1," * 2_000_000 + b"1]",
    "spaces": b" " * (MAX_BODY_BYTES + 1),
}
JSON = {"Content-Type": "application/json"}


@pytest.fixture(scope="module")
def house(sqlite_house):
    return sqlite_house


@pytest.fixture(scope="module")
def operations(house):
    """Each with its method, an address, and whether it takes a document."""
    found = [
        (method, re.sub(r"{[^}]+}", "x", each.path), bool(each.body_field or "requestBody" in extra))
        for each in iter_route_contexts(house.app.routes)
        if isinstance(each.original_route, APIRoute) and is_called(get_caller, each.dependant)
        for extra in [each.openapi_extra or {}]
        for method in each.methods
    ]
    assert len(found) > 160
    return found


def ask(house, requests, *keys):
    """Send all of them in the loop of the application, with each key in turn; name and time each answer."""
    answers = []

    async def send_all():
        transport = httpx.ASGITransport(house.app)
        async with httpx.AsyncClient(transport=transport, base_url="http://testserver") as http:
            for (name, (method, address, body)), key in zip(requests, cycle(keys), strict=False):
                begun = time.process_time()
                headers = JSON | ({"Authorization": key} if key else {})
                answer = await http.request(method, address, content=body, headers=headers)
                answers.append((f"{method} {address}: {name}", answer, time.process_time() - begun))

    house.http.portal.call(send_all)
    return answers


def list_requests(operations, bodies):
    for method, path, takes in operations:
        yield "parameters", (method, f"{path}?no_such=1&limit=x", b"")
        for name, body in bodies.items() if takes else ():
            yield name, (method, path, body)


def test_strangers_are_told_nothing_else(house, operations, monkeypatch):
    monkeypatch.setattr(auth, "LATEST_S", 0.0)
    keys = (None, "Bearer nobody", "Basic eA==")
    for name, answer, took_s in ask(house, list_requests(operations, HOSTILE), *keys):
        assert (answer.status_code, answer.json()["code"]) == (401, "unauthenticated"), name
        assert answer.headers["www-authenticate"] == "Bearer"
        assert took_s < 0.3, name


def test_callers_are_told_what_is_wrong(house, operations):
    requests = [*list_requests(operations, HOSTILE)]
    requests += list_requests([("POST", "/v1/cameras", True), ("POST", "/v1/tools/motion", True)], HUGE)
    for name, answer, took_s in ask(house, requests, house.http.headers["authorization"]):
        if not name.startswith("GET /v1/health"):  # as probes ask, with whatever parameters
            assert 400 <= answer.status_code < 500, name
            assert answer.headers["content-type"] == "application/problem+json", name
        assert len(answer.content) < 64_000, name
        assert took_s < 0.3, name


@pytest.mark.parametrize("path", ["/v1/campaigns/x/readings", "/v1/tools/motion", "/v1/cameras"])
def test_a_member_that_stands_twice_is_named(house, path):
    for body, named in (
        ('{"value": 1, "value": 2}', "value"),
        ('{"lens": {"make": "d", "make": "d"}}', "make"),
        ('{"\\ud800": 1, "\\ud800": 1}', "\\ud800"),
    ):
        answer = house.http.post(path, content=body, headers=JSON)
        assert (answer.status_code, answer.json()["code"]) == (422, "validation_failed"), answer.text
        message = f'names "{named}" twice in one object; send it once'
        assert answer.json()["errors"] == [{"field": "body", "message": message}]
