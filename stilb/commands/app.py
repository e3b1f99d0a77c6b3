"""The `stilb` command, put together, and how it ends."""

import re
import sys
import traceback
from io import TextIOWrapper
from typing import Annotated

import typer

from stilb.commands import (
    calibration,
    campaign,
    coefficients,
    doctor,
    jobs,
    keys,
    maps,
    measurements,
    motion,
    push,
    receipt,
    rig,
    session,
    webhooks,
)
from stilb.commands.exits import Exit, exit_of, next_step
from stilb.commands.output import print_json
from stilb.problem import Problem, Unclear
from stilb.version import read_version

app = typer.Typer(
    name="stilb",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _tell_version(asked: bool) -> None:  # noqa: FBT001  as typer calls it
    if asked:
        typer.echo(read_version())
        raise typer.Exit


@app.callback()
def _start(
    *,
    _version: Annotated[
        bool,
        typer.Option(
            "--version", is_eager=True, callback=_tell_version, help="Print the version of the client."
        ),
    ] = False,
) -> None:
    """Field work with a stilb calibration service: frames in, coefficients out."""


app.command("login")(session.login)
app.command("logout")(session.logout)
app.command("whoami")(session.whoami)
app.add_typer(keys.app, name="key")
app.add_typer(campaign.app, name="campaign")
app.command("push")(push.push)
app.add_typer(receipt.app, name="receipt")
app.command("roi")(calibration.roi)
app.command("calibrate")(calibration.calibrate)
app.command("publish")(calibration.publish)
app.command("correct")(calibration.correct)
app.command("k")(coefficients.k)
app.command("measure")(measurements.measure)
app.command("map")(maps.read_map)
app.command("compare")(measurements.compare)
app.command("motion")(motion.motion)
app.command("rig")(rig.rig)
app.command("export")(calibration.export)
app.command("audit")(keys.audit)
app.command("jobs")(jobs.jobs)
app.command("events")(jobs.events)
app.add_typer(webhooks.app, name="webhook")
app.command("retry")(jobs.retry)
app.command("dismiss")(jobs.dismiss)
app.command("doctor")(doctor.doctor)


def main(arguments: list[str] | None = None) -> int:
    """Run one command; its exit code is `stilb.commands.exits.Exit`'s."""
    given = sys.argv[1:] if arguments is None else arguments
    for stream in (sys.stdout, sys.stderr):
        # a file's name may be no text, or of letters that the terminal lacks: neither is a reason to end
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        app(given, prog_name="stilb")
    except SystemExit as end:
        if end.code == Exit.INTERRUPTED:
            sys.stderr.write("stilb: stopped; run the same command again to continue\n")
        return end.code if isinstance(end.code, int) else int(Exit.USAGE)
    except (Problem, Unclear, TimeoutError, OSError) as error:
        return _end(error, as_json="--json" in given)
    except Exception as error:  # noqa: BLE001  a fault of ours must not look like a finding
        traceback.print_exc()
        return _end(error, as_json="--json" in given)
    return Exit.DONE


def _said(error: Exception) -> str:
    """For a person: without the numbers of the system, and without where in a request a field stands."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.strerror}: {error.filename}" if error.filename else error.strerror
    return re.sub(r"\b(?:body|query)\.(?=\w)", "", str(error))


def _end(error: Exception, *, as_json: bool) -> int:
    """Report an error, on stderr for a person, on stdout for a machine."""
    code = exit_of(error)
    lines = [f"stilb: {_said(error)}", *getattr(error, "__notes__", ()), next_step(error)]
    sys.stderr.write("".join(f"{line}\n" for line in lines if line))
    if as_json:
        told = {"detail": str(error), "exit_code": int(code)}
        if isinstance(error, Problem):
            told = {"code": error.code, "status": error.status, **told, "detail": error.detail}
        print_json({"error": told})
    return code
