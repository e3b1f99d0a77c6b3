"""A frame's way into the service, beside a script that only hashes it and syncs it to the disk."""

import hashlib
import itertools
import os
import secrets
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx

import stilb
from bench.memory import forget_peak, read_memory_mb
from bench.report import judge, say, show_times
from bench.subject import CAMERA, Scale, make_mosaic, write_copies
from bench.timing import compare, take_turns

SERVICE = "through the service, streamed with httpx"
CLIENT = "through the service with stilb.Client (it hashes first)"
SCRIPT = "a script: read, SHA-256, write, fsync"

_ROOT = Path(__file__).resolve().parent.parent
KEY = f"stilb_{secrets.token_urlsafe(32)}"
_CHUNK_BYTES = 1 << 20
_READY_WITHIN_S = 180.0


@dataclass(frozen=True, kw_only=True)
class Service:
    """The HTTP side alone: a worker beside it would compete for the cores with what is measured."""

    url: str
    pid: int


def run(scale: Scale, service: Service, folder: Path) -> list[bool]:
    """Measure one file after the other, each with bytes that the service has never seen."""
    (path,) = write_copies(folder, make_mosaic(scale), "none", names=1)
    path = path.rename(folder / "frame.dng")
    say(f"\nuploading a frame of {path.stat().st_size / 1e6:.1f} MB")
    with stilb.Client(service.url, KEY) as client, open_http(service) as http:
        return _measure(scale, path, service, client, http)


def open_http(service: Service) -> httpx.Client:
    """For what the client would not do."""
    headers = {"Authorization": f"Bearer {KEY}"}
    return httpx.Client(base_url=service.url, headers=headers, timeout=300)


def _measure(
    scale: Scale, path: Path, service: Service, client: stilb.Client, http: httpx.Client
) -> list[bool]:
    camera = client.create_camera(CAMERA.body.make, CAMERA.body.model, CAMERA.body.serial)
    campaign = client.create_campaign(camera.id).id
    fresh = itertools.count(1)
    ways: dict[str, Callable[[], object]] = {
        SERVICE: lambda: _stream(http, campaign, path),
        CLIENT: lambda: client.push(campaign, path, role="field"),
        SCRIPT: lambda: _hash_and_sync(path, path.with_suffix(".copy")),
    }

    def prepare() -> None:
        renew(path, next(fresh))
        path.with_suffix(".copy").unlink(missing_ok=True)

    take_turns(ways, rounds=1, warm_up=1, prepare=prepare)
    before_mb = read_memory_mb(service.pid, "VmRSS")
    forget_peak(service.pid)
    seconds = take_turns(ways, rounds=scale.uploads, warm_up=0, prepare=prepare)
    grown_mb = read_memory_mb(service.pid, "VmHWM") - before_mb
    show_times(seconds)
    size_mb = path.stat().st_size / 1e6
    for name, each in seconds.items():
        say(f"  {name:<54} {size_mb / sorted(each)[len(each) // 2]:8.0f} MB/s")
    say(f"  {'the client, share of the script':<54} {compare(seconds[SCRIPT], seconds[CLIENT])}")
    sent_mb = 2 * scale.uploads * size_mb
    say(
        f"  the service's memory: {before_mb:.0f} MB before, "
        f"at most {grown_mb:.1f} MB more over {sent_mb:.0f} MB received"
    )
    return [
        judge("the service, share of the script", compare(seconds[SCRIPT], seconds[SERVICE]), at_least=0.5)
    ]


def renew(path: Path, number: int) -> None:
    """Change eight bytes: the service keeps equal bytes once, and would have less to do."""
    with path.open("r+b") as file:
        file.seek(-4096, os.SEEK_END)
        file.write(number.to_bytes(8, "little"))


def _stream(http: httpx.Client, campaign: str, path: Path) -> None:
    def pieces() -> Iterator[bytes]:
        with path.open("rb") as file:
            while piece := file.read(_CHUNK_BYTES):
                yield piece

    answer = http.post(
        f"/v1/campaigns/{campaign}/frames",
        params={"role": "field", "filename": path.name},
        headers={
            "Content-Length": str(path.stat().st_size),
            "Content-Type": "application/octet-stream",
        },
        content=pieces(),
    )
    if answer.status_code != httpx.codes.CREATED:
        raise AssertionError(f"{answer.status_code} {answer.text}")


def _hash_and_sync(path: Path, copy: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as source, copy.open("wb", buffering=0) as target:
        while piece := source.read(_CHUNK_BYTES):
            digest.update(piece)
            target.write(piece)
        os.fsync(target.fileno())
    return digest.hexdigest()


@contextmanager
def serving(data: Path, database_url: str | None = None, *, workers: int = 1) -> Iterator[Service]:
    """Run `python -m service` on a database, new unless one is there, without a broker: hints go nowhere."""
    data.mkdir(exist_ok=True)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith("STILB_")},
        "STILB_DATA": str(data),
        "STILB_PORT": str(port),
        "STILB_KEY": KEY,
        "STILB_WORKERS": str(workers),
        "STILB_BROKER_URL": "redis://127.0.0.1:1/0",
        **({"STILB_DATABASE_URL": database_url} if database_url else {}),
    }
    subprocess.run([sys.executable, "-m", "store.migrate"], check=True, cwd=_ROOT, env=environment)
    with (data / "service.log").open("wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "service"], cwd=_ROOT, env=environment, stdout=log, stderr=log
        )
    try:
        url = f"http://127.0.0.1:{port}"
        _await_ready(url, process, data / "service.log")
        yield Service(url=url, pid=process.pid)
    finally:
        process.terminate()
        process.wait()


def _await_ready(url: str, process: "subprocess.Popen[bytes]", log: Path) -> None:
    deadline = time.monotonic() + _READY_WITHIN_S
    while time.monotonic() < deadline and process.poll() is None:
        try:
            if httpx.get(f"{url}/readyz", timeout=5).is_success:
                return
        except httpx.TransportError:
            time.sleep(0.05)
    raise RuntimeError(f"the service did not start: {log.read_text(errors='replace')[-2000:]}")
