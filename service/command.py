"""The `stilb-server` command: each process and tool of the server, by its name."""

import os
import sys
from typing import Final

from store.software import read_version

COMMANDS: Final = {
    "up": ("service.up", "run everything in the foreground, or the named parts: service, worker"),
    "service": ("service", "run the API and the pages"),
    "worker": (
        "worker",
        "run a worker, which reads frames, fits, measures, verifies files and sends webhooks",
    ),
    "migrate": ("store.migrate", "bring the database to the schema of this version"),
    "key": ("service.launch.key", "print the first key of the data folder, created if there is none"),
    "pulse": ("store.pulse", "check that the process of STILB_PULSE makes progress (and [address] answers)"),
    "audit": ("store.audit_check", "check the audit trail [seq:hash of a head noted before]"),
    "verify-backup": ("store.backup_check", "check a backup: <folder> [--database URL] [--blobs URL]"),
}


def main() -> int:
    """Become the named process; its settings are in the environment."""
    name = sys.argv[1] if len(sys.argv) > 1 else "--help"
    if name == "--version":
        print(f"stilb-server {read_version()}")  # noqa: T201
        return 0
    if name not in COMMANDS:
        lines = [f"  {each:<15}{meaning}" for each, (_, meaning) in COMMANDS.items()]
        asked = name in {"--help", "-h"}
        usage = "\n".join(["usage: stilb-server <command>", "", *lines])
        print(usage, file=sys.stdout if asked else sys.stderr)
        return 0 if asked else 2
    # a folder `store` in the working directory is not ours; the parts that `up` starts inherit it
    os.environ["PYTHONSAFEPATH"] = "1"
    return os.execv(sys.executable, [sys.executable, "-m", COMMANDS[name][0], *sys.argv[2:]])  # noqa: S606
