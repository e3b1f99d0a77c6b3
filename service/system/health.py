"""Health of the service and its metrics for Prometheus."""

import asyncio
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import accumulate, chain, product
from pathlib import Path
from threading import Lock
from time import monotonic
from typing import Any, get_args

from prometheus_client import Counter, Histogram, Metric, disable_created_metrics, generate_latest
from prometheus_client.core import GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.multiprocess import MultiProcessCollector
from prometheus_client.registry import Collector
from sqlalchemy import delete
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from radiometry.findings import Finding as Entry
from radiometry.findings import interface
from radiometry.records import Record
from store import files, jobs, software, tables
from store.blobs import Blobs, Damage, StorageFull, StorageUnavailable
from store.database import Database, SchemaDiffers, require_own_schema
from store.queries.jobs import QueueCounts, Totals, count_queue, count_totals

ANSWER_WITHIN_S = 1.5
_SILENT_AFTER_S = 2.5
"""Later than `ANSWER_WITHIN_S`: on a busy machine a single look may take longer than a request may wait."""
_FRESH_S = 1.0
_TRUSTED_FOR_S = 5.0  # how long what was found is held against a look that is slow
_WRITE_WITHIN_S = 10.0  # others may hold SQLite's write lock for a while, and nothing is wrong
_NOBODY = ""


class Finding(Record):
    """Result of one check, or that it has not come back."""

    name: str
    code: Entry | None = None
    detail: str = ""
    slow_s: float = 0.0  # how long the present look has taken, where that is longer than it should


class Report(Record):
    findings: list[Finding]
    parts: list[tables.PartRow]
    damaged_files: int

    @property
    def unfit(self) -> Finding | None:
        """The first reason for which requests cannot be served."""
        return next((finding for finding in self.findings if finding.code is not None), None)

    @property
    def warnings(self) -> list[str]:
        """Return what is wrong while requests can be served: what they ask for waits."""
        at_work = {part.kind for part in self.parts if part.state == "working"}
        return [
            *([] if "worker" in at_work else ["no worker is at work: jobs wait"]),
            *(f"{each.label.lower()} does not serve the workers: jobs wait" for each in self._missed()),
            *(f"a {part.kind} hangs" for part in self.parts if part.state == "hung"),
            *(
                f"the check of {finding.name} has taken {finding.slow_s:.1f} s so far"
                for finding in self.findings
                if finding.slow_s
            ),
            *([f"stored files damaged or missing: {self.damaged_files}"] if self.damaged_files else []),
        ]

    def _missed(self) -> list[jobs.Dependency]:
        working = (part for part in self.parts if part.state == "working")
        away = {each for part in working for each in part.details.get("away", {})}
        return [each for each in jobs.Dependency if each in away]


@dataclass
class _Check:
    """One thing to look at: at most one look is under way, however many ask and however long it takes."""

    name: str
    code: Entry
    detail: str
    look: Callable[[], Any]
    within_s: float = _SILENT_AFTER_S
    found: Any = None
    _under_way: Future[Any] | None = None
    _begun: float = -_FRESH_S
    _ended: float = -_FRESH_S

    def __post_init__(self) -> None:
        self._finding = Finding(name=self.name, code=self.code, detail="It has not answered yet.")

    def begin(self, pool: ThreadPoolExecutor) -> Future[Any] | None:
        """Start a check unless its answer is known or pending; return the checks that are pending."""
        self._take()
        if self._under_way is None and time.monotonic() - self._ended >= _FRESH_S:
            self._begun = time.monotonic()
            self._under_way = pool.submit(self._try)
        return self._under_way

    def finding(self) -> Finding:
        """Return what is known now: of a look that is merely slow, what the one just before it found."""
        self._take()
        asked_s = time.monotonic() - self._begun
        if self._under_way is None or asked_s < ANSWER_WITHIN_S:
            return self._finding
        # one that may take long says nothing by being slow; of any other only what was found lately counts
        known = self.within_s > _SILENT_AFTER_S or time.monotonic() - self._ended < _TRUSTED_FOR_S
        if asked_s < self.within_s and known:
            return replace(self._finding, slow_s=asked_s)
        return Finding(name=self.name, code=self.code, detail=f"It has not answered for {asked_s:.0f} s.")

    def _try(self) -> Any:  # noqa: ANN401
        """Return what is found; an expected error too, since nobody may be left who would hear of it."""
        try:
            return self.look()
        except (SQLAlchemyError, StorageFull, StorageUnavailable, OSError) as error:
            return error
        finally:
            # not when it is taken: that may be long after
            self._ended = time.monotonic()

    def _take(self) -> None:
        if self._under_way is None or not self._under_way.done():
            return
        found = self._under_way.result()
        if isinstance(found, SchemaDiffers):
            detail = f"{str(found).capitalize()}."
            self._finding = Finding(name=self.name, code=interface.SCHEMA_MISMATCH, detail=detail)
        elif isinstance(found, Exception):
            self._finding = Finding(name=self.name, code=self.code, detail=self.detail)
        else:
            self.found = found
            self._finding = Finding(name=self.name)
        self._under_way = None


