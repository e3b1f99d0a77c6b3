"""Metrics for Prometheus."""

import os
import shutil
from collections.abc import Iterable, Iterator, Mapping
from itertools import accumulate, chain, product
from pathlib import Path
from threading import Lock
from time import monotonic
from typing import get_args

from prometheus_client import Counter, Histogram, Metric, disable_created_metrics, generate_latest
from prometheus_client.core import GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.multiprocess import MultiProcessCollector
from prometheus_client.registry import Collector
from sqlalchemy.orm import Session

from service.schemas.frames import State as FrameState
from service.schemas.jobs import State as JobState
from store.blobs import Damage
from store.jobs import Dependency
from store.jobs.processes import BOUNDS_S, Kind, Part
from store.jobs.processes import State as PartState
from store.queries.jobs import QueueCounts, Totals, count_queue, count_totals
from store.software import read_version

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
        """Count a request that has its answer."""
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
    waiting, away = _all(queue.waiting_for, Dependency), _all(queue.workers_without, Dependency)
    damaged = _all(totals.damaged_files, get_args(Damage))
    quotas = totals.largest_organisation
    by_label: tuple[tuple[str, str, str, Mapping[str, float]], ...] = (
        ("jobs", "Jobs by state.", "state", _all(totals.jobs | queue.jobs, get_args(JobState))),
        (
            "jobs_failed",
            "Failed or quarantined jobs by their error's code.",
            "code",
            queue.failures,
        ),
        ("jobs_waiting_for", "Queued jobs whose last attempt found this away.", "dependency", waiting),
        ("workers_without", "Workers that hold jobs back, as this does not serve.", "dependency", away),
        ("worker_sandbox", "Workers by the level of their decoders' sandbox.", "level", queue.sandboxes),
        ("frames", "Frames by state.", "state", _all(totals.frames, get_args(FrameState))),
        ("refusals", "Refused frames by the code of their refusal.", "code", totals.refusals),
        ("damaged_files", "Files unlike their upload; the same upload heals one.", "state", damaged),
        ("largest_organisation", "The most that any organisation uses of a quota.", "quota", quotas),
        ("info", "The version that serves.", "version", {read_version(): 1}),
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
    for kind, state in product(get_args(Kind), get_args(PartState)):
        parts.add_metric((kind, state), queue.count_parts(kind, state))
    yield parts
    yield _show_durations(queue.parts)


def _all(counts: Mapping[str, int], states: Iterable[str]) -> dict[str, int]:
    return {str(state): counts.get(state, 0) for state in states}


def _show_durations(parts: Iterable[Part]) -> Metric:
    # by slot: a successor counts from zero, as Prometheus expects of a restart
    family = HistogramMetricFamily(
        "stilb_job_duration_seconds",
        "Time that a worker took for a job, by worker since its start.",
        labels=("kind", "part"),
    )
    bounds = [*map(str, BOUNDS_S), "+Inf"]
    for part in parts:
        for kind, (*counts, sum_s) in part.details.get("job_seconds", {}).items():
            buckets = list(zip(bounds, accumulate(counts), strict=True))
            family.add_metric((kind, part.id), buckets, sum_s)
    return family
