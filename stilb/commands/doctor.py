"""Health checks of the service, and of the difference of the clocks."""

from dataclasses import asdict, dataclass
from typing import Literal

import typer

from stilb.commands.exits import Exit
from stilb.commands.output import Output, command, without_none
from stilb.commands.tables import table
from stilb.health import Health

_QUEUE_WARNS_S = 60.0
_CLOCK_WARNS_S = 5.0
_CLOCK_FAILS_S = 300.0
_DISK_WARNS_BYTES = 20e9
_DISK_FAILS_BYTES = 1e9


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One check; ``detail`` says what to do if it is not ok."""

    check: str
    state: Literal["ok", "warn", "fail", "unknown"]
    detail: str


@command
def doctor(output: Output) -> None:
    """Check the service, its queue, disk and clock, and your key."""
    login = output.login()
    with output.client(retries=0) as client:
        health = client.health()
        findings = examine_health(health)
        own = client.own_key()
    findings.append(
        Finding(
            check="key", state="ok", detail=f"{own.name!r} of {own.organisation}: {', '.join(own.scopes)}"
        )
    )
    told = {"url": login.url, "checks": [asdict(each) for each in findings], **without_none(asdict(health))}
    output.answer(told, table(("check", "", ""), [(f.check, f.state, f.detail) for f in findings]))
    if any(each.state == "fail" for each in findings):
        raise typer.Exit(Exit.FINDINGS)


def examine_health(health: Health) -> list[Finding]:
    """Evaluate the health data of a service."""
    answer = f"{health.detail}; answered in {health.answered_in_s:.2f} s"
    return [
        Finding(check="ready", state="ok" if health.ready else "fail", detail=answer),
        _version(health.version),
        _queue(health.oldest_queued_s),
        _quarantine(health.quarantined_jobs),
        _disk(health.free_bytes),
        _clock(health.clock_ahead_s),
    ]


def _version(version: str | None) -> Finding:
    if version is None:
        return _untold("version")
    return Finding(check="version", state="ok", detail=version)


def _queue(oldest_s: float | None) -> Finding:
    if oldest_s is None:
        return _untold("queue")
    if oldest_s > _QUEUE_WARNS_S:
        detail = f"a job has waited for {oldest_s:.0f} s: the workers are busy or down; tell the operator"
        return Finding(check="queue", state="warn", detail=detail)
    return Finding(check="queue", state="ok", detail=f"the oldest job has waited for {oldest_s:.0f} s")


def _quarantine(count: int | None) -> Finding:
    if count is None:
        return _untold("quarantine")
    if count:
        detail = f"{count} jobs have lost three workers each: stilb jobs --state quarantined"
        return Finding(check="quarantine", state="warn", detail=detail)
    return Finding(check="quarantine", state="ok", detail="no jobs")


def _disk(free_bytes: int | None) -> Finding:
    if free_bytes is None:
        return _untold("disk")
    free = f"{free_bytes / 1e9:.1f} GB free, room for {free_bytes / 42e6:.0f} frames of 21 megapixels"
    if free_bytes < _DISK_FAILS_BYTES:
        return Finding(check="disk", state="fail", detail=f"{free}: nothing can be sent; tell the operator")
    if free_bytes < _DISK_WARNS_BYTES:
        return Finding(check="disk", state="warn", detail=f"{free}: tell the operator before a campaign")
    return Finding(check="disk", state="ok", detail=free)


def _clock(ahead_s: float | None) -> Finding:
    if ahead_s is None:
        return _untold("clock")
    side = "behind" if ahead_s > 0 else "ahead of"
    apart = f"this machine's clock is {abs(ahead_s):.0f} s {side} the service's"
    if abs(ahead_s) > _CLOCK_FAILS_S:
        detail = f"{apart}: set it, otherwise times entered here (--from, --at) are wrong"
        return Finding(check="clock", state="fail", detail=detail)
    if abs(ahead_s) > _CLOCK_WARNS_S:
        return Finding(check="clock", state="warn", detail=apart)
    return Finding(check="clock", state="ok", detail=f"{ahead_s:+.1f} s")


def _untold(check: str) -> Finding:
    detail = "not available here (/metrics is not open): ask the operator"
    return Finding(check=check, state="unknown", detail=detail)
