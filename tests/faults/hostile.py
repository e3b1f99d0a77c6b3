"""``python -m tests.faults.hostile``: hostile bodies at every operation, and 512 hostile connections.

It prints what each kind of body costs the service at most, and what a neighbour notices of the connections.
"""

import argparse
import asyncio
import itertools
import multiprocessing
import re
import resource
import socket
import statistics
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Self
from urllib.parse import urlsplit

import httpx

from bench.harness import (
    KEY,
    Service,
    describe_machine,
    forget_peak,
    read_cpu_s,
    read_memory_mb,
    say,
    serving,
)
from service.http.middleware import MAX_BODY_BYTES
from store.database import Database
from store.migrate import migrate
from tests.support.everything import make_one_of_each
from tests.support.hostile import DRIPPED, HELD, Body, make_bodies, make_heads, make_own
from tests.support.house import House

MOST_BYTES = MAX_BODY_BYTES - 1000
CONNECTIONS, P99_S = 512, 1.0
WRONG = "stilb_wrong"
OPEN = ["/metrics", "/readyz", "/openapi.json", "/sign-in", "/v1/signing-keys"]
_ANSWER_WITHIN_S = 120.0


@dataclass(frozen=True)
class Cost:
    """What a request costs at most: the service's CPU, a neighbour's wait, the answer, and memory."""

    cpu_s: float = 0.0
    stall_s: float = 0.0
    answer_kb: float = 0.0
    memory_mb: float = 0.0

    def __or__(self, other: "Cost") -> "Cost":
        return Cost(*(max(pair) for pair in self._pair(other)))

    def holds(self) -> bool:
        return all(own <= most for own, most in self._pair(LIMITS))

    def _pair(self, other: "Cost") -> list[tuple[float, float]]:
        return [(getattr(self, each.name), getattr(other, each.name)) for each in fields(self)]

    def __str__(self) -> str:
        spent = f"{self.cpu_s:6.3f} s | {self.stall_s:6.3f} s"
        return f"{spent} | {self.answer_kb:5.1f} kB | {self.memory_mb:5.1f} MB"


LIMITS = Cost(cpu_s=0.3, stall_s=0.1, answer_kb=64.0, memory_mb=50.0)


@dataclass(frozen=True)
class Operation:
    method: str
    path: str
    needs_key: bool = True
    query: str = ""
    parameters: tuple[str, ...] = ()
    own: Body | None = field(default=None, compare=False)

    def __str__(self) -> str:
        return f"{self.method} {self.path}"


class Neighbour(threading.Thread):
    """Asks again and again, over one connection, and keeps how long each answer took.

    With ``busy`` a wait counts as far as the service computed meanwhile: others may want the processors too.
    """

    def __init__(self, service: Service, path: str, *, every_s: float, busy: bool = False) -> None:
        super().__init__(daemon=True)
        self._place, self._every_s = address_of(service), every_s
        self._pid = service.pid if busy else None
        head = f"GET {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {KEY}\r\n\r\n"
        self._request = head.encode()
        self._end = threading.Event()
        self.took_s: list[float] = []
        self.errors = 0

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self.join()

    def worst_s(self) -> float:
        """Return the longest wait since this was last asked, the present one too."""
        before = len(self.took_s)
        while len(self.took_s) < before + 2 and self.is_alive():
            time.sleep(0.001)
        worst, self.took_s = max(self.took_s), []
        return worst

    def run(self) -> None:
        connection: socket.socket | None = None
        while not self._end.wait(self._every_s):
            began, computed_s = time.perf_counter(), read_cpu_s(self._pid) if self._pid else 0.0
            try:
                connection = connection or socket.create_connection(self._place, timeout=60)
                connection.sendall(self._request)
                self.errors += not read_answer(connection).startswith(b"HTTP/1.1 200")
            except OSError:
                self.errors, connection = self.errors + 1, None
            took_s = time.perf_counter() - began
            self.took_s.append(min(took_s, read_cpu_s(self._pid) - computed_s) if self._pid else took_s)


def address_of(service: Service) -> tuple[str, int]:
    parts = urlsplit(service.url)
    return parts.hostname or "", parts.port or 80


