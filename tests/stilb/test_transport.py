"""Which requests are sent again, when, and what an error looks like to the caller."""

import socket
import time
from contextlib import closing
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime

import httpx
import pytest

import stilb
from stilb.problem import from_response
from stilb.transport import Call, Transport, read_version

PROBLEM = {"Content-Type": "application/problem+json"}
CAMERA = {"id": "cam-1", "make": "DJI", "model": "X5S", "serial": "S1"}


def test_a_problem_document_becomes_a_problem(service, client):
    service.will_refuse(422, "roi_empty", errors=[{"field": "polygon"}])
    with pytest.raises(stilb.Problem, match="roi_empty: about roi_empty") as found:
        client.camera("cam-1")
    problem = found.value
    assert (problem.status, problem.code, problem.retryable) == (422, "roi_empty", False)
    assert problem.raw["errors"] == [{"field": "polygon"}]
    assert len(service.asked) == 1


@pytest.mark.parametrize(("status", "retryable"), [(502, True), (503, True), (404, False), (500, False)])
def test_a_gateways_page_becomes_a_problem(status, retryable):
    problem = from_response(httpx.Response(status, html="<h1>nginx</h1>"))
    assert (problem.code, problem.retryable) == (f"http_{status}", retryable)
    for told in ({"json": ["a list"]}, {"content": b"{", "headers": PROBLEM}):
        assert from_response(httpx.Response(status, **told)).code == f"http_{status}"


def test_a_post_keeps_its_idempotency_key_over_all_attempts_and_another_has_its_own(service, client):
    service.will_refuse(503, "starting", retryable=True)
    service.will_answer(cut_after=0)
    for _ in range(2):
        service.will_answer(CAMERA, status=201)
        client.create_camera("DJI", "X5S", "S1", pixel_pitch_um=3.3)
    *attempts, other = [asked.headers["idempotency-key"] for asked in service.asked]
    assert attempts == attempts[:1] * 3
    assert other != attempts[0]
    assert {asked.headers["authorization"] for asked in service.asked} == {"Bearer the-key"}
    assert {asked.headers["user-agent"] for asked in service.asked} == {f"stilb/{read_version()}"}


def test_a_patch_sent_again_keeps_its_idempotency_key(service):
    service.will_refuse(503, "starting", retryable=True)
    service.will_answer({})
    with closing(Transport(service.url, "k", timeout_s=5, retries=3, backoff_s=0.001)) as transport:
        transport.json(Call(method="PATCH", path="/v1/campaigns/c", json={}))
    keys = {asked.headers["idempotency-key"] for asked in service.asked}
    assert (len(service.asked), len(keys)) == (2, 1)


def test_retries_end(service, client):
    for _ in range(4):
        service.will_refuse(503, "starting", retryable=True)
    with pytest.raises(stilb.Problem, match="starting"):
        client.camera("cam-1")
    assert len(service.asked) == 4


def test_retry_after_is_respected(service, client):
    service.will_refuse(429, "too_many_requests", retryable=True, headers={"Retry-After": "1"})
    service.will_answer(CAMERA)
    began = time.monotonic()
    client.camera("cam-1")
    assert time.monotonic() - began >= 1.0


def test_a_service_that_is_back_is_found_before_a_long_pause_is_over(service, monkeypatch):
    monkeypatch.setattr("stilb.transport._LOOK_EVERY_S", 0.01)
    told = []
    for _ in range(5):
        service.will_answer(cut_after=0)
    service.will_answer(CAMERA)
    settings = {"retries": 1, "backoff_s": 600, "on_retry": lambda *each: told.append(each)}
    with stilb.Client(service.url, "k", **settings) as client:
        assert client.camera("cam-1").serial == "S1"
    assert (len(service.asked), len(told)) == (6, 1)


@pytest.mark.parametrize("status", [429, 507])
def test_who_is_told_to_wait_goes_on_however_often(service, client, monkeypatch, status):
    for _ in range(12):
        service.will_refuse(status, "quota_exceeded", retryable=True, headers={"Retry-After": "0"})
    service.will_answer(CAMERA)
    assert client.camera("cam-1").serial == "S1"
    monkeypatch.setattr("stilb.transport._PATIENCE_S", 0.0)
    service.will_refuse(status, "quota_exceeded", retryable=True, headers={"Retry-After": "0"})
    with pytest.raises(stilb.Problem, match="quota_exceeded"):
        client.camera("cam-1")


def test_retry_after_may_be_a_date_and_what_means_nothing_is_ignored():
    def read(value):
        return from_response(httpx.Response(503, headers={"Retry-After": value})).retry_after_s

    later = format_datetime(datetime.now(UTC) + timedelta(seconds=30), usegmt=True)
    assert read(later) == pytest.approx(30, abs=2)
    assert read("Sun, 01 Mar 2026 12:00:00 GMT") == 0.0
    assert [read(value) for value in ("soon", "-3", "")] == [None] * 3


def test_nobody_listening_is_a_problem_too_and_so_is_no_address():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound and not listening: the port refuses
        url = f"http://127.0.0.1:{taken.getsockname()[1]}"
        settings = {"retries": 1, "backoff_s": 0.001}
        with stilb.Client(url, "k", **settings) as client, pytest.raises(stilb.Problem) as found:
            client.camera("cam-1")
    assert (found.value.status, found.value.code, found.value.retryable) == (0, "unreachable", True)
    for wrong in ("127.0.0.1:8000", "ftp://127.0.0.1", "http://[::1", "http://calib.example:80O0", "http://"):
        with pytest.raises(stilb.Unclear, match="is not an address"):
            stilb.Client(wrong, "k")


def test_a_list_is_read_page_after_page(service, client):
    # Another host in `next`, as behind a proxy that does not tell its name: only its query counts.
    service.will_answer({"items": [CAMERA], "next": "http://inside:9/v1/cameras?cursor=a%2Bb&limit=1"})
    service.will_answer({"items": [CAMERA | {"id": "cam-2"}], "next": None})
    assert [camera.id for camera in client.cameras()] == ["cam-1", "cam-2"]
    assert service.asked[1].query == {"cursor": "a+b", "limit": "1"}
    assert service.asked[1].path == "/v1/cameras"


def test_an_answer_of_another_kind_is_a_problem(service, client):
    service.will_answer(["not", "an", "object"])
    with pytest.raises(stilb.Problem, match="unexpected_answer"):
        client.camera("cam-1")


def test_a_number_that_is_none_is_not_sent_and_an_id_leads_to_no_other_address(service, client):
    with pytest.raises(ValueError, match="JSON compliant"):
        client.create_camera("DJI", "X5S", "S1", pixel_pitch_um=float("inf"))
    service.will_answer(CAMERA)
    client.camera("../keys?x=1#y")
    assert [asked.path for asked in service.asked] == ["/v1/cameras/..%2Fkeys%3Fx%3D1%23y"]


def test_a_halt_ends_uploads_and_pauses(service):
    service.will_refuse(503, "busy", retryable=True)
    told = []

    def halt(problem, pause_s):
        told.append((problem.code, pause_s > 60))
        transport.halt()

    transport = Transport(service.url, "k", timeout_s=5, retries=9, backoff_s=1000, on_retry=halt)
    with closing(transport):
        with pytest.raises(stilb.Problem, match="busy"):
            transport.send(Call(method="GET", path="/"))
        upload = Call(method="POST", path="/", stream=lambda: iter([b"x"]), headers={"Content-Length": "1"})
        with pytest.raises(stilb.Problem, match="not_sent: it was stopped"):
            transport.send(upload)
    assert told == [("busy", False)]
    assert len(service.asked) == 1
