"""Uploads over lines that break: `python -m bench.cuts`, on a service of its own.

A file is cut off at random points, by a reset, by silence and by the end of the service; then many files come
at once over slow lines that are cut every few seconds.
"""

import statistics
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import sha256
from itertools import chain
from pathlib import Path
from random import Random

from tusclient.client import TusClient

import stilb
from bench.memory import forget_peak, read_memory_mb
from bench.report import describe_machine, say
from tests.support.deployments import Deployment, Embedded
from tests.support.fieldwork import Team
from tests.support.proxy import Proxy

_MIB = 1 << 20
_SILENCE_S = 3.0
_PATIENCE_S = 2.0
"""Of a client for one answer, in the first part."""
_RETRIES = 12
"""As many as `stilb push` has."""


@dataclass(frozen=True, kw_only=True)
class Cuts:
    """How much is done: in earnest, or in a test."""

    resets: int = 150
    silences: int = 30
    kills: int = 20
    file_bytes: int = 8 * _MIB
    rate: float = 1.0 * _MIB
    lines: int = 100
    at_once: int = 50
    slowest: float = 8e3
    """[bytes/s], 64 kbit/s."""
    fastest: float = 250e3
    lasts_s: tuple[float, float] = (10.0, 40.0)
    """How long a file would take without a cut."""
    every_s: tuple[float, float] = (2.0, 6.0)


@dataclass(kw_only=True)
class Found:
    """Outcome of one part."""

    wrong: int = 0
    files: int = 0
    cuts: int = 0
    file_bytes: int = 0
    passed_bytes: int = 0
    waits_s: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    """From the line's return to the next byte of a file, by what broke it."""
    memory_mb: float = 0.0
    """Of the service, at most more than before."""

    @property
    def resent(self) -> float:
        """Share of what passed beyond the files themselves, heads of requests included."""
        return self.passed_bytes / self.file_bytes - 1.0

    def add(self, other: "Found") -> None:
        for name in ("wrong", "files", "cuts", "file_bytes", "passed_bytes"):
            setattr(self, name, getattr(self, name) + getattr(other, name))


Send = Callable[[Team, str, str, Path], None]
"""Send a file of a team through a line to a campaign."""


def send_by_client(team: Team, through: str, campaign: str, path: Path) -> None:
    """Send as `stilb push` does."""
    with stilb.Client(through, team.key, retries=_RETRIES, timeout=_PATIENCE_S) as client:
        client.push(campaign, path, role="field")


def send_by_tuspy(team: Team, through: str, campaign: str, path: Path) -> None:
    """Send with tuspy, in pieces of 1 MiB."""
    digest = sha256(path.read_bytes()).hexdigest()
    said = {"campaign_id": campaign, "sha256": digest, "role": "field", "filename": path.name}
    others = TusClient(f"{through}/v1/uploads", headers={"Authorization": f"Bearer {team.key}"})
    # its first request is not repeated, and its retries are never counted anew
    direct = TusClient(f"{team.url}/v1/uploads", headers=others.headers)
    with path.open("rb") as file:
        place = direct.uploader(file_stream=file, metadata=said).create_url().replace(team.url, through)
        others.uploader(file_stream=file, chunk_size=_MIB, url=place, retries=10_000, retry_delay=1).upload()


def cut_at_random(
    deployment: Deployment, team: Team, send: Send, folder: Path, cuts: Cuts, rng: Random
) -> Found:
    """Send one file after the other, until all cuts are done."""
    kinds = ["reset"] * cuts.resets + ["silence"] * cuts.silences + ["kill"] * cuts.kills
    rng.shuffle(kinds)
    found, over, host = Found(cuts=len(kinds)), threading.Event(), _host(deployment)
    campaign = team.campaign().id

    with Proxy(host, rate=cuts.rate) as line, ThreadPoolExecutor(1) as pool:

        def send_all() -> None:
            while not over.is_set():
                _send_one(team, send, f"http://{line.address}", campaign, folder, cuts.file_bytes, rng, found)

        sending = pool.submit(send_all)
        for kind in kinds:
            _wait_for_bytes(line, rng.uniform(0.05, 2.0) * _MIB, sending.done)
            back_at = _strike(deployment, line, kind)
            _wait(lambda back_at=back_at: line.piece_at > back_at, sending.done)
            found.waits_s[kind].append(line.piece_at - back_at)
        over.set()
        sending.result()
        found.passed_bytes = line.passed
    return found