def read_answer(connection: socket.socket) -> bytes:
    answer = b""
    while (found := re.search(rb"content-length: (\d+)\r\n(?:[^\r]+\r\n)*\r\n", answer)) is None or len(
        answer
    ) < found.end() + int(found[1]):
        if not (piece := connection.recv(1 << 16)):
            raise OSError("no whole answer")
        answer += piece
    return answer


def write_head(operation: Operation, body: Body, key: str | None) -> bytes:
    headers = {
        "Host": "localhost",
        "Connection": "close",
        "Content-Type": body.kind,
        "Content-Encoding": body.encoding,
        "Content-Length": str(len(body.content) + body.missing_bytes),
        **({"Authorization": f"Bearer {key}"} if key else {}),
        **body.headers,
    }
    query = body.query(operation.parameters) or operation.query
    lines = [f"{operation.method} {operation.path}{'?' * bool(query)}{query} HTTP/1.1"]
    lines += [f"{name}: {value}" for name, value in headers.items()]
    return "\r\n".join([*lines, "", ""]).encode()


def list_addresses() -> Iterator[str]:
    """Each of them is one that was never refused before."""
    return (f"127.{a}.{b}.{c}" for a, b, c in itertools.product(range(1, 250), range(250), range(1, 250)))


def ask(service: Service, operation: Operation, body: Body, key: str | None, source: str) -> bytes:
    """Send one request, and return its whole answer; empty where the service closed without one."""
    with socket.create_connection(address_of(service), _ANSWER_WITHIN_S, (source, 0)) as connection:
        with suppress(OSError):
            connection.sendall(write_head(operation, body, key) + body.content)
            if body.missing_bytes:
                connection.shutdown(socket.SHUT_WR)
        answer = b""
        with suppress(ConnectionResetError):
            while piece := connection.recv(1 << 16):
                answer += piece
        return answer


async def drip(
    service: Service, operation: Operation, body: Body, key: str | None, source: str, *, begins_s: float = 0.0
) -> bytes:
    """Send one request as slowly as its body comes; return the answer."""
    await asyncio.sleep(begins_s)
    reader, writer = await asyncio.open_connection(*address_of(service), local_addr=(source, 0))
    at_once = 8 if body.every_s else len(body.content)
    writer.write(write_head(operation, body, key) + body.content[:at_once])

    async def go_on() -> None:
        for byte in body.content[at_once:]:
            await asyncio.sleep(body.every_s)
            writer.write(bytes([byte]))

    dripping = asyncio.ensure_future(go_on())
    try:
        async with asyncio.timeout(_ANSWER_WITHIN_S):
            return await reader.read()
    except ConnectionResetError:
        return b""
    finally:
        dripping.cancel()
        writer.close()


