"""Webhooks of the organisation."""

from typing import Annotated

import typer

from stilb.commands.output import Output, command
from stilb.commands.tables import table

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Have events sent to an address.")

Id = Annotated[str, typer.Argument(metavar="WEBHOOK", help="Its id.")]


@app.command("list", epilog="Example: stilb webhook list")
@command
def list_webhooks(output: Output) -> None:
    """List the webhooks of your organisation."""
    with output.client() as client:
        found = list(client.webhooks())
    rows = [(each["url"], " ".join(each["events"]), _describe(each), each["id"]) for each in found]
    output.answer({"items": found}, table(("address", "events", "state", "webhook"), rows))


@app.command("add", epilog="Example: stilb webhook add https://example.org/hook")
@command
def add(
    output: Output,
    to: Annotated[str, typer.Argument(metavar="URL", help="Where events are sent, with https.")],
    event: Annotated[list[str], typer.Option(help="Such as calibration.published; repeatable.")],
) -> None:
    """Add a webhook, and show its secret once."""
    with output.client() as client:
        made = client.create_webhook(to, event)
    output.answer(made, f"{made['id']}\nsecret, shown only now: {made['secret']}")


@app.command("remove", epilog="Example: stilb webhook remove whk_01")
@command
def remove(output: Output, webhook: Id) -> None:
    """Remove a webhook and the log of its deliveries."""
    with output.client() as client:
        output.answer(client.remove_webhook(webhook), f"{webhook} removed")


@app.command("enable", epilog="Example: stilb webhook enable whk_01")
@command
def enable(output: Output, webhook: Id) -> None:
    """Enable a webhook that was disabled."""
    with output.client() as client:
        output.answer(client.change_webhook(webhook, enabled=True), f"{webhook} enabled")


@app.command("test", epilog="Example: stilb webhook test whk_01")
@command
def check(output: Output, webhook: Id) -> None:
    """Send a test event."""
    with output.client() as client:
        sent = client.test_webhook(webhook)
    output.answer(sent, f"{sent['id']} queued: stilb webhook log {webhook}")


@app.command("log", epilog="Example: stilb webhook log whk_01")
@command
def log(output: Output, webhook: Id) -> None:
    """Show what was sent, newest first, and the answers."""
    with output.client() as client:
        found = list(client.deliveries(webhook))
    rows = [
        (
            each["created_at"],
            each["event"],
            each["state"],
            each["attempts"],
            each.get("error", ""),
            each["id"],
        )
        for each in found
    ]
    output.answer({"items": found}, table(("at", "event", "state", "attempts", "error", "delivery"), rows))


@app.command("retry", epilog="Example: stilb webhook retry whk_01 dlv_01")
@command
def retry(
    output: Output, webhook: Id, delivery: Annotated[str, typer.Argument(help="Its id, from the log.")]
) -> None:
    """Send a delivery again at once."""
    with output.client() as client:
        sent = client.retry_delivery(webhook, delivery)
    output.answer(sent, f"{sent['id']} queued: stilb webhook log {webhook}")


def _describe(hook: dict[str, str]) -> str:
    if "disabled_at" in hook:
        return f"disabled: {hook['disabled_reason']}"
    return f"failing since {hook['failing_since']}" if "failing_since" in hook else "in use"