def send_over_slow_lines(deployment: Deployment, team: Team, folder: Path, cuts: Cuts, seed: int) -> Found:
    """Send many files at once, each over a line of its own."""
    host, campaign = _host(deployment), team.campaign().id
    pid = deployment.pid("service")
    before_mb = read_memory_mb(pid, "VmRSS")
    forget_peak(pid)

    def send_one(number: int) -> Found:
        rng = Random(f"{seed} {number}")  # noqa: S311
        found = Found()
        rate = cuts.slowest * (cuts.fastest / cuts.slowest) ** rng.random()
        with Proxy(host, rate=rate) as line, _cutting(line, cuts, rng, found):
            size = int(rate * rng.uniform(*cuts.lasts_s))
            _send_one(team, send_by_client, f"http://{line.address}", campaign, folder, size, rng, found)
            found.passed_bytes = line.passed
        return found

    total = Found()
    with ThreadPoolExecutor(cuts.at_once) as pool:
        for found in pool.map(send_one, range(cuts.lines)):
            total.add(found)
    total.memory_mb = read_memory_mb(pid, "VmHWM") - before_mb
    return total


def _send_one(
    team: Team, send: Send, through: str, campaign: str, folder: Path, size: int, rng: Random, found: Found
) -> None:
    path = folder / f"{rng.getrandbits(64):016x}.DNG"
    content = rng.randbytes(size)
    path.write_bytes(content)
    send(team, through, campaign, path)
    (there,) = team.client.known_frames(campaign, [sha256(content).hexdigest()])
    with team.http() as http:
        found.wrong += http.get(f"/v1/frames/{there.frame_id}/content").content != content
    found.files += 1
    found.file_bytes += size
    path.unlink()


def _strike(deployment: Deployment, line: Proxy, kind: str) -> float:
    """Break the line; return when it passes again."""
    if kind == "reset":
        line.cut()
    elif kind == "silence":
        with line.being("silent"):
            time.sleep(_SILENCE_S)
    else:
        deployment.kill("service")
        deployment.wait_until(deployment.serves)
    return time.monotonic()


@contextmanager
def _cutting(line: Proxy, cuts: Cuts, rng: Random, found: Found) -> Iterator[None]:
    over = threading.Event()

    def cut() -> None:
        while not over.wait(rng.uniform(*cuts.every_s)):
            line.cut()
            found.cuts += 1

    thread = threading.Thread(target=cut)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _wait_for_bytes(line: Proxy, count: float, ended: Callable[[], bool]) -> None:
    target = line.passed + count
    _wait(lambda: line.passed >= target, ended)


def _wait(condition: Callable[[], bool], ended: Callable[[], bool]) -> None:
    while not condition() and not ended():
        time.sleep(0.002)


def _host(deployment: Deployment) -> tuple[str, int]:
    host, port = deployment.url.removeprefix("http://").split(":")
    return host, int(port)


def show(name: str, found: Found) -> None:
    say(f"{name}: {found.files} files, {found.file_bytes / 1e6:.0f} MB, {found.cuts} cuts")
    say(f"  {'files with another content':<54} {found.wrong}")
    say(f"  {'sent beyond the files, share':<54} {found.resent:.3f}")
    for kind, waits_s in {"all": [*chain(*found.waits_s.values())], **found.waits_s}.items():
        if len(waits_s) > 1:
            quantiles = statistics.quantiles(waits_s, n=20, method="inclusive")
            text = f"until the next byte, {kind} ({len(waits_s)})"
            say(f"  {text:<54} median {quantiles[9]:.2f} s, 95 % within {quantiles[18]:.2f} s")


def run(cuts: Cuts, deployment: Deployment, folder: Path, *, seed: int = 1) -> list[Found]:
    """Do it all; the first two are the clients', the last the slow lines'."""
    with deployment.team() as team:
        found = []
        for name, send in (("stilb.Client", send_by_client), ("tuspy", send_by_tuspy)):
            rng = Random(seed)  # noqa: S311
            found.append(cut_at_random(deployment, team, send, folder, cuts, rng))
            show(name, found[-1])
        found.append(send_over_slow_lines(deployment, team, folder, cuts, seed))
        show(f"{cuts.lines} slow lines, {cuts.at_once} at once", found[-1])
    each_mb = found[-1].memory_mb / cuts.at_once
    say(f"  {'memory of the service for each upload under way':<54} {each_mb:.2f} MB")
    return found


def main() -> int:
    say(describe_machine())
    with tempfile.TemporaryDirectory(prefix="stilb-cuts-") as name:
        folder = Path(name)
        with Embedded(folder / "data") as deployment:
            run(Cuts(), deployment, folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
