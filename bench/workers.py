"""Jobs that only take time, done by real workers of Celery: many beside one, and a broker that fails."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import redis
from sqlalchemy import ColumnElement, delete, func, select

from bench.bulk import write_rows
from bench.memory import list_tree, read_cpu_s
from bench.report import judge, judge_seconds, say
from bench.subject import Scale
from bench.timing import Ratio, Seconds, compare
from service.launch.lifeline import die_with_parent
from service.launch.valkey import valkey_binary, valkey_command
from store.database import Database
from store.jobs.queues import LANES, QUEUES, Post, make_celery, touch
from store.migrate import migrate
from store.settings import Settings
from store.tables import Job, Organisation
from store.tables.base import new_id
from tests.support.postgres import PostgresServer

_TOUCHES_PER_S = 10
"""Uploads that go on while no worker takes their jobs."""
_WITHIN_S = 120.0
_NODES = 2
"""Workers that share the processes."""


class _Queue:
    """A database with jobs, a broker, and workers that use them."""

    def __init__(self, folder: Path, database_url: str, stack: ExitStack) -> None:
        self._folder = folder
        self._stack = stack
        self._socket = folder / "valkey.sock"
        settings = Settings(data=folder, database_url=database_url)
        given = {name: value for name, value in os.environ.items() if not name.startswith("STILB_")}
        self._environment = given | {"STILB_DATA": str(folder), "STILB_DATABASE_URL": database_url}
        self._log = stack.enter_context((folder / "log").open("wb"))
        self.start_broker()
        self.broker = stack.enter_context(redis.Redis(unix_socket_path=str(self._socket)))
        self._database = Database(settings.effective_database_url, post=Post(settings.effective_broker_url))
        stack.callback(self._database.dispose)
        self._broker_url = settings.effective_broker_url
        migrate(self._database)
        with self._database.writing("bench") as session:
            session.add_all(Organisation(id=f"org_{name}", name=name) for name in ("bench", "newcomer"))

    def start_broker(self) -> None:
        command = valkey_command(valkey_binary(), self._folder, self._socket)
        self.broker_process = self._stack.enter_context(self._running(command))

    @contextmanager
    def _running(self, command: list[str]) -> "Iterator[subprocess.Popen[bytes]]":
        with subprocess.Popen(
            command,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
            preexec_fn=die_with_parent(),  # noqa: PLW1509  it takes no lock
        ) as process:
            try:
                yield process
            finally:
                process.kill()

    @contextmanager
    def working(self, processes: int, *, nodes: int = 1) -> Iterator[list[int]]:
        """Start workers of so many processes together; the pids of their parents."""
        words = [sys.executable, "-m", "celery", "-A", "worker.app", "worker", "-I", "bench.sleeping"]
        with ExitStack() as stack:
            started = [
                stack.enter_context(
                    self._running(
                        [
                            *words,
                            "-Q",
                            ",".join(QUEUES),
                            "-c",
                            str(processes // nodes),
                            "-n",
                            f"{number}@bench",
                        ]
                    )
                ).pid
                for number in range(nodes)
            ]
            with make_celery(self._broker_url) as celery:
                _wait_until(lambda: len(celery.control.ping(timeout=1) or []) == nodes)
            yield started

    def add(self, count: int, *, lane: str = "fit", lasts_s: float = 0.0, by: str = "bench") -> list[str]:
        """Queue jobs, whose messages are sent after the commit."""
        kind = {"fit": "fit"}.get(lane, "extract")
        rows = [
            {
                "id": new_id("job"),
                "organisation_id": f"org_{by}",
                "kind": kind,
                "lane": lane,
                "subject_id": new_id("cmp"),
                "created_by": "bench",
                "parameters": {"lasts_s": lasts_s},
            }
            for _ in range(count)
        ]
        with self._database.writing("bench") as session:
            write_rows(session, {Job: rows})
            touch(session, LANES[lane].queue)
        return [str(row["id"]) for row in rows]

    def touch(self) -> None:
        with self._database.writing("bench") as session:
            touch(session)

    def is_empty(self) -> bool:
        return not self.count(Job.state.in_(("queued", "running")))

    def is_held_back(self) -> bool:
        """Return True once a job has found that the file store does not serve."""
        return self.count(Job.waits_for.is_not(None)) > 0

    def count(self, *which: ColumnElement[bool]) -> int:
        with self._database.reading() as session:
            return session.scalar(select(func.count()).select_from(Job).where(*which)) or 0

    def count_wrong(self) -> int:
        """Return how many jobs were begun more than once, or did not succeed."""
        return self.count((Job.fence != 1) | (Job.state != "succeeded"))

    def lose_files(self) -> None:
        """Put a file where the file store would make its folder."""
        (self._folder / "blobs").touch()

    def count_messages(self) -> int:
        """Return how many messages have ever been sent."""
        return int(self.broker.info("commandstats").get("cmdstat_lpush", {}).get("calls", 0))

    def read_memory(self) -> int:
        return int(self.broker.info("memory")["used_memory_dataset"])

    def clear(self) -> None:
        with self._database.writing("bench") as session:
            session.execute(delete(Job))
        self.broker.flushall()


def run(scale: Scale, postgres: PostgresServer) -> list[bool]:
    """Measure on the empty PostgreSQL database that BENCH_POSTGRES names, else on a new one."""
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name, ExitStack() as stack:
        url = os.environ.get("BENCH_POSTGRES") or postgres.new_database()
        queue = _Queue(Path(name), url, stack)
        say(f"\njobs of {scale.job_s:g} s for one process and for {scale.workers}, on PostgreSQL")
        one = _work_off(queue, scale, processes=1, nodes=1)
        all_of_them = _work_off(queue, scale, processes=scale.workers, nodes=_NODES)
        rate = compare([scale.workers * spent for spent in one], all_of_them)
        return [
            judge("rate of all, to one's", rate, at_least=0.75 * scale.workers),
            *_wait_without_workers(queue, scale),
            *_come_late(queue, scale),
            *_lose_the_broker(queue, scale),
            *_wait_beside_a_worker(queue, scale),
        ]


def _work_off(queue: _Queue, scale: Scale, *, processes: int, nodes: int) -> Seconds:
    """Time rounds from the commit of the jobs to the end of the last."""
    seconds = []
    with queue.working(processes, nodes=nodes):
        for _ in range(scale.rounds_of_jobs):
            began = time.perf_counter()
            queue.add(scale.jobs_each * processes, lasts_s=scale.job_s)
            _wait_until(queue.is_empty)
            seconds.append(time.perf_counter() - began)
    told = ", ".join(f"{each:.2f}" for each in seconds)
    say(f"  {processes}: {scale.jobs_each} jobs each in {told} s")
    return seconds


def _wait_without_workers(queue: _Queue, scale: Scale) -> list[bool]:
    say(
        f"\n{scale.waiting_jobs:,} jobs that wait for {scale.waits_s:g} s without a worker, while others come"
    )
    queue.clear()
    queue.add(scale.waiting_jobs)
    before = queue.read_memory()
    for _ in range(int(scale.waits_s * _TOUCHES_PER_S)):
        queue.touch()
        time.sleep(1 / _TOUCHES_PER_S)
    grown = queue.read_memory() / before
    return [judge("the broker's memory at the end, to the start", Ratio(grown, grown, grown), at_most=1.1)]


def _come_late(queue: _Queue, scale: Scale) -> list[bool]:
    say(f"\none job behind {scale.card} of another organisation, on one worker of two processes")
    queue.clear()
    seconds = []
    with queue.working(2):
        queue.add(scale.card, lane="extract", lasts_s=scale.job_s / 4)
        _wait_until(lambda: queue.count(Job.state == "running") == 2)
        for _ in range(scale.rounds_of_jobs):
            began = time.perf_counter()
            (job_id,) = queue.add(1, lane="extract", by="newcomer")
            _wait_until(lambda job_id=job_id: queue.count(Job.id == job_id, Job.state != "queued") == 1)
            seconds.append(time.perf_counter() - began)
    return [judge_seconds("until it begins", seconds, at_most_s=5.0)]


def _lose_the_broker(queue: _Queue, scale: Scale) -> list[bool]:
    """Kill the broker, or stop it, under load; the time until the next job ends after it is back."""
    say(f"\nthe broker is restarted {scale.restarts} times under load, and frozen for {scale.freezes_s:g} s")
    queue.clear()
    with queue.working(2):

        def strike(fault: Callable[[], None]) -> float:
            queue.add(scale.card // 5, lasts_s=scale.job_s / 4)
            _wait_until(lambda: queue.count(Job.state == "running") == 2)
            fault()
            back = time.perf_counter()
            begun = queue.count(Job.state != "queued")
            _wait_until(lambda: queue.count(Job.state != "queued") > begun)
            resumed_s = time.perf_counter() - back
            _wait_until(queue.is_empty)
            return resumed_s

        def restart() -> None:
            queue.broker_process.kill()
            queue.broker_process.wait()
            queue.start_broker()

        def freeze() -> None:
            queue.broker_process.send_signal(signal.SIGSTOP)
            time.sleep(scale.freezes_s)
            queue.broker_process.send_signal(signal.SIGCONT)

        restarts = [strike(restart) for _ in range(scale.restarts)]
        frozen = strike(freeze)
        wrong = float(queue.count_wrong())
    say(f"  restarted: {', '.join(f'{each:.1f}' for each in restarts)} s; frozen: {frozen:.1f} s")
    worst = max(*restarts, frozen)
    return [
        judge("until the next job begins, the longest [s]", Ratio(worst, worst, worst), at_most=10.0),
        judge("jobs lost, or begun twice", Ratio(wrong, wrong, wrong), at_most=1.0),
    ]


def _wait_beside_a_worker(queue: _Queue, scale: Scale) -> list[bool]:
    say(f"\n{scale.waiting_jobs:,} jobs beside a worker that may take none, as the file store does not serve")
    queue.clear()
    with queue.working(1) as (parent,):
        queue.lose_files()
        queue.add(scale.waiting_jobs, lane="extract")
        _wait_until(queue.is_held_back)
        time.sleep(min(1.0, scale.waits_s))
        worker = list_tree(parent)
        before_s, sent = sum(map(read_cpu_s, worker)), queue.count_messages()
        time.sleep(scale.waits_s)
        spent_s = sum(map(read_cpu_s, worker)) - before_s
        percent, sent = 100 * spent_s / scale.waits_s, queue.count_messages() - sent
    return [
        judge("its CPU, % of a core", Ratio(percent, percent, percent), at_most=1.0),
        judge("messages meanwhile", Ratio(sent, sent, sent), at_most=5.0),
    ]


def _wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + _WITHIN_S
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError("the queue is not as it should be")
        time.sleep(0.01)