class Table:
    """Every operation with every body, with a key and without one."""

    def __init__(self, service: Service, ids: dict[str, str]) -> None:
        self._service = service
        self._addresses = list_addresses()
        self._operations = list(list_operations(service, ids))
        self.costs: dict[tuple[str, bool], Cost] = {}
        self.failures: list[str] = []

    def run(self) -> None:
        bodies = make_bodies(MOST_BYTES) | make_heads(60_000)
        bodies["more than any body"] = Body(content=bytes(MAX_BODY_BYTES + 1))
        say(
            f"{len(self._operations)} operations, {len(bodies) + 2} kinds of requests, with and without a key"
        )
        for operation in self._operations:
            # what a service loads when it is first asked
            ask(self._service, operation, bodies["no document"], KEY, next(self._addresses))
        with Neighbour(self._service, "/livez", every_s=0.002, busy=True) as neighbour:
            for is_known, (name, body) in itertools.product((False, True), bodies.items()):
                for operation in self._operations:
                    self._measure(neighbour, operation, name, body, is_known=is_known)
                self._show(name, is_known=is_known)
            for operation in self._operations:
                if operation.own:
                    self._measure(neighbour, operation, "its own names", operation.own, is_known=True)
            self._show("its own names", is_known=True)
            for is_known, (name, body) in itertools.product(
                (False, True), (("held", HELD), ("dripped", DRIPPED))
            ):
                self._measure_slow(neighbour, name, body, is_known=is_known)
                self._show(name, is_known=is_known)

    def _show(self, name: str, *, is_known: bool) -> None:
        say(f"| {name:24} | {'key' if is_known else '':3} | {self.costs[name, is_known]} |")

    def _measure(
        self, neighbour: Neighbour, operation: Operation, name: str, body: Body, *, is_known: bool
    ) -> None:
        with _Spent(self._service.pid, neighbour) as spent:
            answer = ask(self._service, operation, body, KEY if is_known else None, next(self._addresses))
        self._note(name, spent.of(answer), {operation: answer}, is_known=is_known)

    def _measure_slow(self, neighbour: Neighbour, name: str, body: Body, *, is_known: bool) -> None:
        """All at once, for a minute; CPU is that of one, and memory that of all."""
        key = KEY if is_known else None

        async def ask_all() -> list[bytes]:
            return await asyncio.gather(
                *(
                    drip(self._service, each, body, key, next(self._addresses), begins_s=0.02 * number)
                    for number, each in enumerate(self._operations)
                )
            )

        with _Spent(self._service.pid, neighbour) as spent:
            answers = asyncio.run(ask_all())
        cost = spent.of(*answers)
        cost = Cost(cost.cpu_s / len(answers), cost.stall_s, cost.answer_kb, cost.memory_mb)
        self._note(name, cost, dict(zip(self._operations, answers, strict=True)), is_known=is_known)

    def _note(self, name: str, cost: Cost, answers: dict[Operation, bytes], *, is_known: bool) -> None:
        self.costs[name, is_known] = self.costs.get((name, is_known), Cost()) | cost
        what = f"{name}, {'a key' if is_known else 'no key'}"
        if not cost.holds():
            self.failures.append(f"{next(iter(answers))}, {what}: {cost}")
            say(self.failures[-1])
        for operation, answer in answers.items():
            status = int(answer[9:12] or 0)
            if status >= 500 or (not is_known and operation.needs_key and status not in {0, 401}):
                self.failures.append(f"{operation}, {what}: {status}")
                say(self.failures[-1])


class _Spent:
    def __init__(self, pid: int, neighbour: Neighbour) -> None:
        self._pid, self._neighbour = pid, neighbour

    def __enter__(self) -> Self:
        self._neighbour.worst_s()
        forget_peak(self._pid)
        self._before_mb, self._before_s = read_memory_mb(self._pid, "VmRSS"), read_cpu_s(self._pid)
        return self

    def __exit__(self, *_: object) -> None:
        self._cpu_s = read_cpu_s(self._pid) - self._before_s
        self._stall_s = self._neighbour.worst_s()
        self._memory_mb = read_memory_mb(self._pid, "VmHWM") - self._before_mb

    def of(self, *answers: bytes) -> Cost:
        """Return the cost; what is sent with success is no refusal, and as long as it is."""
        size_kb = max(0.0 if each.startswith(b"HTTP/1.1 2") else len(each) / 1000 for each in answers)
        return Cost(self._cpu_s, self._stall_s, size_kb, max(0.0, self._memory_mb))


def list_operations(service: Service, ids: dict[str, str]) -> Iterator[Operation]:
    """List those of the document, with ids that exist where a body is taken."""
    document, own = httpx.get(f"{service.url}/openapi.json", timeout=60).json(), make_own()
    for path, methods in document["paths"].items():
        for method, said in methods.items():
            known = ids if "requestBody" in said else {}
            address = re.sub(r"{(\w+)}", lambda found: known.get(found[1], "x"), path)  # noqa: B023
            asked = [each for each in said.get("parameters", ()) if each["in"] == "query"]
            yield Operation(
                method.upper(),
                address,
                needs_key=bool(said["security"]),
                query="&".join(
                    f"{each['name']}={each['schema'].get('enum', ['1'])[0]}"
                    for each in asked
                    if each.get("required")
                ),
                parameters=tuple(each["name"] for each in asked),
                own=own.get((method.upper(), path)),
            )