class Health:
    """The checks, and what they last found. All of it but the looks themselves runs in the event loop."""

    def __init__(self, database: Database, blobs: Blobs) -> None:
        self._database = database
        no_database, no_files = interface.DATABASE_UNAVAILABLE, interface.STORAGE_UNAVAILABLE
        self._read = _Check("database", no_database, "The database does not answer.", self._look_at_rows)
        says = "The database takes no writes."
        self._write = _Check("writing", no_database, says, self._try_a_write, _WRITE_WITHIN_S)
        self._files = _Check("files", no_files, "The file store takes no files.", blobs.check)
        self._checks = [self._read, self._write, self._files]
        self._pool = ThreadPoolExecutor(len(self._checks), thread_name_prefix="health")

    async def look(self) -> Report:
        if looks := [look for check in self._checks if (look := check.begin(self._pool)) is not None]:
            await asyncio.wait([asyncio.wrap_future(look) for look in looks], timeout=ANSWER_WITHIN_S)
        findings = [check.finding() for check in self._checks]
        parts, damaged_files = self._read.found or ([], 0)
        return Report(findings=findings, parts=parts, damaged_files=damaged_files)

    def _look_at_rows(self) -> tuple[list[tables.PartRow], int]:
        with self._database.reading() as session:
            require_own_schema(session)
            return jobs.processes.list_parts(session), sum(files.count_damaged(session).values())

    def _try_a_write(self) -> None:
        """Go the way of a write up to the rows: a server that only reads, or a held lock, stops it."""
        with self._database.writing("health") as session:
            session.execute(delete(tables.PartRow).where(tables.PartRow.id == _NOBODY))


disable_created_metrics()  # type: ignore[no-untyped-call]

_REQUEST_BOUNDS_S = (0.005, 0.025, 0.1, 0.5, 2.5, 10.0, 60.0)
_TOTALS_TAKE_S = 0.06
"""Totals that take longer are counted less often, so that they take at most a thousandth of the time."""


class Metrics:
    """The metrics of this process, and what it counted last."""

    def __init__(self) -> None:
        self._durations = Histogram(
            "stilb_request_duration_seconds",
            "Time from a request to the end of its answer.",
            ("method", "route"),
            registry=None,
            buckets=_REQUEST_BOUNDS_S,
        )
        self._requests = Counter(
            "stilb_requests",
            "Requests, by the status of their answer.",
            ("method", "route", "status"),
            registry=None,
        )
        self.wrong_keys = Counter("stilb_wrong_keys", "Keys that opened nothing.", registry=None)
        self.totals_every_s = 60.0
        """Totals are counted once in this time at most, however often the metrics are asked for."""
        self._totals: Totals | None = None
        self._counted_s, self._rests = 0.0, 1.0
        self._counting = Lock()

    def observe(self, method: str, route: str, status: int, *, took_s: float) -> None:
        self._durations.labels(method, route).observe(took_s)
        self._requests.labels(method, route, status).inc()

    def render(self, session: Session, *, data: Path) -> bytes:
        queue = count_queue(session)
        with self._counting:
            began_s = monotonic()
            if self._totals is None or began_s >= self._counted_s + self._rests * self.totals_every_s:
                self._totals = count_totals(session)
                self._counted_s = monotonic()
                self._rests = max(1.0, (self._counted_s - began_s) / _TOTALS_TAKE_S)
            totals = self._totals
        free_bytes = shutil.disk_usage(data).free
        return generate_latest(_Collected([*_collect(queue, totals, free_bytes), *self._collect_requests()]))

    def _collect_requests(self) -> Iterable[Metric]:
        """Return what all processes behind this port counted, also those that were replaced."""
        if "PROMETHEUS_MULTIPROC_DIR" in os.environ:
            return MultiProcessCollector(None).collect()  # type: ignore[no-untyped-call, no-any-return]
        return chain(*(each.collect() for each in (self._durations, self._requests, self.wrong_keys)))


