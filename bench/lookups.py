"""Look-ups beside a bare route with the same JSON, and series beside json.dumps and csv.writer."""

import csv
import hashlib
import io
import json
import os
import socket
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime, timedelta
from itertools import chain, islice
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
from fastapi import FastAPI
from fastapi.responses import JSONResponse
from sqlalchemy import text

from bench import frames, harness
from bench.harness import Scale, Seconds, Service, judge, say
from store import tables
from store.database import Database
from store.ready.rows import make_ready
from tests.support.ports import pick_port
from tests.support.postgres import PostgresServer

_CONNECTIONS = 4
_CAMERAS = 100
_SERIES = 20
_VERSIONS = 10  # versions of each camera, of ten coefficients each
_METHOD = "luminance"
_NOTHING = {"iso_fits": [], "points": [], "scenes": [], "flags": [], "tolerance_rel": 0.04, "passed": True}
_BEGIN = datetime(2020, 1, 1, tzinfo=UTC)
Row = dict[str, Any]


def run(scale: Scale, postgres: PostgresServer) -> list[bool]:
    """Measure on SQLite, and on PostgreSQL: the empty database that BENCH_POSTGRES names, else a new one."""
    url = os.environ.get("BENCH_POSTGRES") or postgres.new_database()
    return [*_measure(scale, None), *_measure(scale, url)]


def _measure(scale: Scale, url: str | None) -> Iterator[bool]:
    say(f"\nlook-ups and series on {'PostgreSQL' if url else 'SQLite'}")
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name, ExitStack() as opened:
        data = Path(name) / "data"
        service = opened.enter_context(harness.serving(data, url))
        database = Database(url or f"sqlite:///{data / 'stilb.sqlite'}", answer_within_s=None)
        cameras: list[str] = []
        times: list[tuple[float, float]] = []
        bare = ""
        for count in scale.coefficients:
            cameras += _fill(database, coefficients=count, first=len(cameras))
            say(f"  {count:,} coefficients")
            bare = bare or opened.enter_context(_serving_bare(service, _address(cameras[0]), data))
            yield from _compare_lookups(scale, service, bare, cameras, times)
        database.dispose()
        factor = scale.coefficients[-1] / scale.coefficients[0]
        for what, few, many in zip(("a look-up", "one camera's series"), times[0], times[-1], strict=True):
            yield judge(f"{what} with {factor:g} x the coefficients", many / few, at_most=1.5)
        if not url:
            yield from _measure_series(scale, service)


def _address(camera: str) -> str:
    return f"/v1/cameras/{camera}/coefficients?method={_METHOD}"


