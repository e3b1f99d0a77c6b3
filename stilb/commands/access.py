"""Access: signing in and out, the organisation with its keys and audit trail, and how the service fares."""

from dataclasses import asdict, dataclass
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Literal

import typer

from stilb.client import Client
from stilb.commands.output import (
    Exit,
    Login,
    Output,
    command,
    config_folder,
    forget_login,
    keep_login,
    read_moment,
)
from stilb.commands.terminal import table
from stilb.problem import Problem, Unclear
from stilb.records import OwnKey
from stilb.resources.organisation import Health
from stilb.transport import without_none

app = typer.Typer(no_args_is_help=True, help="Manage the keys of your organisation.")


PersonNamed = Annotated[
    str | None, typer.Option(help='Who uses it: certificates name who fitted and approved. "" for nobody.')
]
RoleNamed = Annotated[str | None, typer.Option(help="Of the person in the laboratory.")]


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
    said = f"{_sentence(address, own)}. Stored in {path}"
    output.answer({"url": address, **own.raw, "kept_in": str(path)}, said)


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
        message = f"{address} is not the address of a service. Give it without a path: http://127.0.0.1:8000"
        raise Unclear(message) from problem


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
Limit = tuple[float, State, str]  # above which a value is of a state, and what to do then
_READY: Limit = (0.0, "fail", "")
_QUEUE: Limit = (60.0, "warn", ": the workers are busy or down; tell the operator")
_QUARANTINE: Limit = (0.0, "warn", ": stilb jobs --state quarantined")
_DISK: tuple[Limit, ...] = (
    (-1e9, "fail", ": nothing can be sent; tell the operator"),
    (-20e9, "warn", ": tell the operator before a campaign"),
)
_CLOCK: tuple[Limit, ...] = (
    (300.0, "fail", ": set it, otherwise times entered here (--from, --at) are wrong"),
    (5.0, "warn", ""),
)


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
    free, ahead_s = health.free_bytes or 0, health.clock_ahead_s or 0.0
    answer = f"{health.detail}; answered in {health.answered_in_s:.2f} s"
    waited = f"the oldest job has waited for {health.oldest_queued_s or 0.0:.0f} s"
    lost = f"jobs that have lost three workers each: {health.quarantined_jobs}"
    room = f"{free / 1e9:.1f} GB free, room for {free / 42e6:.0f} frames of 21 megapixels"
    side = "behind" if ahead_s > 0 else "ahead of"
    apart = f"this machine's clock is {abs(ahead_s):.0f} s {side} the service's"
    return [
        _judge("ready", not health.ready, answer, _READY),
        _judge("version", None if health.version is None else 0.0, str(health.version)),
        _judge("queue", health.oldest_queued_s, waited, _QUEUE),
        _judge("quarantine", health.quarantined_jobs, lost, _QUARANTINE),
        _judge("disk", None if health.free_bytes is None else -free, room, *_DISK),
        _judge("clock", None if health.clock_ahead_s is None else abs(ahead_s), apart, *_CLOCK),
    ]


def _judge(check: str, value: float | None, detail: str, *limits: Limit) -> Finding:
    """Judge a value by the first limit that it exceeds; None is not told."""
    if value is None:
        detail = "not available here (/metrics is not open): ask the operator"
        return Finding(check=check, state="unknown", detail=detail)
    passed = [(state, advice) for limit, state, advice in limits if value > limit]
    state, advice = passed[0] if passed else ("ok", "")
    return Finding(check=check, state=state, detail=detail + advice)


@app.command("list", epilog="Example: stilb key list")
@command
def list_keys(
    output: Output, *, every: bool = typer.Option(False, "--all", help="Also those that ended.")
) -> None:
    """Show keys with scopes, end and last use."""
    with output.client() as client:
        found = [key for key in client.api_keys() if every or not key.ended]
    rows = [
        (
            *(key.name, key.person or "", ", ".join(key.scopes), key.state),
            *(f"{key.last_used_at:%Y-%m-%dT%H:%MZ}" if key.last_used_at else "never", key.id),
        )
        for key in found
    ]
    columns = ("name", "person", "scopes", "state", "last used", "key")
    output.answer({"items": [key.raw for key in found]}, table(columns, rows))


@app.command("create", epilog="Example: stilb key create laptop --scope read --scope upload")
@command
def create_key(
    output: Output,
    name: str = typer.Argument(..., metavar="NAME", help="Person or device that uses it."),
    scope: list[str] = typer.Option(..., help="read, upload, calibrate, publish, admin; repeatable."),
    expires: str | None = typer.Option(None, help="Day, or time with its zone."),
    person: PersonNamed = None,
    role: RoleNamed = None,
) -> None:
    """Make a key and print its secret, once."""
    with output.client() as client:
        who = without_none({"person": person, "role": role})
        made = client.create_key(name, scope, expires_at=read_moment(expires), **who)
    output.note(f"Key {made.name!r} ({made.id}) was made. The secret is not shown again:")
    output.answer(made.raw, str(made.secret))


@app.command("change", epilog='Example: stilb key change laptop --person "A. Meier" --role physicist')
@command
def change_key(
    output: Output,
    named: str = typer.Argument(..., metavar="KEY", help="Its id or name."),
    person: PersonNamed = None,
    role: RoleNamed = None,
) -> None:
    """State who uses a key, as certificates name them."""
    with output.client() as client:
        changed = client.change_key(named, **without_none({"person": person, "role": role}))
    whose = f"{changed.person}, {changed.role}" if changed.person else "nobody"
    output.answer(changed.raw, f"Key {changed.name!r} ({changed.id}) is used by {whose}")


@app.command("revoke", epilog="Example: stilb key revoke key_01")
@command
def revoke_key(
    output: Output, named: str = typer.Argument(..., metavar="KEY", help="Its id or name.")
) -> None:
    """Revoke a key and end its sessions."""
    with output.client() as client:
        ended = client.revoke_key(named)
    output.answer(ended.raw, f"Key {ended.name!r} ({ended.id}) is revoked")


@command
def organisation(
    output: Output,
    time_zone: str | None = typer.Option(
        None, help='Of the cameras, for files without an offset: Europe/Berlin, +02:00, or "".'
    ),
    name: str | None = typer.Option(None, help="As certificates print it."),
    address: str | None = typer.Option(None, help='As certificates print it, or "" for none.'),
) -> None:
    """Show your organisation, or change what it states."""
    change = without_none({"time_zone": time_zone, "name": name, "address": address})
    with output.client() as client:
        found = client.change_organisation(**change) if change else client.organisation()
    rows = [(name, str(found[name])) for name in ("id", "name", "address", "time_zone") if name in found]
    output.answer(found, table(("", "organisation"), rows))


@command
def audit(
    output: Output,
    save: Path | None = typer.Option(None, help="Also save the entries, as .csv or .jsonl."),
    start: str | None = typer.Option(None, "--from", help="Save those since this day or time."),
    end: str | None = typer.Option(None, "--to", help="Save those before it."),
) -> None:
    """Check the chain of the audit trail."""
    period = {"from": read_moment(start), "to": read_moment(end)}
    with output.client() as client:
        if save is not None:
            client.save_audit(save, **{name: moment for name, moment in period.items() if moment})
        found = client.check_audit()
    whole = f"the chain is intact: {found.entries} entries, head {found.head}"
    broken = f"the chain is broken at {found.broken_at}: {found.detail}"
    output.answer(found.raw, whole if found.state == "intact" else broken)
    if found.state != "intact":
        raise typer.Exit(Exit.FINDINGS)
