"""How a service fares: what it tells of itself, and what its clock says."""

import re
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime

from stilb.problem import Problem
from stilb.transport import Call, Transport

_SAMPLE = re.compile(r'^(?P<name>\w+)(?:\{\w+="(?P<label>[^"]*)"\})? (?P<value>\S+)$', re.MULTILINE)


@dataclass(frozen=True, kw_only=True)
class Health:
    """State of a service when it was asked. None: not reported, as where a proxy keeps /metrics to itself.

    ``clock_ahead_s``: the service's clock minus this machine's, to half a second.
    """

    ready: bool
    detail: str
    answered_in_s: float
    clock_ahead_s: float | None
    version: str | None
    oldest_queued_s: float | None
    quarantined_jobs: int | None
    free_bytes: int | None


def examine(transport: Transport) -> Health:
    """Check once; raises ``Problem`` only where nothing answers at all."""
    sent_at, began = datetime.now(UTC), time.monotonic()
    ready, detail = True, "database and file store answer"
    try:
        date = transport.send(Call(method="GET", path="/readyz")).headers.get("Date")
    except Problem as problem:
        if problem.status == 0:
            raise
        ready, detail, date = False, problem.detail, None
    took_s = time.monotonic() - began
    samples = _read_metrics(transport)
    return Health(
        ready=ready,
        detail=detail,
        answered_in_s=took_s,
        clock_ahead_s=_clock_ahead_s(date, sent_at, took_s),
        version=next((label for name, label in samples if name == "stilb_info"), None),
        oldest_queued_s=samples.get(("stilb_oldest_queued_job_age_seconds", "")),
        quarantined_jobs=_whole(samples.get(("stilb_jobs", "quarantined"))),
        free_bytes=_whole(samples.get(("stilb_data_free_bytes", ""))),
    )


def _read_metrics(transport: Transport) -> dict[tuple[str, str], float]:
    try:
        text = transport.send(Call(method="GET", path="/metrics")).text
    except Problem:
        return {}
    return {(found["name"], found["label"] or ""): float(found["value"]) for found in _SAMPLE.finditer(text)}


def _clock_ahead_s(date: str | None, sent_at: datetime, took_s: float) -> float | None:
    if date is None:
        return None
    try:
        there = parsedate_to_datetime(date)
    except ValueError:
        return None
    # The header holds whole seconds, cut off; the answer was made about halfway.
    return (there - sent_at).total_seconds() + 0.5 - took_s / 2


def _whole(value: float | None) -> int | None:
    return None if value is None else int(value)
