"""Uploads: beside a script, and from eight clients at once."""

import hashlib
import http.client
import itertools
import os
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import urlsplit

import httpx

import stilb
from bench import harness
from bench.frames import create_campaign, make_mosaic, renew, write_copies
from bench.harness import Scale, Service, judge, say
from tests.support.postgres import PostgresServer

_CLIENTS = 8
_LEVELS = 6
_FRAME_BYTES = 20_000
_MIB = 1 << 20


def run(scale: Scale, postgres: PostgresServer) -> list[bool]:
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name:
        folder = Path(name)
        with harness.serving(folder / "data") as service:
            verdict = _upload_one(scale, service, folder)
        with harness.serving(folder / "other", postgres.new_database(), workers=2) as service:
            return [verdict, _upload_many(scale, service)]


def _upload_one(scale: Scale, service: Service, folder: Path) -> bool:
    (path,) = write_copies(folder, make_mosaic(scale))
    copy = path.with_suffix(".copy")
    fresh = itertools.count(1)
    say(f"\nan upload of {path.stat().st_size / 1e6:.1f} MB")

    def prepare() -> None:
        renew(path, next(fresh))
        copy.unlink(missing_ok=True)

    with stilb.Client(service.url, harness.KEY) as client, service.open_http() as sender:
        campaign = create_campaign(client)
        ways: dict[str, Callable[[], object]] = {
            "through the service, streamed with httpx": lambda: _stream(sender, campaign, path),
            "with stilb.Client (it hashes first)": lambda: client.push(campaign, path, role="field"),
            "a script: read, SHA-256, write, fsync": lambda: _hash_and_sync(path, copy),
        }
        seconds = harness.take_turns(ways, rounds=scale.uploads, prepare=prepare)
    harness.show_times(seconds)
    streamed, _, script = seconds.values()
    return judge("the service, share of the script's rate", harness.compare(script, streamed), at_least=0.5)


def _stream(sender: httpx.Client, campaign: str, path: Path) -> None:
    headers = {"Content-Length": str(path.stat().st_size), "Content-Type": "application/octet-stream"}
    with path.open("rb") as file:
        pieces = iter(lambda: file.read(_MIB), b"")
        address = f"/v1/campaigns/{campaign}/frames?role=field"
        sender.post(address, headers=headers, content=pieces).raise_for_status()


def _hash_and_sync(path: Path, copy: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as source, copy.open("wb", buffering=0) as target:
        while piece := source.read(_MIB):
            digest.update(piece)
            target.write(piece)
        os.fsync(target.fileno())
    return digest.hexdigest()


def _upload_many(scale: Scale, service: Service) -> bool:
    say(f"\nframes of {_FRAME_BYTES / 1000:g} kB from {_CLIENTS} clients at once, on PostgreSQL")
    with stilb.Client(service.url, harness.KEY) as client:
        campaigns = [create_campaign(client) for _ in range(_CLIENTS)]

    def send(campaign: str) -> None:
        # the plainest client: what it takes of the cores, the service lacks
        connection = http.client.HTTPConnection(urlsplit(service.url).netloc, timeout=300)
        for _ in range(scale.uploads):
            content = os.urandom(_FRAME_BYTES)
            headers = harness.HEADERS | {"X-Content-SHA256": hashlib.sha256(content).hexdigest()}
            headers["Content-Type"] = "application/octet-stream"
            connection.request("POST", f"/v1/campaigns/{campaign}/frames?role=field", content, headers)
            answer = connection.getresponse()
            if answer.status != http.client.CREATED:
                raise AssertionError(f"{answer.status} {answer.read()!r}")
            answer.read()
        connection.close()

    with ThreadPoolExecutor(_CLIENTS) as threads:
        ways: dict[str, Callable[[], object]] = {
            "one client": lambda: send(campaigns[0]),
            "eight clients": lambda: list(threads.map(send, campaigns)),
        }
        seconds = harness.take_turns(ways, rounds=scale.rounds, warm_up=1)
    harness.show_times(seconds)
    one, together = seconds.values()
    rate = harness.compare([_CLIENTS * spent for spent in one], together)
    return judge("rate of eight clients, to one client's", rate, at_least=3.0)
