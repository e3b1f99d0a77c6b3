"""Look-ups beside a bare route with the same JSON, and series beside json.dumps and csv.writer."""

import csv
import io
import json
import os
import selectors
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import httpx

from bench.memory import forget_peak, read_cpu_s, read_memory_mb
from bench.report import judge, say, show_times
from bench.stock import METHOD, fill
from bench.subject import Scale
from bench.timing import Ratio, Seconds, compare, take_turns
from bench.upload import KEY, Service, open_http, serving
from store.database import Database
from tests.support.postgres import PostgresServer

BARE, OURS = "a bare FastAPI route, the same JSON", "look-ups of coefficients in force"
UNCHANGED = "look-ups with If-None-Match (304)"
_SERIES = 20
ONE_CAMERA = f"series of one camera, {_SERIES} times"
_GROWING = "a look-up", "one camera's series"
_CONNECTIONS = 4
_CAMERAS = 100
_GROWTH_MB = 30.0
_CPU_S = 1.0
_HEADERS = {"Authorization": f"Bearer {KEY}"}


def run(scale: Scale, postgres: PostgresServer) -> list[bool]:
    """Measure on SQLite, and on PostgreSQL: the empty database that BENCH_POSTGRES names, else a new one."""
    url = os.environ.get("BENCH_POSTGRES") or postgres.new_database()
    return [*_measure(scale, None), *_measure(scale, url)]


def _measure(scale: Scale, url: str | None) -> list[bool]:
    say(f"\nlook-ups and series on {'PostgreSQL' if url else 'SQLite'}")
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name:
        data = Path(name) / "data"
        with ExitStack() as opened:
            service = opened.enter_context(serving(data, url))
            database = Database(url or f"sqlite:///{data / 'stilb.sqlite'}", answer_within_s=None)
            cameras: list[str] = []
            verdicts: list[bool] = []
            times: list[tuple[float, float]] = []
            bare = ""
            for count in scale.coefficients:
                began = time.monotonic()
                measurements = 0 if cameras else scale.measurements
                first = len(cameras)
                cameras += fill(database, coefficients=count, measurements=measurements, first=first)
                say(f"  {count:,} coefficients, filled in {time.monotonic() - began:.1f} s")
                bare = bare or opened.enter_context(_serving_bare(service, _address(cameras[0])))
                verdicts += _compare_lookups(scale, service, bare, cameras, times)
            database.dispose()
            factor = scale.coefficients[-1] / scale.coefficients[0]
            for what, few, many in zip(_GROWING, times[0], times[-1], strict=True):
                grown = Ratio(median=many / few, low=many / few, high=many / few)
                verdicts.append(judge(f"{what} with {factor:g} x the coefficients", grown, at_most=1.5))
            for address in ("coefficients", "measurements") if scale.every_series or not url else ():
                verdicts += _measure_series(scale, service, f"/v1/series/{address}", _address(cameras[0]))
    return verdicts


