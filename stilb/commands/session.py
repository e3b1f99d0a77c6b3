"""Signing in and out, and the stored login."""

from dataclasses import asdict, dataclass
from http import HTTPStatus
from typing import Literal

import typer

from stilb.client import Client
from stilb.commands.output import Exit, Output, command, config_folder
from stilb.commands.terminal import table
from stilb.login import Login, forget_login, keep_login
from stilb.problem import Problem, Unclear
from stilb.records import OwnKey
from stilb.resources.organisation import Health
from stilb.transport import without_none


@command
def login(
    output: Output, address: str = typer.Argument(..., metavar="URL", help="Address of the service.")
) -> None:
    """Sign in: the key is checked, then stored for you only.

    It is asked for, unless --key or STILB_KEY gives it, and kept in a file of mode 600.
    """
    address = address.rstrip("/")
    if not address.startswith(("http://", "https://")):
        raise Unclear(f"{address} is not an address: it must begin with http:// or https://")
    key = output.key or _ask_for_key()
    with Client(address, key, retries=2) as client:
        own = _own_key(client, address)
    path = keep_login(config_folder(), Login(url=address, key=key))
    output.answer(
        {"url": address, **own.raw, "kept_in": str(path)}, f"{_sentence(address, own)}. Stored in {path}"
    )


def _ask_for_key() -> str:
    try:
        return str(typer.prompt("Key", hide_input=True, err=True)).strip()
    except typer.Abort as end:
        # a script has no terminal to type at
        if isinstance(end.__context__, EOFError):
            raise Unclear("no key was entered: give it with --key, or in STILB_KEY") from end
        raise


def _own_key(client: Client, address: str) -> OwnKey:
    try:
        return client.own_key()
    except Problem as problem:
        if problem.status != HTTPStatus.NOT_FOUND:
            raise
        raise Unclear(
            f"{address} is not the address of a service. Give it without a path: http://127.0.0.1:8000"
        ) from problem


@command
def logout(output: Output) -> None:
    """Delete the key on this machine. It stays valid until an administrator revokes it."""
    there = forget_login(config_folder())
    output.answer({"signed_out": there}, "Signed out." if there else "You were not signed in.")


@command
def whoami(output: Output) -> None:
    """Show the stored key: its owner, service and scopes."""
    found = output.login()
    with output.client() as client:
        own = client.own_key()
    output.answer({"url": found.url, **own.raw}, _sentence(found.url, own))


def _sentence(url: str, own: OwnKey) -> str:
    return f"{own.name!r} of {own.organisation} at {url}, may {', '.join(own.scopes)}"


State = Literal["ok", "warn", "fail", "unknown"]
_QUEUE_WARNS_S = 60.0
_CLOCK_WARNS_S, _CLOCK_FAILS_S = 5.0, 300.0
_DISK_WARNS_BYTES, _DISK_FAILS_BYTES = 20e9, 1e9


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One check; ``detail`` says what to do if it is not ok."""

    check: str
    state: State
    detail: str


@command
def doctor(output: Output) -> None:
    """Check the service, its queue, disk and clock, and your key."""
    login = output.login()
    with output.client(retries=0) as client:
        health = client.health()
        findings = examine_health(health)
        own = client.own_key()
    detail = f"{own.name!r} of {own.organisation}: {', '.join(own.scopes)}"
    findings.append(Finding(check="key", state="ok", detail=detail))
    told = {"url": login.url, "checks": [asdict(each) for each in findings], **without_none(asdict(health))}
    output.answer(told, table(("check", "", ""), [(f.check, f.state, f.detail) for f in findings]))
    if any(each.state == "fail" for each in findings):
        raise typer.Exit(Exit.FINDINGS)


def examine_health(health: Health) -> list[Finding]:
    answer = f"{health.detail}; answered in {health.answered_in_s:.2f} s"
    ready: tuple[State, str] = ("ok" if health.ready else "fail", answer)
    quarantine: tuple[State, str] | None = None if health.quarantined_jobs is None else ("ok", "no jobs")
    if lost := health.quarantined_jobs:
        quarantine = "warn", f"{lost} jobs have lost three workers each: stilb jobs --state quarantined"
    checks: dict[str, tuple[State, str] | None] = {
        "ready": ready,
        "version": None if health.version is None else ("ok", health.version),
        "queue": None if health.oldest_queued_s is None else _judge_queue(health.oldest_queued_s),
        "quarantine": quarantine,
        "disk": None if health.free_bytes is None else _judge_disk(health.free_bytes),
        "clock": None if health.clock_ahead_s is None else _judge_clock(health.clock_ahead_s),
    }
    untold: tuple[State, str] = "unknown", "not available here (/metrics is not open): ask the operator"
    judged = {name: found or untold for name, found in checks.items()}
    return [Finding(check=name, state=state, detail=detail) for name, (state, detail) in judged.items()]


def _judge_queue(oldest_s: float) -> tuple[State, str]:
    if oldest_s > _QUEUE_WARNS_S:
        busy = "the workers are busy or down; tell the operator"
        return "warn", f"a job has waited for {oldest_s:.0f} s: {busy}"
    return "ok", f"the oldest job has waited for {oldest_s:.0f} s"


def _judge_disk(free_bytes: int) -> tuple[State, str]:
    free = f"{free_bytes / 1e9:.1f} GB free, room for {free_bytes / 42e6:.0f} frames of 21 megapixels"
    if free_bytes < _DISK_FAILS_BYTES:
        return "fail", f"{free}: nothing can be sent; tell the operator"
    return (
        ("warn", f"{free}: tell the operator before a campaign")
        if free_bytes < _DISK_WARNS_BYTES
        else ("ok", free)
    )


def _judge_clock(ahead_s: float) -> tuple[State, str]:
    side = "behind" if ahead_s > 0 else "ahead of"
    apart = f"this machine's clock is {abs(ahead_s):.0f} s {side} the service's"
    if abs(ahead_s) > _CLOCK_FAILS_S:
        return "fail", f"{apart}: set it, otherwise times entered here (--from, --at) are wrong"
    return ("warn", apart) if abs(ahead_s) > _CLOCK_WARNS_S else ("ok", f"{ahead_s:+.1f} s")
