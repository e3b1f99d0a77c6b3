"""Jobs that only take time, done by real workers of Celery; start and rest of all that `make up` runs."""

import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import redis
from sqlalchemy import ColumnElement, delete, func, select

from bench import frames, harness
from bench.harness import Scale, Seconds, judge, say
from service.launch.valkey import valkey_binary, valkey_command
from store import database, migrate, settings
from store.jobs.queues import LANES, QUEUES, Post, make_celery, touch
from store.tables import Job, Organisation, new_id
from tests.support.postgres import PostgresServer
from tests.support.processes import family
from tests.support.waiting import wait_for

_NEWCOMER = "org_newcomer"
_wait_until = partial(wait_for, timeout_s=300.0)


class _Queue:
    """A database with jobs, a broker, and workers that use them."""

    def __init__(self, folder: Path, database_url: str, stack: ExitStack) -> None:
        self._settings = settings.Settings(data=folder, database_url=database_url)
        self._environment = harness.make_environment(folder) | {"STILB_DATABASE_URL": database_url}
        self._log = stack.enter_context((folder / "log").open("wb"))
        unix_socket = folder / "valkey.sock"
        self._command = valkey_command(valkey_binary(), folder, unix_socket)
        stack.callback(self.kill_broker)
        self.broker = stack.enter_context(redis.Redis(unix_socket_path=str(unix_socket)))
        self.start_broker()
        post = Post(self._settings.effective_broker_url)
        self._database = database.Database(self._settings.effective_database_url, post=post)
        stack.callback(self._database.dispose)
        migrate.migrate(self._database)
        with self._database.writing("bench") as session:
            session.add_all([Organisation(id=each, name=each) for each in ("org_bench", _NEWCOMER)])

    def start_broker(self) -> None:
        self._server = subprocess.Popen(self._command, stdout=self._log, stderr=self._log)

    def kill_broker(self) -> None:
        self._server.kill()
        self._server.wait()

    @contextmanager
    def working(self, processes: int, *, nodes: int = 1) -> Iterator[list[int]]:
        """Start workers of so many processes together; yield the pids of their parents."""
        words = ["-m", "celery", "-A", "worker.app", "worker", "-I", "bench.sleeping", "-Q", ",".join(QUEUES)]
        words += ["-c", str(processes // nodes), "-n"]
        with ExitStack() as stack:
            started = [
                stack.enter_context(
                    harness.running([*words, f"{node}@bench"], self._environment, self._log)
                ).pid
                for node in range(nodes)
            ]
            # not of the pool of connections, which keeps those to a broker that was killed
            celery = make_celery(self._settings.effective_broker_url)
            with celery, celery.connection_for_write() as connection:
                _wait_until(lambda: len(celery.control.ping(timeout=1, connection=connection) or []) == nodes)
            yield started

    def add(self, count: int, *, lasts_s: float = 0.0, organisation: str = "org_bench") -> None:
        row = {"organisation_id": organisation, "kind": "fit", "lane": "fit", "created_by": "bench"}
        row |= {"parameters": {"lasts_s": lasts_s}}
        with self._database.writing("bench") as session:
            frames.write_rows(session, {Job: (row | {"subject_id": new_id("cmp")} for _ in range(count))})
            touch(session, LANES["fit"].queue)

    def count(self, which: ColumnElement[bool]) -> int:
        with self._database.reading() as session:
            return session.scalar(select(func.count()).select_from(Job).where(which)) or 0

    def clear(self) -> None:
        with self._database.writing("bench") as session:
            session.execute(delete(Job))
        self.broker.flushall()


def run(scale: Scale, postgres: PostgresServer) -> list[bool]:
    """Measure on the empty PostgreSQL database that BENCH_POSTGRES names, else on a new one."""
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name, ExitStack() as stack:
        folder = Path(name)
        queue = _Queue(folder, os.environ.get("BENCH_POSTGRES") or postgres.new_database(), stack)
        say(f"\njobs of {scale.job_s:g} s for one process and for {scale.workers}, on PostgreSQL")
        one = _work_off(queue, scale, processes=1, nodes=1)
        together = _work_off(queue, scale, processes=scale.workers, nodes=2)
        harness.show_times({"one": one, f"{scale.workers}": together})
        rate = harness.compare([scale.workers * spent for spent in one], together)
        return [
            judge("rate of all, to one's", rate, at_least=0.75 * scale.workers),
            *_restart_broker(queue, scale),
        ]


def _work_off(queue: _Queue, scale: Scale, *, processes: int, nodes: int) -> Seconds:
    """Time two rounds from the commit of the jobs to the end of the last."""
    seconds = []
    with queue.working(processes, nodes=nodes):
        for _ in range(2):
            began = time.perf_counter()
            queue.add(3 * processes, lasts_s=scale.job_s)
            _wait_until(lambda: not queue.count(Job.state.in_(("queued", "running"))))
            seconds.append(time.perf_counter() - began)
    return seconds


def _restart_broker(queue: _Queue, scale: Scale) -> Iterator[bool]:
    """Kill the broker for a second while two processes work; then another organisation adds one job."""
    say(f"\n{scale.restarts} restarts of the broker amid {scale.card} jobs of 0.1 s, and one job behind them")
    waits_s = []
    done, newcomer = Job.state == "succeeded", Job.organisation_id == _NEWCOMER
    with queue.working(2):
        queue.clear()
        queue.add(scale.card, lasts_s=0.1)
        for _ in range(scale.restarts):
            queue.kill_broker()
            time.sleep(1.0)  # by which those that ran have ended
            before, began = queue.count(done), time.perf_counter()
            queue.start_broker()
            _wait_until(lambda before=before: queue.count(done) > before)
            waits_s.append(time.perf_counter() - began)
        began = time.perf_counter()
        queue.add(1, organisation=_NEWCOMER)
        _wait_until(lambda: queue.count(newcomer & (Job.state != "queued")) > 0)
        newcomer_s = time.perf_counter() - began
    yield judge("from the broker's start to the next job's end, at most [s]", max(waits_s), at_most=10.0)
    yield judge("until the newcomer's job begins [s]", newcomer_s, at_most=5.0)


def run_start(scale: Scale) -> list[bool]:
    """Measure starts on data that exist, and the last of them at rest, shared pages counted once."""
    say("\nthe whole service at its start and at rest")
    seconds = []
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name:
        for number in range(scale.starts + 1):
            began = time.perf_counter()
            with up(Path(name)) as pid:
                seconds.append(time.perf_counter() - began)
                if number == scale.starts:
                    time.sleep(min(8.0, scale.rests_s))
                    tree = family(pid)
                    before_s = harness.read_cpu_s(*tree)
                    time.sleep(scale.rests_s)
                    percent = 100 * (harness.read_cpu_s(*tree) - before_s) / scale.rests_s
                    memory_mb = sum(map(harness.read_shared_mb, tree))
    start_s = sorted(seconds[1:])[scale.starts // 2]  # the first makes the database
    return [
        judge("`make up` on existing data, until ready [s]", start_s, at_most=2.5),
        judge("CPU at rest, % of a core", percent, at_most=0.5),
        judge("memory at rest, MB", memory_mb, at_most=320.0),
    ]


@contextmanager
def up(data: Path) -> Iterator[int]:
    environment = harness.make_environment(data) | {"STILB_PORT": "0"}
    with harness.running(["-m", "service.up"], environment, subprocess.PIPE) as launcher:
        if not (launcher.stdout and launcher.stdout.readline().startswith(b"ready")):
            raise RuntimeError("the service did not start")
        yield launcher.pid
