"""Small frames from several clients at once, beside one client that sends them one after the other."""

import hashlib
import http.client
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import urlsplit

import stilb
from bench.memory import list_tree, read_cpu_s
from bench.report import judge, say
from bench.subject import CAMERA, Scale
from bench.timing import Ratio, compare, take_turns
from bench.upload import KEY, Service, serving
from tests.support.postgres import PostgresServer

_CLIENTS = 8
_FRAME_BYTES = 20_000
_WORKERS = 2
_RATIO = "rate of eight clients, to one client's"


def show(scale: Scale, service: Service) -> None:
    """Show the figures of SQLite, which has one writer and no target."""
    say(f"\nframes of {_FRAME_BYTES / 1000:g} kB from {_CLIENTS} clients at once, on SQLite")
    rate = _measure(scale, service)
    say(f"  {_RATIO:<54} {rate}")


def run(scale: Scale, postgres: PostgresServer) -> list[bool]:
    """Compare the rate of eight clients with that of one, on PostgreSQL with several processes."""
    say(f"\nframes of {_FRAME_BYTES / 1000:g} kB from {_CLIENTS} clients at once, on PostgreSQL")
    say(f"  {_WORKERS} processes of the service, which share the cores with the database and the clients")
    with (
        tempfile.TemporaryDirectory(prefix="stilb-bench-") as name,
        serving(Path(name) / "data", postgres.new_database(), workers=_WORKERS) as service,
    ):
        return [judge(_RATIO, _measure(scale, service), at_least=3.0)]


def _measure(scale: Scale, service: Service) -> Ratio:
    each = max(2, scale.uploads)
    with stilb.Client(service.url, KEY) as client:
        camera = client.create_camera(CAMERA.body.make, CAMERA.body.model, CAMERA.body.serial).id
        campaigns = [client.create_campaign(camera).id for _ in range(_CLIENTS)]

    def send(campaign: str) -> None:
        # the plainest client: what it takes of the cores, the service lacks
        connection = http.client.HTTPConnection(urlsplit(service.url).netloc, timeout=300)
        for _ in range(each):
            content = os.urandom(_FRAME_BYTES)
            headers = {"X-Content-SHA256": hashlib.sha256(content).hexdigest()}
            headers |= {"Authorization": f"Bearer {KEY}", "Content-Type": "application/octet-stream"}
            connection.request("POST", f"/v1/campaigns/{campaign}/frames?role=field", content, headers)
            answer = connection.getresponse()
            if answer.status != http.client.CREATED:
                raise AssertionError(f"{answer.status} {answer.read()!r}")
            answer.read()
        connection.close()

    with ThreadPoolExecutor(_CLIENTS) as threads:
        ways: dict[str, Callable[[], object]] = {
            "one": lambda: send(campaigns[0]),
            "all": lambda: list(threads.map(send, campaigns)),
        }
        before_s, own_s = _read_cpu_s(service), time.process_time()
        seconds = take_turns(ways, rounds=scale.rounds, warm_up=1)
    frames = (scale.rounds + 1) * each * (_CLIENTS + 1)
    cpu_s, own_s = _read_cpu_s(service) - before_s, time.process_time() - own_s
    one, all_of_them = (each / statistics.median(spent) for spent in seconds.values())
    say(
        f"  one client {one:.0f}/s, eight {_CLIENTS * all_of_them:.0f}/s; CPU of a frame: "
        f"service {1e3 * cpu_s / frames:.1f} ms, client {1e3 * own_s / frames:.1f} ms"
    )
    return compare([_CLIENTS * spent for spent in seconds["one"]], seconds["all"])


def _read_cpu_s(service: Service) -> float:
    return sum(map(read_cpu_s, list_tree(service.pid)))
