"""A service that is asked to stop: every open request gets an answer that its client can use."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import httpx
import pytest

from tests.support.alone import alone
from tests.support.fieldwork import Shot
from tests.support.frames import write_frame
from tests.support.waiting import PATIENCE_S, status_of, wait_for

MEGABYTE = 1 << 20


def frames_path(campaign):
    return f"/v1/campaigns/{campaign.id}/frames?role=light"


@pytest.fixture
def start(migrated_sqlite, tmp_path):
    return partial(alone, tmp_path, migrated_sqlite)


@pytest.fixture
def shots(tmp_path):
    return [Shot(path=write_frame(tmp_path / "frame.DNG"), role="light", scene="a")]


class SlowBody:
    """Two megabytes, of which the second waits until it is let go."""

    def __init__(self):
        self.headers = {"Content-Length": str(2 * MEGABYTE)}
        self.on_its_way = threading.Event()
        self.go_on = threading.Event()

    def __iter__(self):
        yield b"x" * MEGABYTE
        self.on_its_way.set()
        self.go_on.wait(PATIENCE_S)
        yield b"x" * MEGABYTE


def test_a_stop_leaves_an_upload_its_grace_and_serves_who_waits_or_comes_meanwhile(start, shots):
    with start() as service, service.team() as team, team.http() as http, ThreadPoolExecutor(2) as pool:
        campaign = team.campaign()
        (frame,) = team.push(campaign, shots)
        waiting = pool.submit(http.get, f"/v1/jobs/{frame.job_id}", headers={"Prefer": "wait=60"})
        body = SlowBody()
        upload = pool.submit(http.post, frames_path(campaign), content=body, headers=body.headers)
        assert body.on_its_way.wait(PATIENCE_S)
        assert not waiting.done()
        service.ask_to_stop()
        # who waits for a job is given it as it is
        answer = waiting.result(PATIENCE_S)
        assert (answer.status_code, answer.json()["state"]) == (200, "queued")
        wait_for(lambda: status_of(f"{service.url}/readyz") == 503)
        answer = httpx.get(f"{service.url}/readyz", timeout=5.0)
        assert (answer.json()["code"], answer.json()["retryable"]) == ("service_stopping", True)
        assert answer.headers["Connection"] == "close"
        assert team.client.campaign(campaign.id).id == campaign.id
        body.go_on.set()
        assert upload.result(PATIENCE_S).status_code == 201
        service.process.wait(PATIENCE_S)
    assert "Traceback" not in service.log.read_text()


def test_what_outlasts_the_grace_is_told_to_come_back_and_a_client_does(start, shots, tmp_path):
    """Uploads and waits of a client go on after the restart without an error."""
    paths = []
    for number in range(3):
        paths.append(tmp_path / f"{number}.DNG")
        paths[-1].write_bytes(bytes([number]) * 2 * MEGABYTE)
    over = threading.Event()
    with start(STILB_STOP_GRACE_S="0.5") as service, service.team(retries=100) as team, team.http() as http:
        campaign = team.campaign()
        (frame,) = team.push(campaign, shots)

        def upload(path):
            def slowly(_):
                time.sleep(0.5)

            team.client.push(campaign.id, path, role="light", on_progress=slowly)

        def wait():
            while not over.is_set():
                with pytest.raises(TimeoutError):
                    team.client.wait(frame.job_id, timeout_s=2)

        with ThreadPoolExecutor(6) as pool:
            body = SlowBody()
            cut = pool.submit(http.post, frames_path(campaign), content=body, headers=body.headers)
            assert body.on_its_way.wait(PATIENCE_S)
            waits = [pool.submit(wait) for _ in range(2)]
            uploads = [pool.submit(upload, path) for path in paths]
            time.sleep(0.3)
            service.ask_to_stop()
            time.sleep(0.8)
            body.go_on.set()
            check_told_to_come_back(cut.result(PATIENCE_S))
            service.process.wait(PATIENCE_S)
            service.begin()
            for sent in uploads:
                sent.result(PATIENCE_S)
            over.set()
            for waited in waits:
                waited.result(PATIENCE_S)
        assert len(list(team.client.frames(campaign.id))) == 1 + len(paths)
    assert "Traceback" not in service.log.read_text()


def check_told_to_come_back(answer):
    assert (answer.status_code, answer.headers["Content-Type"]) == (503, "application/problem+json")
    assert int(answer.headers["Retry-After"]) > 0
    assert answer.headers["Connection"] == "close"
    assert (answer.json()["code"], answer.json()["retryable"]) == ("service_stopping", True)