def flood(service: Service, paths: list[str], lasts_s: float) -> dict[str, int]:
    """Keep hostile connections of one address open, each begun again when it ends; count the answers."""
    resource.setrlimit(resource.RLIMIT_NOFILE, (4096, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    post, nothing = Operation("POST", "/v1/tools/motion"), Body(content=b"")
    ways = [
        (post, HELD, None),
        (post, DRIPPED, WRONG),
        (post, make_bodies(60_000)["many walls of names"], None),
        (post, make_bodies(MOST_BYTES)["a wall of names"], WRONG),
        *((Operation("GET", path), nothing, WRONG) for path in paths),
    ]
    answers: Counter[str] = Counter()

    async def repeat(operation: Operation, body: Body, key: str | None) -> None:
        while True:
            try:
                answer = await drip(service, operation, body, key, "127.0.0.9")
                answers[answer[9:12].decode() or "closed"] += 1
            except OSError:
                answers["refused"] += 1
                await asyncio.sleep(0.1)

    async def run() -> None:
        async with asyncio.timeout(lasts_s), asyncio.TaskGroup() as tasks:
            for way in itertools.islice(itertools.cycle(ways), CONNECTIONS):
                tasks.create_task(repeat(*way))

    with suppress(TimeoutError):
        asyncio.run(run())
    return dict(answers)


def attack(service: Service, camera_id: str, *, paths: list[str], lasts_s: float) -> bool:
    """Measure a neighbour's look-ups before and during a flood; return whether they are served well."""
    look_up = f"/v1/cameras/{camera_id}/coefficients?method=luminance"
    with (
        Neighbour(service, look_up, every_s=0.02) as neighbour,
        ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as apart,
    ):
        time.sleep(min(10.0, lasts_s))
        quiet_s, neighbour.took_s = neighbour.took_s, []
        forget_peak(service.pid)
        before_mb, before_s = read_memory_mb(service.pid, "VmRSS"), read_cpu_s(service.pid)
        answers = apart.submit(flood, service, paths, lasts_s).result()
        took_s = list(neighbour.took_s)
        cpu_s = read_cpu_s(service.pid) - before_s
        memory_mb = read_memory_mb(service.pid, "VmHWM") - before_mb
    say(
        f"{CONNECTIONS} hostile connections of one address for {lasts_s:.0f} s, {', '.join(paths)}: {answers}"
    )
    for name, each in (("before", quiet_s), ("during", took_s)):
        p50, p99 = (1e3 * statistics.quantiles(each, n=100, method="inclusive")[n] for n in (49, 98))
        times = f"p50 {p50:.1f} ms, p99 {p99:.1f} ms, most {1e3 * max(each):.0f} ms"
        say(f"  a neighbour's look-ups {name}: {len(each)}, {times}")
    say(f"  {neighbour.errors} errors, {memory_mb:+.1f} MB, {cpu_s:.1f} s of the service's CPU")
    return neighbour.errors == 0 and statistics.quantiles(took_s, n=100, method="inclusive")[98] < P99_S


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.faults.hostile", description=__doc__)
    parser.add_argument("--only", choices=("table", "attack"))
    parser.add_argument("--seconds", type=float, default=60.0, help="how long each attack lasts")
    asked = parser.parse_args()
    say(describe_machine())
    with tempfile.TemporaryDirectory(prefix="stilb-hostile-") as name:
        data = Path(name)
        ids = fill(data)
        with serving(data) as service:
            holds = []
            if asked.only != "attack":
                table = Table(service, ids)
                table.run()
                holds.append(not table.failures)
                say(f"{len(table.failures)} failures")
                size = len(httpx.get(f"{service.url}/metrics", timeout=60).content)
                say(f"/metrics has {size / 1000:.0f} kB now")
            if asked.only != "table":
                for paths in (["/v1/cameras"], ["/v1/cameras", *OPEN]):
                    is_served = attack(service, ids["camera_id"], paths=paths, lasts_s=asked.seconds)
                    holds.append(is_served)
            return 0 if all(holds) else 1


def fill(data: Path) -> dict[str, str]:
    """Make one of each thing in the data folder of a service; return their ids by the names in paths."""
    database = Database(f"sqlite:///{data / 'stilb.sqlite'}")
    try:
        migrate(database)
        with House(database, data) as house:
            return make_one_of_each(house)
    finally:
        database.dispose()


if __name__ == "__main__":
    sys.exit(main())
