"""Who asks is known before what is asked is read: every operation, for strangers and for callers.

`make hostile` does the same with bodies of 4 MiB, on a service of its own.
"""

import asyncio
import gc
import json
import os
import re
import time
from contextlib import suppress
from itertools import count, cycle

import httpx
import pytest
from fastapi.routing import APIRoute, iter_route_contexts

from bench.harness import forget_peak, read_memory_mb
from service.http import auth, middleware
from service.http.auth import get_caller
from service.http.middleware import MAX_BODY_BYTES, STRANGER_BYTES
from service.http.operations import list_calls
from tests.support.hostile import JSON, Body, make_bodies, make_heads, make_own
from tests.support.resumable import PIECE, TUS, begin_upload

DOCUMENT = {"Content-Type": JSON}
CPU_S, STALL_S, ANSWER_BYTES, MEMORY_MB = 0.3, 0.1, 64_000, 50.0


@pytest.fixture(scope="module")
def house(sqlite_house):
    """What other tests have left in this process is not searched for garbage meanwhile."""
    gc.collect()
    gc.freeze()
    return sqlite_house


@pytest.fixture(scope="module")
def small():
    return make_bodies(STRANGER_BYTES - 1000)


@pytest.fixture(scope="module")
def operations(house):
    """Each with its method, an address, and whether it takes a body."""
    found = [
        (method, re.sub(r"{[^}]+}", "x", each.path), bool(each.body_field or "requestBody" in extra))
        for each in iter_route_contexts(house.app.routes)
        if isinstance(each.original_route, APIRoute) and get_caller in list_calls(each.dependant)
        for extra in [each.openapi_extra or {}]
        for method in each.methods
    ]
    assert len(found) > 100
    return found


class Loop:
    """The longest turn of the application's loop in its processor time, which no busy machine lengthens."""

    async def watch(self):
        while True:
            before = time.thread_time()
            await asyncio.sleep(0.002)
            self.longest_s = max(self.longest_s, time.thread_time() - before)

    longest_s = 0.0


def ask(house, requests, *keys):
    """Send all of them, with each key in turn; return the name of each, its answer, and what it cost.

    A stall may be noticed at the next one.
    """
    answers = []

    async def send_all():
        transport, loop = httpx.ASGITransport(house.app), Loop()
        watching = asyncio.create_task(loop.watch())
        async with httpx.AsyncClient(transport=transport, base_url="http://testserver") as http:
            for (name, (method, address, body)), key in zip(requests, cycle(keys), strict=False):
                headers = {"Content-Type": body.kind, "Content-Encoding": body.encoding}
                headers |= ({"Authorization": key} if key else {}) | body.headers
                for _ in range(6):
                    begun, loop.longest_s = time.process_time(), 0.0
                    answer = await http.request(method, address, content=body.content, headers=headers)
                    cost = time.process_time() - begun, loop.longest_s
                    # what something else has slowed down is not dear every time
                    if cost[0] < CPU_S and cost[1] < STALL_S:
                        break
                answers.append((f"{method} {address}: {name}", answer, *cost))
        watching.cancel()
        with suppress(asyncio.CancelledError):
            await watching

    house.http.portal.call(send_all)
    return answers


def list_requests(operations, bodies):
    """A few bodies for each operation, so that each body is had by many; and parameters that no one knows."""
    others = cycle(bodies.items())
    for method, path, takes in operations:
        yield "parameters", (method, f"{path}?no_such=1&limit=x", Body(content=b""))
        for _ in range(5 if takes else 0):
            name, body = next(others)
            yield name, (method, path, body)


def check_cost(name, answer, cpu_s, stall_s):
    assert answer.is_success or len(answer.content) < ANSWER_BYTES, name
    assert cpu_s < CPU_S, (name, cpu_s)
    assert stall_s < STALL_S, (name, stall_s)


def test_strangers_are_told_nothing_else(house, operations, small, monkeypatch):
    monkeypatch.setattr(auth, "LATEST_S", 0.0)
    for name, answer, *cost in ask(
        house, list_requests(operations, small), None, "Bearer nobody", "Basic eA=="
    ):
        assert (answer.status_code, answer.json()["code"]) == (401, "unauthenticated"), name
        assert answer.headers["www-authenticate"] == "Bearer"
        check_cost(name, answer, *cost)


def test_callers_are_told_what_is_wrong(house, operations, small):
    requests = list_requests(operations, small)
    for name, answer, *cost in ask(house, requests, house.http.headers["authorization"]):
        assert answer.status_code < 500, name
        check_cost(name, answer, *cost)


def test_what_is_large_is_refused_at_little_cost(house):
    """Each body at an operation that takes a list of forms, and at one of the others."""
    headers = {"campaign_id": house.campaign()["id"], "frame_id": "x"}
    paths = [
        *("/v1/cameras", "/v1/campaigns/{campaign_id}/readings", "/v1/campaigns/{campaign_id}/points"),
        *("/v1/campaigns/{campaign_id}/frames?role=dark", "/v1/tools/exposure"),
    ]
    requests = [
        (name, ("POST", path, body))
        for (name, body), other in zip(make_bodies(MAX_BODY_BYTES - 1000).items(), cycle(paths), strict=False)
        for path in ("/v1/tools/motion", other)
    ]
    requests += [("its own", (method, path, body)) for (method, path), body in make_own().items()]
    for kind, (method, path, body) in requests:
        forget_peak(os.getpid())
        before_mb = read_memory_mb(os.getpid(), "VmRSS")
        request = kind, (method, path.format(**headers), body)
        ((name, answer, *cost),) = ask(house, [request], house.http.headers["authorization"])
        more_mb = read_memory_mb(os.getpid(), "VmHWM") - before_mb
        assert 400 <= answer.status_code < 500 or path.endswith("dark"), (name, answer.text)
        check_cost(name, answer, *cost)
        assert more_mb < MEMORY_MB, (name, more_mb)
        if answer.json().get("code") == "validation_failed":
            assert len(answer.json()["errors"]) <= 100


