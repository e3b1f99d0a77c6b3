"""Simulated jobs that only take time: the rate of many workers beside one's, and what waits without any.

``python -m bench.workers`` forks a worker for each line of its input, with Celery and one thread. Their jobs
sleep: no decoder is needed.
"""

import os
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
from bench.report import judge, say
from bench.subject import Scale
from bench.timing import Ratio, Seconds, compare
from service.launch.lifeline import die_with_parent
from service.launch.valkey import valkey_binary, valkey_command
from store.broker import Hints
from store.columns import new_id
from store.database import Database
from store.jobs import Claim
from store.migrate import migrate
from store.parts import Presence
from store.settings import Settings, read_settings
from store.tables import Job, Organisation
from tests.support.postgres import PostgresServer
from worker import runner
from worker.__main__ import build_context, build_threads, listen
from worker.context import Context
from worker.tasks import Outcome

_HINTS_PER_S = 10
"""Of uploads that go on while no worker takes their jobs."""
_WITHIN_S = 60.0


class _Queue:
    """A database with jobs, a broker with hints, and the environment of processes that use them."""

    def __init__(self, folder: Path, database_url: str, stack: ExitStack) -> None:
        self._folder = folder
        settings = Settings(data=folder, database_url=database_url)
        given = {name: value for name, value in os.environ.items() if not name.startswith("STILB_")}
        own = {"STILB_DATA": str(folder), "STILB_DATABASE_URL": database_url, "STILB_WORKER_THREADS": "1"}
        self._environment = given | own
        self._log = stack.enter_context((folder / "log").open("wb"))
        socket = folder / "valkey.sock"
        stack.enter_context(self.running(valkey_command(valkey_binary(), folder, socket)))
        self.broker = stack.enter_context(redis.Redis(unix_socket_path=str(socket)))
        self.hints = Hints(settings.effective_broker_url)
        self._database = Database(settings.effective_database_url)
        stack.callback(self._database.dispose)
        migrate(self._database)
        with self._database.writing("bench") as session:
            session.add(Organisation(id="org_bench", name="bench"))

    @contextmanager
    def running(self, command: list[str]) -> "Iterator[subprocess.Popen[bytes]]":
        with subprocess.Popen(
            command,
            env=self._environment,
            stdin=subprocess.PIPE,
            stdout=self._log,
            stderr=self._log,
            preexec_fn=die_with_parent(),  # noqa: PLW1509  it takes no lock
        ) as process:
            try:
                yield process
            finally:
                process.kill()

    def add(self, count: int, *, kind: str = "fit", lasts_s: float = 0.0) -> list[str]:
        """Queue jobs, without a hint."""
        rows = [
            {
                "id": new_id("job"),
                "organisation_id": "org_bench",
                "kind": kind,
                "lane": kind,
                "subject_id": new_id("cmp"),
                "created_by": "bench",
                "parameters": {"lasts_s": lasts_s},
            }
            for _ in range(count)
        ]
        with self._database.writing("bench") as session:
            write_rows(session, {Job: rows})
        return [str(row["id"]) for row in rows]

    def is_empty(self) -> bool:
        return not self._count(Job.state.in_(("queued", "running")))

    def is_held_back(self) -> bool:
        """Return True once a job has found that the file store does not serve."""
        return self._count(Job.waits_for.is_not(None)) > 0

    def _count(self, which: ColumnElement[bool]) -> int:
        with self._database.reading() as session:
            return session.scalar(select(func.count()).select_from(Job).where(which)) or 0

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

    def count_listeners(self) -> int:
        """Return how many workers wait for a message."""
        return int(self.broker.info("clients")["blocked_clients"])


def run(scale: Scale, postgres: PostgresServer) -> list[bool]:
    """Measure on the empty PostgreSQL database that BENCH_POSTGRES names, else on a new one."""
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name, ExitStack() as stack:
        url = os.environ.get("BENCH_POSTGRES") or postgres.new_database()
        queue = _Queue(Path(name), url, stack)
        say(f"\njobs of {scale.job_s:g} s for one worker and for {scale.workers}, on PostgreSQL")
        with queue.running([sys.executable, "-m", "bench.workers"]) as mother:
            one = _work_off(queue, scale, mother, workers=1)
            all_of_them = _work_off(queue, scale, mother, workers=scale.workers, before=1)
        rate = compare([scale.workers * spent for spent in one], all_of_them)
        return [
            judge("rate of all, to one's", rate, at_least=0.75 * scale.workers),
            *_wait_without_workers(queue, scale),
            *_wait_beside_a_worker(queue, scale),
        ]


