"""Upload of frames from a folder or a card to a campaign."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import sleep
from typing import Annotated, Any

import typer
from rich.table import Table

from stilb.commands.output import Exit, Output, command, complete_campaign, complete_role, config_folder
from stilb.commands.receipt import write_receipt
from stilb.commands.terminal import lines, name_some, showing, table, tell_retry
from stilb.field.files import ANY_RULES, NIGHT_RULES, ROLES, FieldFile, Rule, place_files, quote, sort_files
from stilb.field.plan import FILENAME, find_planned, read_plan
from stilb.field.push import Journal, Report, Told, Watch, as_json, push_files
from stilb.problem import Problem, Unclear, missing
from stilb.records import Campaign

# About four minutes without a network; longer than that, a person starts the same command again.
_PATIENT_RETRIES = 12

Folder = Annotated[
    Path, typer.Argument(metavar="FOLDER", exists=True, file_okay=False, help="Folder with the frames.")
]
Wait = Annotated[bool, typer.Option("--wait/--no-wait", help="Wait for the verdicts.")]
Every = Annotated[float, typer.Option(min=0.1, help="With --watch: seconds between two checks.")]


@command
def push(  # noqa: PLR0913  each is an option
    output: Output,
    folder: Folder,
    campaign: str | None = typer.Option(
        None, help="Its id or project number; default: campaign.toml.", autocompletion=complete_campaign
    ),
    role: str | None = typer.Option(
        None, help=f"Role of every file: {', '.join(ROLES)}.", autocompletion=complete_role
    ),
    scene: str | None = typer.Option(None, help="Light level of every file."),
    *,
    watch: bool = typer.Option(False, "--watch", help="Follow the folder until Ctrl-C."),
    every: Every = 2.0,
    wait: Wait = True,
    receipt: Path | None = typer.Option(None, help="Where to write the receipt."),
    dry_run: bool = typer.Option(False, "--dry-run", help="Only show role and scene of each file."),
) -> None:
    """Send the frames of a folder that are not yet uploaded.

    It ends with how they are. The same command again goes on where it was. What each file is follows from
    --role or from campaign.toml; otherwise it is proposed, as on the page, from folders, pauses, exposure and
    brightness; --dry-run shows it. When every file has arrived it writes a receipt: stilb receipt verify.
    """
    if role is not None and role not in ROLES:
        raise typer.BadParameter(f"{role!r} is not a role; use one of {', '.join(ROLES)}")
    if scene is not None and role is None:
        raise typer.BadParameter("--scene needs --role")
    # what the caller or campaign.toml states of the files; nothing where it is to be proposed
    planned = role is None and (folder / FILENAME).exists()
    rules = read_plan(folder).rules if planned else (Rule(role=role, scene=scene),) if role else ()
    if dry_run:
        output.answer(*_preview(output, folder, campaign, rules, raw_only=role is None))
        return
    find = partial(_find_campaign, output, folder, campaign)
    campaign_id = (_wait_for_service(output, find, every_s=every) if watch else find()).id
    if watch:
        list_files = partial(sort_files, folder, rules or ANY_RULES, raw_only=role is None)
        listed = partial(_list_or_note, output, list_files)
        follow(
            output, folder, campaign_id, listed, every_s=every, wait=wait, receipt=receipt, placed=not rules
        )
        return
    files, left_out = _list_files(folder, rules or ANY_RULES, raw_only=role is None)
    unread: list[str] = []
    if not rules:
        files, unread = place(output, folder, files, campaign_id=campaign_id)
    report = transfer(
        output, folder, campaign_id, files, left_out=left_out, wait=wait, receipt=receipt, attest=not unread
    )
    finish(output, add_unread(report, unread))


def _preview(
    output: Output, folder: Path, named: str | None, rules: Sequence[Rule], *, raw_only: bool
) -> tuple[dict[str, Any], Table, str]:
    """Return role and scene of each file; the campaign need not have begun."""
    files, left_out = _list_files(folder, rules or ANY_RULES, raw_only=raw_only)
    if not rules:
        about: dict[str, str] = {}
        with output.client() as client:
            plan = read_plan(folder) if named is None and (folder / FILENAME).exists() else None
            if found := client.find_campaign(named) if named else plan and find_planned(client, plan):
                about = {"campaign_id": found.id}
            elif plan:
                about = {"method": plan.method, "kind": plan.kind}
        files, unread = place(output, folder, files, **about)
        left_out += unread
    rows = [{"name": file.name, "role": file.role, "scene": file.scene or ""} for file in files]
    shown = table(("file", "role", "scene"), [tuple(row.values()) for row in rows])
    out = f"left out: {name_some(left_out, 'files')}; " if left_out else ""
    return {"files": rows, "left_out": left_out}, shown, f"{out}nothing was sent"


def _list_files(
    folder: Path, rules: Sequence[Rule], *, raw_only: bool = False
) -> tuple[list[FieldFile], list[str]]:
    files, left_out = sort_files(folder, rules, raw_only=raw_only)
    if not files:
        how = "It contains no raw files."
        if left_out:
            how = f"{', '.join(left_out[:5])}: give their role with --role, or in {FILENAME}."
        raise Unclear(f"No file in {folder} matches a rule. {how}")
    return files, left_out


def send_night(output: Output, folder: Path, named: str | None) -> Report:
    """Send a folder to a campaign that is measured then; without a plan every raw file is a field frame."""
    campaign = _find_campaign(output, folder, named)
    planned = (folder / FILENAME).exists()
    files, left_out = _list_files(folder, read_plan(folder).rules if planned else NIGHT_RULES)
    return transfer(output, folder, campaign.id, files, left_out=left_out)


def transfer(
    output: Output,
    folder: Path,
    campaign_id: str,
    files: Sequence[FieldFile],
    *,
    left_out: Sequence[str] = (),
    wait: bool = True,
    receipt: Path | None = None,
    attest: bool = True,
) -> Report:
    """Bring files to a campaign, patiently, before a person's eyes; then write the receipt."""
    journal = Journal.of(folder, config_folder() / "journals")
    tell = partial(tell_retry, output.err)
    with output.client(retries=_PATIENT_RETRIES, on_retry=tell) as client, showing(output.err) as listener:
        report = push_files(client, campaign_id, files, journal, listener=listener, wait=wait)
        whole = attest and 0 < len(report.files) == report.received
        path = write_receipt(output, client, folder, report, receipt) if whole else None
    return replace(report, left_out=tuple(left_out), receipt=str(path) if path else None)