@pytest.mark.parametrize("known", [False, True])
def test_what_stands_before_a_body_costs_little(house, known, monkeypatch):
    """Also of what is looked at before it is known who asks, such as the query of a look-up."""
    monkeypatch.setattr(auth, "LATEST_S", 0.0)
    key = house.http.headers["authorization"] if known else "Bearer nobody"
    camera = house.camera()["id"]
    asked = {
        ("GET", f"/v1/cameras/{camera}/coefficients"): ("method", "iso", "f_number", "at"),
        ("GET", "/v1/jobs"): ("limit", "cursor", "state", "subject"),
        ("GET", "/v1/frames/x/content"): (),
        ("GET", "/v1/measurements/x/profile.json"): ("line",),
        ("POST", f"/v1/campaigns/{house.campaign()['id']}/frames"): ("role", "roi", "iso", "filename"),
        ("POST", "/v1/uploads"): (),
        ("POST", "/v1/cameras"): (),
    }
    requests = [
        (name, (method, f"{path}?{head.query(names)}", head))
        for name, head in make_heads(60_000).items()
        for (method, path), names in asked.items()
        if names or not head.unit
    ]
    for name, answer, *cost in ask(house, requests, key):
        assert answer.status_code < 500, name
        check_cost(name, answer, *cost)


def test_errors_that_are_not_listed_are_counted(house):
    body = json.dumps([{"value": 1}] * 500)
    answer = house.http.post(
        f"/v1/campaigns/{house.campaign()['id']}/readings", content=body, headers=DOCUMENT
    )
    assert len(answer.json()["errors"]) == 100
    assert answer.json()["errors"][0] == {"field": "body.0.scene", "message": "is missing"}
    assert answer.json()["detail"].endswith("; and 1495 more")


@pytest.mark.parametrize(("known", "statuses"), [(False, {401}), (True, {400, 404, 412, 422})])
def test_bodies_that_are_held_dripped_or_cut_end_everywhere(house, operations, monkeypatch, known, statuses):
    """Minutes last a tenth of a second here; whichever operation it asks, each is answered."""
    for name, most_s in (("STRANGER_S", 0.1), ("PAUSE_S", 0.1)):
        monkeypatch.setattr(middleware, name, most_s)
    monkeypatch.setattr(auth, "LATEST_S", 0.0)
    key = house.http.headers["authorization"] if known else "Bearer nobody"
    taking = [(method, path) for method, path, takes in operations if takes]

    answered = send_slowly(house, taking, key)
    assert len(answered) > 100
    assert set(answered) <= statuses


def test_files_that_are_held_dripped_or_cut_are_given_up(house, monkeypatch):
    monkeypatch.setattr(middleware, "PAUSE_S", 0.1)
    campaign, key = house.campaign()["id"], house.http.headers["authorization"]
    path = f"/v1/campaigns/{campaign}/frames"
    assert send_slowly(house, [("POST", path)], key, query=b"role=dark") == [400] * 3
    assert house.get(path)["items"] == []
    address = begin_upload(house, campaign, bytes(9000))
    piece = {name.lower(): text for name, text in PIECE.items()} | {"upload-offset": "0"}
    # the last of them has taken the upload over from the others
    assert set(send_slowly(house, [("PATCH", address)], key, **piece)) in ({400}, {400, 409})
    assert int(house.http.head(address, headers=TUS).headers["upload-offset"]) > 0


def send_slowly(house, operations, key, *, query=b"", **headers):
    """Send each operation a body that is cut, one that drips and one that is held; return the statuses."""

    async def send_one(method, path, every_s):
        sent, pieces = [], count()

        async def receive():
            if next(pieces):
                await asyncio.sleep(every_s)
            if every_s == 0 and next(pieces) > 2:
                return {"type": "http.disconnect"}
            return {"type": "http.request", "body": b"{", "more_body": True}

        async def send(message):
            sent.append(message)

        scope = scope_of(method, path, query, {"authorization": key} | headers)
        await house.app(scope, receive, send)
        return sent[0]["status"] if sent else 0

    async def send_all():
        return await asyncio.gather(
            *(send_one(*each, every_s) for each in operations for every_s in (0, 0.04, 3600))
        )

    return house.http.portal.call(send_all)


def scope_of(method, path, query, headers):
    headers = {"host": "testserver", "content-type": JSON, "content-length": "9000"} | headers
    return {
        "type": "http",
        "method": method,
        "path": path,
        "raw_path": path.encode(),
        "root_path": "",
        "scheme": "http",
        "query_string": query,
        "client": ("127.0.0.1", 1),
        "headers": [(name.encode(), text.encode()) for name, text in headers.items()],
    }


@pytest.mark.parametrize("path", ["/v1/campaigns/x/readings", "/v1/tools/motion", "/v1/cameras"])
def test_a_member_that_stands_twice_is_named(house, path):
    for body, named in (
        ('{"value": 1, "value": 2}', "value"),
        ('{"lens": {"make": "d", "make": "d"}}', "make"),
        ('{"\\ud800": 1, "\\ud800": 1}', "\\ud800"),
    ):
        answer = house.http.post(path, content=body, headers=DOCUMENT)
        assert (answer.status_code, answer.json()["code"]) == (422, "validation_failed"), answer.text
        message = f'names "{named}" twice in one object; send it once'
        assert answer.json()["errors"] == [{"field": "body", "message": message}]