def _compare_lookups(
    scale: Scale, service: Service, bare: str, cameras: list[str], times: list[tuple[float, float]]
) -> list[bool]:
    """Return the verdicts; add to the times those of what grows, in that of the bare route."""
    paths = [_address(camera) for camera in cameras[:: max(1, len(cameras) // _CAMERAS)]]
    answer = httpx.get(f"{service.url}{paths[0]}", headers=_HEADERS, timeout=60)
    tag = f"If-None-Match: {answer.headers['ETag']}\r\n"
    late: dict[str, Seconds] = {BARE: [], OURS: [], UNCHANGED: []}

    def asking(name: str, url: str, paths: Sequence[str], status: int, more: str = "") -> None:
        seconds = _ask(url, paths, count=scale.lookups, status=status, headers=more)
        late[name].append(statistics.quantiles(seconds, n=100, method="inclusive")[98])

    with open_http(service) as http:
        ways: dict[str, Callable[[], object]] = {
            BARE: lambda: asking(BARE, bare, paths, 200),
            OURS: lambda: asking(OURS, service.url, paths, 200),
            UNCHANGED: lambda: asking(UNCHANGED, service.url, paths[:1], 304, tag),
            ONE_CAMERA: lambda: _read_series(http, cameras[:: max(1, len(cameras) // _SERIES)]),
        }
        seconds = take_turns(ways, rounds=scale.rounds)
    show_times(seconds)
    for name in late:
        rate = scale.lookups / statistics.median(seconds[name])
        say(f"  {name:<54} {rate:8.0f} requests/s, {_CONNECTIONS} connections")
    share, slowest = compare(seconds[BARE], seconds[OURS]), compare(late[OURS], late[BARE])
    times.append((1 / share.median, compare(seconds[ONE_CAMERA], seconds[BARE]).median))
    return [
        judge("look-ups, share of the bare route", share, at_least=0.5),
        judge("99 % of the look-ups, in those of the bare route", slowest, at_most=3.0),
    ]


def _read_series(http: httpx.Client, cameras: Sequence[str]) -> None:
    for camera in cameras:
        http.get("/v1/series/coefficients", params={"camera_id": camera}).raise_for_status()


def _address(camera: str) -> str:
    return f"/v1/cameras/{camera}/coefficients?method={METHOD}"


def _ask(url: str, paths: Sequence[str], *, count: int, status: int, headers: str) -> Seconds:
    """Send requests over a few connections, each as soon as the one before is answered; return their times.

    Plain sockets: a client that takes longer than the service would be what is measured.
    """
    parts = urlsplit(url)
    head = f" HTTP/1.1\r\nHost: {parts.netloc}\r\nAuthorization: Bearer {KEY}\r\n{headers}\r\n"
    requests = [f"GET {path}{head}".encode() for path in paths]
    seconds: Seconds = []
    began: dict[socket.socket, float] = {}
    received: dict[socket.socket, bytes] = {}
    sent = 0
    with selectors.DefaultSelector() as selector:
        for _ in range(_CONNECTIONS):
            connection = socket.create_connection((parts.hostname or "", parts.port or 80))
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            selector.register(connection, selectors.EVENT_READ)
            received[connection] = b""
        ready = list(received)
        while len(seconds) < count:
            for connection in ready:
                if sent < count:
                    began[connection] = time.perf_counter()
                    connection.sendall(requests[sent % len(requests)])
                    sent += 1
            ready = []
            for key, _ in selector.select():
                connection = key.fileobj  # type: ignore[assignment]
                received[connection] += connection.recv(1 << 18)
                if _is_whole(received[connection], status):
                    seconds.append(time.perf_counter() - began[connection])
                    received[connection] = b""
                    ready.append(connection)
        for connection in received:
            connection.close()
    return seconds


def _is_whole(answer: bytes, status: int) -> bool:
    head, found, body = answer.partition(b"\r\n\r\n")
    if not found:
        return False
    if not head.startswith(f"HTTP/1.1 {status}".encode()):
        raise AssertionError(answer[:500].decode(errors="replace"))
    length = head.lower().partition(b"content-length: ")[2].partition(b"\r\n")[0]
    return len(body) >= int(length or 0)


def _measure_series(scale: Scale, service: Service, address: str, lookup: str) -> list[bool]:
    """Compare the service's CPU for an answer with that of writing the same rows here, from memory."""
    with httpx.Client(base_url=service.url, headers=_HEADERS, timeout=600) as http:
        rows = http.get(address).json()["rows"]
        say(f"  {address}: {len(rows):,} rows")
        ways: dict[str, tuple[dict[str, str], Callable[[], object]]] = {
            "JSON": ({"format": "json"}, lambda: json.dumps({"rows": rows})),
            "CSV": ({"format": "csv"}, lambda: _write_csv(rows)),
            "Arrow": ({"format": "arrow"}, lambda: json.dumps({"rows": rows})),
        }
        verdicts = []
        for name, (query, plainly) in ways.items():
            before_mb = read_memory_mb(service.pid, "VmRSS")
            forget_peak(service.pid)
            turns = [
                (_time_series(service, http, address, query), _time_here(plainly))
                for _ in range(scale.series)
            ]
            ours, plain = ([turn[way] for turn in turns] for way in (0, 1))
            grown_mb = read_memory_mb(service.pid, "VmHWM") - before_mb
            rate = 1e5 * statistics.median(ours) / len(rows)
            say(f"  {name}: {grown_mb:.1f} MB more")
            cpu = Ratio(median=rate, low=rate, high=rate)
            verdicts.append(judge(f"CPU of {name} for 100,000 rows [s]", cpu, at_most=_CPU_S))
            beside = "csv.writer" if name == "CSV" else "json.dumps"
            verdicts.append(judge(f"CPU of {name}, in that of {beside}", compare(ours, plain), at_most=3.0))
            growth = Ratio(median=grown_mb, low=grown_mb, high=grown_mb)
            verdicts.append(judge(f"memory for {name} [MB]", growth, at_most=_GROWTH_MB))
        alone = [_time_lookup(http, lookup) for _ in range(100)]
        with ThreadPoolExecutor(1) as pool:
            download = pool.submit(_time_series, service, http, address, {})
            beside = [_time_lookup(http, lookup)]
            while not download.done():
                beside.append(_time_lookup(http, lookup))
        median = statistics.median(beside) / statistics.median(alone)
        slower = Ratio(median=median, low=median, high=median)
    return [*verdicts, judge("a look-up during the series, to alone", slower, at_most=3.0)]


def _time_lookup(http: httpx.Client, address: str) -> float:
    began = time.perf_counter()
    http.get(address).raise_for_status()
    return time.perf_counter() - began


def _time_series(service: Service, http: httpx.Client, address: str, query: dict[str, str]) -> float:
    before = read_cpu_s(service.pid)
    with http.stream("GET", address, params=query, headers={"Accept-Encoding": "identity"}) as answer:
        answer.raise_for_status()
        for _ in answer.iter_raw():
            pass
    return read_cpu_s(service.pid) - before


def _time_here(work: Callable[[], object]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


def _write_csv(rows: list[dict[str, object]]) -> None:
    writer = csv.DictWriter(io.StringIO(), rows[0].keys())
    writer.writeheader()
    writer.writerows(rows)


@contextmanager
def _serving_bare(service: Service, address: str) -> Iterator[str]:
    """Serve what the service answers there, from memory."""
    body = httpx.get(f"{service.url}{address}", headers=_HEADERS, timeout=60).raise_for_status().text
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "bench.bare", str(port)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, cwd=Path(__file__).parent.parent)
    try:
        process.stdin.write(body.encode())  # type: ignore[union-attr]
        process.stdin.close()  # type: ignore[union-attr]
        url = f"http://127.0.0.1:{port}"
        for _ in range(600):
            try:
                httpx.get(url)
                break
            except httpx.TransportError:
                time.sleep(0.05)
        yield url
    finally:
        process.terminate()
        process.wait()
