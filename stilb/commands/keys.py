"""The organisation, its keys and its audit trail."""

from pathlib import Path
from typing import Annotated

import typer

from stilb.commands.output import Exit, Output, command, read_moment
from stilb.commands.terminal import table
from stilb.transport import without_none

app = typer.Typer(no_args_is_help=True, help="Manage the keys of your organisation.")


PersonNamed = Annotated[
    str | None, typer.Option(help='Who uses it: certificates name who fitted and approved. "" for nobody.')
]
RoleNamed = Annotated[str | None, typer.Option(help="Of the person in the laboratory.")]


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
            key.name,
            key.person or "",
            ", ".join(key.scopes),
            key.state,
            f"{key.last_used_at or 'never'}",
            key.id,
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
    output.answer(
        found.raw,
        whole if found.state == "intact" else f"the chain is broken at {found.broken_at}: {found.detail}",
    )
    if found.state != "intact":
        raise typer.Exit(Exit.FINDINGS)