def add_unread(report: Report, names: Sequence[str]) -> Report:
    """Return the report with the files that were not sent because they have no header."""
    told = (Told.unsent(name, "no raw file, or damaged: its header cannot be read") for name in names)
    return replace(report, files=(*report.files, *told))


def finish(output: Output, report: Report) -> None:
    output.answer(as_json(report), *lines(report))
    if not report.is_well:
        raise typer.Exit(Exit.FINDINGS)


def follow(
    output: Output,
    folder: Path,
    campaign_id: str,
    list_files: Callable[[], list[FieldFile]],
    *,
    every_s: float,
    wait: bool,
    receipt: Path | None,
    placed: bool,
) -> None:
    """Send files as they arrive, until it is stopped; then print the sum. ``placed``: as proposed."""
    watch, sent = Watch(list_files), dict[Path, FieldFile]()
    total = 0
    try:
        output.note(f"watching {folder}; stop with Ctrl-C")
        while True:
            if settled := watch.look():
                try:
                    if placed:
                        files = [*sent.values(), *settled]
                        every, _ = place(output, folder, files, campaign_id=campaign_id)
                        settled = every[len(sent) :]
                    report = transfer(output, folder, campaign_id, settled, attest=False)
                except Problem as problem:  # a network that is lost comes back
                    if not problem.retryable:
                        raise
                    output.note(f"{problem}; these files are sent again at the next check")
                    watch.take_back(settled)
                else:
                    total += report.sent
                    sent |= {file.path: file for file in settled}
                    output.note("\n".join(lines(report)))
            sleep(every_s)
    except KeyboardInterrupt:
        unsent = [file for file in list_files() if file.path not in sent]
        told = tuple(Told.unsent(file.name, "it was not sent: run the same command again") for file in unsent)
        report = Report(campaign_id=campaign_id, files=(), sent=0)
        if sent:
            files = list(sent.values())
            report = transfer(
                output, folder, campaign_id, files, wait=wait, receipt=receipt, attest=not unsent
            )
        finish(output, replace(report, files=report.files + told, sent=total + report.sent))


def _list_or_note(
    output: Output, list_files: Callable[[], tuple[list[FieldFile], list[str]]]
) -> list[FieldFile]:
    """Return the files of a folder; none while it cannot be read, as a card that was pulled out."""
    try:
        return list_files()[0]
    except OSError as error:
        output.note(f"{error.strerror or error}: {error.filename}; the folder is looked at again")
        return []


def _wait_for_service(output: Output, find: Callable[[], Campaign], *, every_s: float) -> Campaign:
    told = False
    while True:
        try:
            return find()
        except Problem as problem:
            if not problem.retryable:
                raise
            if not told:
                output.note(f"{problem}; waiting for the service, stop with Ctrl-C")
            told = True
        sleep(every_s)


def place(
    output: Output, folder: Path, files: Sequence[FieldFile], **about: str
) -> tuple[list[FieldFile], list[str]]:
    """Have the service propose role and scene of each file, and tell the proposal."""
    with output.client() as client:
        placed, unread = place_files(client, folder, files, **about)
    counts = Counter(file.scene or file.role for file in placed)
    output.note(f"proposed: {', '.join(f'{name} {count}' for name, count in counts.items())}")
    return placed, unread


def _find_campaign(output: Output, folder: Path, named: str | None) -> Campaign:
    with output.client() as client:
        if named is not None:
            return client.find_campaign(named)
        if not (folder / FILENAME).exists():
            message = f"give --campaign, or create a {FILENAME}: stilb campaign init {quote(folder)}"
            raise typer.BadParameter(message)
        plan = read_plan(folder)
        if (found := find_planned(client, plan)) is None:
            raise missing(
                f"Campaign {plan.project_number!r} of this camera does not exist yet. "
                f"Create it and send all frames: stilb campaign run {quote(folder)}"
            )
        return found