class _Collected(Collector):
    def __init__(self, metrics: Iterable[Metric]) -> None:
        self._metrics = metrics

    def collect(self) -> Iterable[Metric]:
        return self._metrics


def _collect(queue: QueueCounts, totals: Totals, free_bytes: int) -> Iterator[Metric]:
    """Every state has its row, also where it counts none: a graph then falls to zero, not to nothing."""
    waiting, away = _all(queue.waiting_for, jobs.Dependency), _all(queue.workers_without, jobs.Dependency)
    damaged = _all(totals.damaged_files, get_args(Damage))
    quotas = totals.largest_organisation
    by_label: tuple[tuple[str, str, str, Mapping[str, float]], ...] = (
        ("jobs", "Jobs by state.", "state", _all(totals.jobs | queue.jobs, get_args(tables.job.JobState))),
        ("jobs_failed", "Failed or quarantined jobs by their error's code.", "code", queue.failures),
        ("jobs_waiting_for", "Queued jobs whose last attempt found this away.", "dependency", waiting),
        ("workers_without", "Workers that hold jobs back, as this does not serve.", "dependency", away),
        ("worker_sandbox", "Workers by the level of their decoders' sandbox.", "level", queue.sandboxes),
        ("frames", "Frames by state.", "state", _all(totals.frames, get_args(tables.campaign.FrameState))),
        ("refusals", "Refused frames by the code of their refusal.", "code", totals.refusals),
        ("damaged_files", "Files unlike their upload; the same upload heals one.", "state", damaged),
        ("largest_organisation", "The most that any organisation uses of a quota.", "quota", quotas),
        ("info", "The version that serves.", "version", {software.read_version(): 1}),
    )
    for name, meaning, label, rows in by_label:
        family = GaugeMetricFamily(f"stilb_{name}", meaning, labels=(label,))
        for key, count in rows.items():
            family.add_metric((key,), count)
        yield family
    for name, meaning, value in (
        (
            "oldest_queued_job_age_seconds",
            "How long the longest wait of a due job is.",
            queue.oldest_queued_s,
        ),
        ("jobs_due_later", "Queued jobs whose time to be tried again has not come.", queue.due_later),
        ("uploads", "Files that were ever received.", sum(totals.frames.values())),
        ("scrub_age_seconds", "How long ago the file was proven that waits longest.", totals.proof_age_s),
        ("stored_bytes", "Size of the files of all frames.", totals.stored_bytes),
        ("versions_published", "Calibration versions in force at some time.", totals.versions_published),
        ("data_free_bytes", "Room left on the disk of the data folder.", free_bytes),
    ):
        yield GaugeMetricFamily(f"stilb_{name}", meaning, value)
    parts = GaugeMetricFamily("stilb_parts", "Processes by kind and state.", labels=("kind", "state"))
    for kind, state in product(get_args(jobs.processes.Kind), get_args(tables.job.PartState)):
        parts.add_metric((kind, state), queue.count_parts(kind, state))
    yield parts
    yield _show_durations(queue.parts)


def _all(counts: Mapping[str, int], states: Iterable[str]) -> dict[str, int]:
    return {str(state): counts.get(state, 0) for state in states}


def _show_durations(parts: Iterable[tables.PartRow]) -> Metric:
    # by slot: a successor counts from zero, as Prometheus expects of a restart
    family = HistogramMetricFamily(
        "stilb_job_duration_seconds",
        "Time that a worker took for a job, by worker since its start.",
        labels=("kind", "part"),
    )
    bounds = [*map(str, jobs.processes.BOUNDS_S), "+Inf"]
    for part in parts:
        for kind, (*counts, sum_s) in part.details.get("job_seconds", {}).items():
            buckets = list(zip(bounds, accumulate(counts), strict=True))
            family.add_metric((kind, part.id), buckets, sum_s)
    return family
