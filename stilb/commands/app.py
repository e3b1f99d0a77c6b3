"""The `stilb` command, put together, and how it ends."""

import re
import sys
import traceback
from io import TextIOWrapper
from typing import Any, Final

import typer
from typer.core import TyperGroup

from stilb import problem, transport
from stilb.commands import access, calibration, campaign, jobs, measurements, output, push, receipt, roads

# by section the name of each command, its function or its own group, and an example
_SECTIONS: Final = {
    "From the card to coefficients in force": (
        ("login", access.login, "stilb login https://stilb.example.org"),
        ("campaign", campaign.app, "stilb campaign init card --project P-17"),
        ("push", push.push, "stilb push /media/card --campaign P-17"),
        ("roi", calibration.roi, 'stilb roi P-17 --imagej "makePolygon(8,8,88,8,88,56,8,56)"'),
        ("calibrate", calibration.calibrate, "stilb calibrate P-17 --tolerance 0.04"),
        ("publish", calibration.publish, 'stilb publish cal_01 --from now --reason "spring campaign"'),
        ("revoke", calibration.revoke, 'stilb revoke cal_01 --reason "the meter was dropped"'),
        ("history", calibration.history, "stilb history 0K1XE8"),
        ("k", calibration.k, "stilb k 0K1XE8 --iso 3200 --at 2026-06-01"),
    ),
    "Measuring": (
        ("measure", measurements.measure, "stilb measure --campaign P-18 --save night.csv"),
        ("map", measurements.read_map, "stilb map msr_01 --levels 0.5,1,2"),
        ("compare", measurements.compare, "stilb compare msr_01 msr_02"),
        ("road", roads.road, "stilb road roa_01 --points points.csv --save night"),
        ("motion", campaign.motion, "stilb motion P-17 --focal-length 3.98"),
        ("rig", calibration.rig, "stilb rig rig_01 --save rig.json"),
        ("fleet", calibration.fleet, "stilb fleet geometry 0K1XE8 0K1XE9 --tolerance 0.5"),
    ),
    "Records": (
        ("export", calibration.export, "stilb export cal_01 out"),
        ("receipt", receipt.app, "stilb receipt verify receipt.json --card /media/card"),
        ("audit", access.audit, "stilb audit --save audit.csv"),
    ),
    "Jobs": (
        ("jobs", jobs.jobs, "stilb jobs --state failed"),
        ("retry", jobs.retry, "stilb retry --state failed --code temporarily_unavailable"),
        ("dismiss", jobs.dismiss, "stilb dismiss --state failed --campaign P-17"),
        ("doctor", access.doctor, "stilb doctor"),
    ),
    "Access": (
        ("whoami", access.whoami, "stilb whoami"),
        ("logout", access.logout, "stilb logout"),
        ("organisation", access.organisation, "stilb organisation --time-zone Europe/Vienna"),
        ("key", access.app, "stilb key create laptop --scope read --scope upload"),
    ),
}
_FIRST_STEPS: Final = (
    "First steps: stilb login URL, then stilb campaign init FOLDER, and stilb campaign run FOLDER. Each "
    "command's --help shows an example."
)


class _Sections(TyperGroup):
    """Lists the commands by what they are for."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401  typer's own
        for title, members in _SECTIONS.items():
            found = [(name, self.get_command(ctx, name)) for name, _, _ in members]
            with formatter.section(title):
                formatter.write_dl([(name, each.get_short_help_str(60)) for name, each in found if each])


app = typer.Typer(
    name="stilb",
    cls=_Sections,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    epilog=_FIRST_STEPS,
)


def _tell_version(asked: bool) -> None:  # noqa: FBT001  as typer calls it
    if asked:
        typer.echo(transport.read_version())
        raise typer.Exit


@app.callback()
def _start(
    *,
    _version: bool = typer.Option(
        False, "--version", is_eager=True, callback=_tell_version, help="Print the version of the client."
    ),
) -> None:
    """Field work with a stilb calibration service: frames in, coefficients out."""


for _name, _what, _example in (each for members in _SECTIONS.values() for each in members):
    if isinstance(_what, typer.Typer):
        app.add_typer(_what, name=_name, epilog=f"Example: {_example}")
    else:
        app.command(_name, epilog=f"Example: {_example}")(_what)


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
        if end.code == output.Exit.INTERRUPTED:
            sys.stderr.write("stilb: stopped; run the same command again to continue\n")
        return end.code if isinstance(end.code, int) else int(output.Exit.USAGE)
    except (problem.Problem, problem.Unclear, TimeoutError, OSError) as error:
        return _end(error, as_json="--json" in given)
    except Exception as error:  # noqa: BLE001  a fault of ours must not look like a finding
        traceback.print_exc()
        return _end(error, as_json="--json" in given)
    return output.Exit.DONE


def _said(error: Exception) -> str:
    """For a person: without the numbers of the system, and without where in a request a field stands."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.strerror}: {error.filename}" if error.filename else error.strerror
    return re.sub(r"\b(?:body|query)\.(?=\w)", "", str(error))


def _end(error: Exception, *, as_json: bool) -> int:
    code = output.exit_of(error)
    lines = [f"stilb: {_said(error)}", *getattr(error, "__notes__", ()), output.next_step(error)]
    sys.stderr.write("".join(f"{line}\n" for line in lines if line))
    if as_json:
        told = {"detail": str(error), "exit_code": int(code)}
        if isinstance(error, problem.Problem):
            told = {"code": error.code, "status": error.status, **told, "detail": error.detail}
        output.print_json({"error": told})
    return code
