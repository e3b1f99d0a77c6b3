"""Uploads: beside a script, from eight clients at once, and over a line that breaks."""

import hashlib
import http.client
import itertools
import os
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from random import Random
from urllib.parse import urlsplit

import httpx
import numpy as np
from tusclient.client import TusClient

import stilb
from bench import harness
from bench.frames import CAMERA, create_campaign, draw_roi, make_mosaic, renew, write_copies
from bench.harness import Scale, Service, judge, say
from tests.support.deployments import Deployment, Embedded
from tests.support.fieldwork import Team
from tests.support.postgres import PostgresServer
from tests.support.proxy import Proxy

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


def run_campaign(scale: Scale) -> list[bool]:
    """Send frames of a whole campaign to all that `make up` runs, and wait for K."""
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name, ExitStack() as stack:
        folder = Path(name)
        team = stack.enter_context(stack.enter_context(Embedded(folder / "data")).team())
        client, mosaic, black = team.client, make_mosaic(scale), int(CAMERA.sensor.black_level_dn)
        campaign = create_campaign(client)
        client.set_roi(campaign, polygon=draw_roi(scale).points)
        paths, readings = [], []
        for level in range(1, _LEVELS + 1):
            share = np.float32(level / _LEVELS)
            (path,) = write_copies(folder, (black + (mosaic - black) * share).astype(np.uint16))
            paths.append(path.rename(folder / f"{level}.dng"))
            readings.append({"scene": f"level-{level}", "quantity": "luminance", "value": 10.0 * level})
        client.add_readings(campaign, [each | {"unit": "cd/m2"} for each in readings])
        say(f"\n{scale.frames} frames of {paths[0].stat().st_size / 1e6:.1f} MB, until K")
        began, frames = time.perf_counter(), []
        for number in range(scale.frames):
            renew(paths[number % _LEVELS], number)
            scene = f"level-{number % _LEVELS + 1}"
            frames.append(client.push(campaign, paths[number % _LEVELS], role="light", scene=scene))
        sent_s = time.perf_counter() - began
        for frame in frames:
            client.wait(frame.job_id)
        client.calibrate(campaign, model="proportional")
        ratio = (time.perf_counter() - began) / sent_s
        return [judge(f"until K, to the uploads ({sent_s:.1f} s)", ratio, at_most=1.3)]


def send_by_client(team: Team, through: str, campaign: str, path: Path) -> None:
    with stilb.Client(through, team.key, retries=12, timeout=2.0) as client:
        client.push(campaign, path, role="field")


def send_by_tuspy(team: Team, through: str, campaign: str, path: Path) -> None:
    """Send with tuspy, in pieces of 1 MiB."""
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    said = {"campaign_id": campaign, "sha256": digest, "role": "field", "filename": path.name}
    others = TusClient(f"{through}/v1/uploads", headers={"Authorization": f"Bearer {team.key}"})
    # its first request is not repeated, and its retries are never counted anew
    direct = TusClient(f"{team.url}/v1/uploads", headers=others.headers)
    with path.open("rb") as file:
        place = direct.uploader(file_stream=file, metadata=said).create_url().replace(team.url, through)
        others.uploader(file_stream=file, chunk_size=_MIB, url=place, retries=10_000, retry_delay=1).upload()


def run_cuts() -> list[bool]:
    """Break the lines of a service of its own; not part of `make bench`."""
    with tempfile.TemporaryDirectory(prefix="stilb-cuts-") as name, Embedded(Path(name) / "data") as service:
        senders = (send_by_client, send_by_tuspy)
        return [verdict for send in senders for verdict in cut_lines(service, send, Path(name))]


def cut_lines(
    deployment: Deployment,
    send: Callable[[Team, str, str, Path], None],
    folder: Path,
    *,
    kinds: Sequence[str] = ("reset",) * 50 + ("silence",) * 10 + ("kill",) * 5,
    file_bytes: int = 8 * _MIB,
    lasts_s: float = 8.0,
) -> list[bool]:
    """Send files, each of which takes so long, over a line that is reset, silent, or loses the service."""
    rng = Random(1)  # noqa: S311
    over = threading.Event()
    waits_s: list[float] = []
    host, port = deployment.url.removeprefix("http://").split(":")
    path = folder / "cut.DNG"

    def send_all() -> tuple[int, int]:
        """Return how many files were sent, and how many differ from what was sent."""
        files = wrong = 0
        while not over.is_set():
            files += 1
            path.write_bytes(content := rng.randbytes(file_bytes))
            send(team, f"http://{line.address}", campaign, path)
            (there,) = team.client.known_frames(campaign, [hashlib.sha256(content).hexdigest()])
            with team.http() as sender:
                wrong += sender.get(f"/v1/frames/{there.frame_id}/content").content != content
        return files, wrong

    with (
        deployment.team() as team,
        Proxy((host, int(port)), rate=file_bytes / lasts_s) as line,
        ThreadPoolExecutor(1) as pool,
    ):
        campaign = team.campaign().id
        sending = pool.submit(send_all)

        def wait(condition: Callable[[], bool]) -> None:
            while not condition() and not sending.done():
                time.sleep(0.002)

        for kind in rng.sample(kinds, len(kinds)):
            target = line.passed + rng.uniform(0.01, 0.25) * file_bytes
            wait(lambda target=target: line.passed >= target)
            if kind == "reset":
                line.cut()
            elif kind == "silence":
                with line.being("silent"):
                    time.sleep(3.0)
            else:
                deployment.kill("service")
                deployment.wait_until(deployment.serves)
            back_at = time.monotonic()
            wait(lambda back_at=back_at: line.piece_at > back_at)
            waits_s.append(line.piece_at - back_at)
        over.set()
        files, wrong = sending.result()
        resent = line.passed / (files * file_bytes) - 1
    say(f"\n{send.__name__}: {files} files of {file_bytes / 1e6:.0f} MB, {len(kinds)} cuts")
    return [
        judge("files with another content", wrong, at_most=0),
        judge("sent beyond the files, share", resent, at_most=0.1),
        judge("until the next byte, 95 % within [s]", sorted(waits_s)[int(0.95 * len(waits_s))], at_most=2.0),
    ]
