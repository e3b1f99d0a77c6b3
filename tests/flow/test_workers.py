"""Several processes of one service: what each knows, all know; one that is killed is replaced."""

import os
import signal
import subprocess
import sys

import httpx
import pytest

from store.database import Database
from store.jobs.processes import list_parts
from tests.support.ports import pick_port
from tests.support.waiting import status_of, wait_for

KEY = "stilb_0123456789abcdefghijklmnopqrstuvwxyzABCDEF"
# a minute: few enough to be reached where a request takes a second
LIMIT = 24


@pytest.fixture
def service(migrated_sqlite, tmp_path):
    """`python -m service` as three processes; its first process, its address and its database."""
    path, port = tmp_path / "stilb.sqlite", pick_port()
    path.write_bytes(migrated_sqlite.read_bytes())
    settings = {"DATA": tmp_path, "PORT": port, "KEY": KEY, "WORKERS": 3, "QUOTA_REQUESTS_PER_MINUTE": LIMIT}
    settings |= {"BROKER_URL": "redis://127.0.0.1:1/0"}
    environment = os.environ | {f"STILB_{name}": str(value) for name, value in settings.items()}
    process = subprocess.Popen([sys.executable, "-m", "service"], env=environment)
    database = Database(f"sqlite:///{path}")
    try:
        yield process, f"http://127.0.0.1:{port}", database
    finally:
        database.dispose()
        process.kill()
        process.wait()


def test_several_processes_are_one_service(service):
    process, url, database = service

    def ask(path="/v1/cameras", key=KEY):
        # each over a connection of its own, which any process may take
        try:
            return httpx.get(f"{url}{path}", headers={"Authorization": f"Bearer {key}"}, timeout=30)
        except httpx.TransportError:
            return httpx.Response(0)

    def pids():
        with database.reading() as session:
            return {part.pid for part in list_parts(session) if part.state == "working"}

    wait_for(lambda: status_of(f"{url}/readyz") == 200 and len(pids()) == 3)
    made = httpx.post(
        f"{url}/v1/keys",
        headers={"Authorization": f"Bearer {KEY}"},
        json={"name": "field", "scopes": ["read"]},
        timeout=30,
    ).json()
    assert {ask(key=made["secret"]).status_code for _ in range(6)} == {200}
    revoked = httpx.delete(
        f"{url}/v1/keys/{made['id']}", headers={"Authorization": f"Bearer {KEY}"}, timeout=30
    )
    assert revoked.status_code == 200, revoked.text
    assert {ask(key=made["secret"]).status_code for _ in range(12)} == {401}

    killed = min(pids())
    os.kill(killed, signal.SIGKILL)
    # requests in the queue are the others': none is lost but those that the killed one had begun
    assert ask().status_code == 200
    wait_for(lambda: len(pids() - {killed}) == 3)

    answers = []
    wait_for(lambda: answers.append(ask().status_code) or answers[-1] == 429, timeout_s=60)
    assert len(answers) < 2 * LIMIT
    counted = sum(
        float(line.rpartition(" ")[2])
        for line in ask("/metrics").text.splitlines()
        if line.startswith("stilb_requests_total") and "/v1/cameras" in line
    )
    assert counted >= 6 + 12 + len(answers)

    process.send_signal(signal.SIGTERM)
    assert process.wait(60) == 0
    # on a slow machine the killed one has been silent for so long that it counts no more
    assert pids() <= {killed}