def _compare_lookups(
    scale: Scale, service: Service, bare: str, cameras: list[str], times: list[tuple[float, float]]
) -> Iterator[bool]:
    """Yield the verdicts; add to the times those of what grows, in that of the bare route."""
    paths = [_address(camera) for camera in cameras[:: max(1, len(cameras) // _CAMERAS)]]
    late: dict[str, Seconds] = {bare: [], service.url: []}

    def ask(url: str) -> None:
        seconds = _ask(url, paths, count=scale.lookups)
        late[url].append(statistics.quantiles(seconds, n=100, method="inclusive")[98])

    def read_series() -> None:
        for camera in cameras[:: max(1, len(cameras) // _SERIES)]:
            http.get("/v1/series/coefficients", params={"camera_id": camera}).raise_for_status()

    with service.open_http() as http:
        ways: dict[str, Callable[[], object]] = {
            f"{scale.lookups} times a bare FastAPI route, the same JSON": lambda: ask(bare),
            f"{scale.lookups} times the coefficients in force": lambda: ask(service.url),
            f"{_SERIES} times the series of one camera": read_series,
        }
        seconds = harness.take_turns(ways, rounds=scale.rounds)
    harness.show_times(seconds)
    bares, ours, series = seconds.values()
    share = harness.compare(bares, ours)
    times.append((1 / share.median, harness.compare(series, bares).median))
    yield judge("look-ups, share of the bare route", share, at_least=0.4)
    slowest = harness.compare(late[service.url], late[bare])
    yield judge("99 % of the look-ups, in those of the bare route", slowest, at_most=3.0)


def _ask(url: str, paths: Sequence[str], *, count: int) -> Seconds:
    """Send requests over a few connections, each as soon as the one before is answered; return their times.

    Plain sockets: a client that takes longer than the service would be what is measured.
    """
    parts = urlsplit(url)
    head = f" HTTP/1.1\r\nHost: {parts.netloc}\r\nAuthorization: Bearer {harness.KEY}\r\n\r\n"

    def ask_often(first: int) -> Seconds:
        seconds: Seconds = []
        with socket.create_connection((parts.hostname or "", parts.port or 80)) as connection:
            for number in range(first, count, _CONNECTIONS):
                began = time.perf_counter()
                connection.sendall(f"GET {paths[number % len(paths)]}{head}".encode())
                answer = connection.recv(1 << 18)
                while not _is_whole(answer):
                    answer += connection.recv(1 << 18)
                seconds.append(time.perf_counter() - began)
        return seconds

    with ThreadPoolExecutor(_CONNECTIONS) as threads:
        return list(chain.from_iterable(threads.map(ask_often, range(_CONNECTIONS))))


def _is_whole(answer: bytes) -> bool:
    head, found, body = answer.partition(b"\r\n\r\n")
    if found and not head.startswith(b"HTTP/1.1 200"):
        raise AssertionError(answer[:500].decode(errors="replace"))
    length = head.lower().partition(b"content-length: ")[2].partition(b"\r\n")[0]
    return bool(found) and len(body) >= int(length or 0)


def _measure_series(scale: Scale, service: Service) -> Iterator[bool]:
    """Compare the service's CPU for an answer with that of writing the same rows here, from memory."""
    address = "/v1/series/coefficients"
    with service.open_http() as http:
        rows = http.get(address).json()["rows"]

        def read(query: str = "") -> None:
            headers = {"Accept-Encoding": "identity"}
            with http.stream("GET", f"{address}{query}", headers=headers) as answer:
                answer.raise_for_status()
                for _ in answer.iter_raw():
                    pass

        def write_csv() -> None:
            writer = csv.DictWriter(io.StringIO(), rows[0].keys())
            writer.writeheader()
            writer.writerows(rows)

        ways = {"json": lambda: json.dumps({"rows": rows}), "csv": write_csv}
        for name, write in ways.items():
            before_mb = harness.read_memory_mb(service.pid, "VmRSS")
            harness.forget_peak(service.pid)
            ours, plain = [], []
            for _ in range(scale.rounds):
                before_s, began = harness.read_cpu_s(service.pid), time.process_time()
                write()
                plain.append(time.process_time() - began)
                read(f"?format={name}")
                ours.append(harness.read_cpu_s(service.pid) - before_s)
            more_mb = harness.read_memory_mb(service.pid, "VmHWM") - before_mb
            yield judge(f"CPU of {name}, in that of Python's own", harness.compare(ours, plain), at_most=3.0)
            yield judge(f"memory for {name} [MB]", more_mb, at_most=30.0)


@contextmanager
def _serving_bare(service: Service, address: str, data: Path) -> Iterator[str]:
    """Serve what the service answers there from memory: the least that can answer."""
    answer, port = data / "bare.json", pick_port()
    asked = httpx.get(f"{service.url}{address}", headers=harness.HEADERS).raise_for_status()
    answer.write_bytes(asked.content)
    words = ["-m", "uvicorn", "--factory", "bench.lookups:make_bare", "--port", str(port), "--no-access-log"]
    log = data / "bare.log"
    environment = harness.make_environment(data) | {"BARE": str(answer), "PYTHONWARNINGS": "ignore"}
    with log.open("wb") as file, harness.running([*words, "--log-level", "error"], environment, file):
        harness.await_answer(f"http://127.0.0.1:{port}{address}", log)
        yield f"http://127.0.0.1:{port}"


def make_bare() -> FastAPI:
    app, content = FastAPI(), json.loads(Path(os.environ["BARE"]).read_bytes())

    @app.get("/v1/cameras/{camera_id}/coefficients")
    async def get_coefficients(camera_id: str, method: str) -> JSONResponse:  # noqa: ARG001  read, as there
        return JSONResponse(content)

    return app


def _fill(database: Database, *, coefficients: int, first: int) -> list[str]:
    """Add cameras until there are so many coefficients; return their ids."""
    cameras = range(first, coefficients // (_VERSIONS * 10))
    with database.writing("bench") as session:
        organisation = session.query(tables.Organisation).filter(tables.Organisation.operator).one().id
        made = (each for camera in cameras for each in _make_camera(organisation, camera))
        while page := list(islice(made, 20_000)):
            rows: dict[type[tables.Base], list[Row]] = {}
            for table, row in page:
                rows.setdefault(table, []).append(row)
            frames.write_rows(session, rows)
        if not database.is_sqlite:
            session.execute(text("ANALYZE"))  # a service's own server does this by itself
    return [f"cam_{camera}" for camera in cameras]


def _make_camera(organisation: str, camera: int) -> Iterator[tuple[type[tables.Base], Row]]:
    body, of = frames.CAMERA.body, {"camera_id": f"cam_{camera}", "method": _METHOD}
    named = {"make": body.make, "model": body.model, "serial": f"{camera:08}"}
    yield tables.Camera, {"id": f"cam_{camera}", "organisation_id": organisation, **named}
    yield tables.Campaign, {"id": f"cmp_{camera}", "organisation_id": organisation, **of}
    yield tables.Slot, {"id": camera + 1, "organisation_id": organisation, "configuration": "{}", **of}
    document = _sha(f"certificate {camera}")
    yield tables.Blob, {"sha256": document, "size_bytes": 1}
    for version in range(1, _VERSIONS + 1):
        begin, calibration_id = _begin(version), f"cal_{camera}_{version}"
        mine: Row = {"calibration_id": calibration_id}
        calibration: Row = of | {"id": calibration_id, "organisation_id": organisation, "version": version}
        calibration |= {"campaign_id": f"cmp_{camera}", "result": _NOTHING, "result_schema": 1}
        calibration |= {"content_sha256": _sha(f"{camera} {version}"), "created_at": begin}
        calibration |= {name: {} for name in ("configuration", "parameters", "inputs", "software")}
        calibration["created_by"] = "bench"
        publication = mine | {"id": f"pub_{camera}_{version}", "slot_id": camera + 1, "valid_from": begin}
        publication |= {"known_from": begin + timedelta(hours=1), "reason": "annual calibration"}
        publication |= {"valid_to": None if version == _VERSIONS else _begin(version + 1)}
        issued = mine | {"amendment": 0, "number": calibration_id, "publication_id": publication["id"]}
        issued |= {"json_sha256": document, "pdf_sha256": document, "at_upgrade": False}
        issued |= {"issued_at": publication["known_from"]}
        mean = mine | {"name": "dark_signal_dn", "unit": "DN", "model": "mean", "flags": []}
        coefficients: list[Row] = [
            mean
            | {"position": place, "iso": 100.0 * 2**place, "standard_uncertainty": 0.43 + place / 991.0}
            | {"value": 64.0 + (7 * camera + 3 * version + place) / 977.0}
            for place in range(10)
        ]
        yield tables.Calibration, calibration
        yield tables.Publication, publication
        # or the service would issue them, beside what is measured
        yield tables.IssuedCertificate, issued
        yield from ((tables.CoefficientRow, each) for each in coefficients)
        rows = [tables.CoefficientRow(**each) for each in coefficients]
        published = tables.Publication(**publication), tables.Calibration(**calibration)
        yield from make_ready(*published, rows).items()


def _begin(version: int) -> datetime:
    return _BEGIN + timedelta(days=200 * version)


def _sha(named: str) -> str:
    return hashlib.sha256(named.encode()).hexdigest()
