"""Receipts of cards: written after a push, verified offline."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from stilb import receipt as receipts
from stilb.client import Client
from stilb.commands.output import Exit, Output, command, config_folder, print_json
from stilb.commands.terminal import counted
from stilb.field.plan import FILENAME
from stilb.field.push import Report
from stilb.problem import Problem, Unclear
from stilb.transport import write_whole

app = typer.Typer(
    no_args_is_help=True, rich_markup_mode=None, help="Verify receipts; list the service's keys."
)

_NOT_SENT = ": not covered, not sent"

File = Annotated[Path, typer.Argument(exists=True, dir_okay=False, help="The receipt.")]
Key = Annotated[
    Path | None,
    typer.Option(exists=True, dir_okay=False, help="Public key of the service; default: those seen before."),
]
Card = Annotated[
    Path | None,
    typer.Option(exists=True, file_okay=False, help="Compare the files of this folder with the receipt."),
]


@app.command("verify", epilog="Example: stilb receipt verify receipt.json --card /media/card")
def verify(
    file: File,
    key: Key = None,
    card: Card = None,
    *,
    as_json: bool = typer.Option(False, "--json", help="The result as one JSON document on stdout."),
) -> None:
    """Verify a receipt without a network.

    It ends with 1 if the receipt was changed or, with --card, if the folder holds what it does not cover.
    """
    try:
        signed = json.loads(file.read_text(encoding="utf-8"))
        key_id = str(signed["signature"]["key_id"])
    except (ValueError, KeyError, TypeError):
        raise Unclear(f"{file} is not a receipt.") from None
    if key is not None:
        keys, origin = receipts.read_keys(key.read_text(encoding="utf-8")), str(key)
    else:
        if (known := _known_keys().read().get(key_id)) is None:
            message = f"The key {key_id} has not been seen by this user: give --key (stilb receipt keys)."
            raise Unclear(message)
        keys, origin = [known["public_key"]], known["url"]
    try:
        receipt = receipts.verify_receipt(signed, keys)
    except receipts.ReceiptInvalid as invalid:
        _finish({"valid": False, "reason": str(invalid)}, [str(invalid)], as_json=as_json, well=False)
        return
    # neither the campaign's description nor the receipt itself is what a card was flown for
    ours = {file.resolve(), *([(card / FILENAME).resolve()] if card else [])}
    differences = [] if card is None else receipts.compare_card(receipt, card, ours=ours)
    apart = {each.removesuffix(": not in the receipt") for each in differences}
    lines = [line for line in _describe(receipt) if line.removesuffix(_NOT_SENT) not in apart]
    lines += [f"signed with {key_id}, a key of {origin}", *differences]
    if differences:
        lines.append("Do not delete this folder: the receipt does not cover the files above.")
    result = {"valid": True, "key": origin, "differences": differences, "receipt": receipt}
    _finish(result, lines, as_json=as_json, well=not differences)


@app.command("keys", epilog="Example: stilb receipt keys")
@command
def keys(output: Output) -> None:
    """Show the public keys of the service, and remember them."""
    with output.client() as client:
        items = client.signing_keys()
    _known_keys().keep(items, output.login().url)
    output.answer({"items": items}, *(f"{item['id']}\n{item['public_key']}" for item in items))


def write_receipt(
    output: Output, client: Client, folder: Path, report: Report, to: Path | None
) -> Path | None:
    """Write the receipt, by default among this user's own; None, with a note, if it is refused."""
    try:
        hashes = {receipts.plain_name(file.name): file.sha256 for file in report.files}
        files: list[dict[str, Any]] = [
            {
                "name": receipts.plain_name(file.relative_to(folder).as_posix()),
                "size_bytes": file.stat().st_size,
            }
            for file in receipts.list_files(folder)
        ]
        sent = [file | {"sha256": hashes[file["name"]]} for file in files if file["name"] in hashes]
        others = [file for file in files if file["name"] not in hashes]
        manifest = client.send_manifest(report.campaign_id, sent, others=others)
        signed = client.receipt(report.campaign_id, manifest["id"])
        _known_keys().keep(client.signing_keys(), output.login().url)
    except (Problem, OSError) as error:
        output.note(f"no receipt, keep the card: {error}")
        return None
    name = f"{report.campaign_id}-{signed['receipt']['manifest_id']}.json"
    path = to or config_folder() / "receipts" / name
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_whole(path, json.dumps(signed, ensure_ascii=False, indent=1) + "\n")
    except OSError as error:
        output.note(
            f"no receipt, keep the card: {error.strerror}: {path}. Run this again with another --receipt"
        )
        return None
    return path


def _known_keys() -> receipts.KnownKeys:
    return receipts.KnownKeys(config_folder() / "signing-keys.json")


def _describe(receipt: dict[str, Any]) -> list[str]:
    count, named = receipt["files_count"], receipt.get("project_number") or receipt["campaign_id"]
    lines = [
        f"{counted(count, 'file')}, {receipt['size_bytes'] / 1e6:.1f} MB, stored in campaign {named}",
        f"issued at {receipt['issued_at']} for {receipt['organisation']}",
    ]
    for file in receipt["files"]:
        notes = [f"refused as a frame ({file['refusal_code']})"] if file["state"] == "refused" else []
        notes += ["withdrawn from the campaign"] if "withdrawn_at" in file else []
        if notes:
            lines.append(f"{file['name']}: stored, {' and '.join(notes)}")
    lines += [f"{file['name']}{_NOT_SENT}" for file in receipt["not_covered"]]
    return lines


def _finish(result: dict[str, Any], lines: list[str], *, as_json: bool, well: bool) -> None:
    if as_json:
        print_json(result)
    else:
        typer.echo("\n".join(lines))
    if not well:
        raise typer.Exit(Exit.FINDINGS)
