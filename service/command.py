"""The `stilb-server` command: each process and tool of the server, by its name."""

import argparse
import os
import sys
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from store.software import read_version


class Command(NamedTuple):
    """A module that is run, and what it takes."""

    module: str
    meaning: str
    example: str
    takes: Mapping[str, Mapping[str, Any]] = {}  # arguments, as argparse declares them


_ALONE: Final = "alone, which needs STILB_DATABASE_URL"
COMMANDS: Final = {
    "up": Command(
        "service.up",
        "run everything in the foreground, or the named parts: service, worker",
        "stilb-server up",
        {"part": {"nargs": "*", "metavar": "service|worker", "help": _ALONE}},
    ),
    "service": Command("service", "run the API and the pages", "stilb-server service"),
    "migrate": Command(
        "store.migrate",
        "bring the database to the schema of this version",
        "stilb-server migrate --check || stilb-server migrate",
        {"--check": {"action": "store_true", "help": "change nothing; exit code 1 if it has another schema"}},
    ),
    "key": Command(
        "service.launch.key",
        "print the first key of the data folder, created if there is none",
        "stilb-server key",
    ),
    "pulse": Command(
        "store.pulse",
        "check that the process of STILB_PULSE makes progress (and [address] answers)",
        "stilb-server pulse http://127.0.0.1:8000/livez",
        {"address": {"nargs": "?", "help": "has to answer too"}},
    ),
    "audit": Command(
        "verify.audit",
        "check the audit trail [seq:hash of a head noted before]",
        "stilb-server audit",
        {"head": {"nargs": "?", "help": "a head noted before, seq:hash"}},
    ),
    "verify-backup": Command(
        "verify.backup",
        "check a backup: <folder> [--database URL] [--blobs URL]",
        "stilb-server verify-backup /backup/2026-05-01",
        {
            "folder": {"help": "with stilb.sqlite and blobs/"},
            "--database": {"help": "of a restored PostgreSQL, in place of stilb.sqlite"},
            "--blobs": {"help": "a folder or s3:// address, in place of blobs/"},
        },
    ),
}


def main() -> int:
    """Become the named process; its settings are in the environment."""
    parser = argparse.ArgumentParser("stilb-server", description="Processes and tools of the stilb server.")
    parser.add_argument("--version", action="version", version=f"stilb-server {read_version()}")
    commands = parser.add_subparsers(dest="name", metavar="<command>", required=True)
    for each, command in COMMANDS.items():
        own = commands.add_parser(
            each,
            help=command.meaning.replace("%", "%%"),
            description=f"{command.meaning[:1].upper()}{command.meaning[1:]}.",
            epilog=f"Example:\n  {command.example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        for argument, declared in command.takes.items():
            own.add_argument(argument, **declared)
    # ends with the help where it is asked for, or with what is wrong: before anything is done
    given, unknown = parser.parse_known_args(sys.argv[1:] or ["--help"])
    name: str = given.name
    if unknown:
        commands.choices[name].error(f"unrecognized arguments: {' '.join(unknown)}")
    # a folder `store` in the working directory is not ours; the parts that `up` starts inherit it
    os.environ["PYTHONSAFEPATH"] = "1"
    return os.execv(sys.executable, [sys.executable, "-m", COMMANDS[name].module, *sys.argv[2:]])  # noqa: S606