def _work_off(
    queue: _Queue, scale: Scale, mother: "subprocess.Popen[bytes]", *, workers: int, before: int = 0
) -> Seconds:
    """Fork the workers that are missing; time rounds from the first hint to the end of the last job."""
    assert mother.stdin is not None  # noqa: S101  narrows the type
    mother.stdin.write(b"\n" * (workers - before))
    mother.stdin.flush()
    _wait_until(lambda: queue.count_listeners() == workers)
    seconds = []
    for _ in range(scale.rounds_of_jobs):
        ids = queue.add(scale.jobs_each * workers, lasts_s=scale.job_s)
        began = time.perf_counter()
        queue.hints.send(ids)
        _wait_until(queue.is_empty)
        seconds.append(time.perf_counter() - began)
    say(f"  {workers}: {scale.jobs_each} jobs each in {', '.join(f'{each:.2f}' for each in seconds)} s")
    return seconds


def _wait_without_workers(queue: _Queue, scale: Scale) -> list[bool]:
    say(f"\n{scale.waiting_jobs:,} jobs that wait for {scale.waits_s:g} s while hints are sent to nobody")
    ids = queue.add(scale.waiting_jobs)
    queue.hints.send(ids)
    time.sleep(min(1.0, scale.waits_s))
    before = queue.read_memory()
    for number in range(int(scale.waits_s * _HINTS_PER_S)):
        queue.hints.send([ids[number % len(ids)]])
        time.sleep(1 / _HINTS_PER_S)
    grown = queue.read_memory() / before
    return [judge("the broker's memory at the end, to the start", Ratio(grown, grown, grown), at_most=1.1)]


def _wait_beside_a_worker(queue: _Queue, scale: Scale) -> list[bool]:
    say(f"\n{scale.waiting_jobs:,} jobs beside a worker that may take none, as the file store does not serve")
    queue.clear()
    with queue.running([sys.executable, "-m", "bench.workers"]) as mother:
        assert mother.stdin is not None  # noqa: S101  narrows the type
        mother.stdin.write(b"\n")
        mother.stdin.flush()
        _wait_until(lambda: queue.count_listeners() == 1)
        queue.lose_files()
        ids = queue.add(scale.waiting_jobs, kind="extract")
        _wait_until(queue.is_held_back)
        queue.hints.send(ids)
        time.sleep(min(1.0, scale.waits_s))
        (worker,) = list_tree(mother.pid)[1:]
        before_s, sent = read_cpu_s(worker), queue.count_messages()
        time.sleep(scale.waits_s)
        percent, sent = 100 * (read_cpu_s(worker) - before_s) / scale.waits_s, queue.count_messages() - sent
    return [
        judge("its CPU, % of a core", Ratio(percent, percent, percent), at_most=1.0),
        judge("messages meanwhile", Ratio(sent, sent, sent), at_most=0.0),
    ]


def _wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + _WITHIN_S
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError("the queue is not as it should be")
        time.sleep(0.01)


def _sleep(context: Context, claim: Claim) -> Outcome:
    if claim.kind == "extract":
        context.blobs.check()
    time.sleep(claim.parameters["lasts_s"])
    return Outcome(store=lambda _session: {})


def _work(settings: Settings) -> None:
    """Be a worker in all but its jobs."""
    runner.work = _sleep
    context = build_context(settings)
    threads = build_threads(settings, context, Presence(context.database, "worker", threads=1))
    threads.start()
    listen(settings, threads)


def main() -> None:
    """Fork the workers, which end with this process."""
    tie = die_with_parent()
    settings = read_settings()
    for _ in sys.stdin:
        if os.fork() == 0:
            tie()
            _work(settings)


if __name__ == "__main__":
    main()
