"""The service as a child process that never outlives the demo, however the demo ends."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from radiometry.records import Record
from service.launch.supervisor import die_with_parent

COMMAND = (sys.executable, "-m", "service.up")

_ROOT = Path(__file__).resolve().parent.parent
_STOPS_WITHIN_S = 30.0


class NotServing(Exception):  # noqa: N818  said to a person, not caught by name
    """The service ended before it was ready; it has said why itself."""


class Service(Record):
    """Where the service answers, and the key that opens everything."""

    url: str
    key: str
    process: subprocess.Popen[str]


@contextmanager
def serving(data: Path, *, command: Sequence[str] = COMMAND) -> Iterator[Service]:
    """Run the whole service on a data folder. ``STILB_PORT`` is respected; else any free port does."""
    environment = {"STILB_PORT": "0", **os.environ, "STILB_DATA": str(data)}
    process = subprocess.Popen(  # noqa: S603 (our own command)
        command,
        cwd=_ROOT,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
        # A group of its own: Ctrl-C in the terminal reaches the demo only, which stops all in order.
        process_group=0,
        # asks it to stop when the demo is gone, killed with -9 too: on Linux alone
        preexec_fn=die_with_parent(signal.SIGTERM),  # noqa: PLW1509 (it takes no lock)
    )
    try:
        yield _await_ready(process)
    finally:
        _stop(process)


def _await_ready(process: subprocess.Popen[str]) -> Service:
    """Read on until the service says where it is; it gives up when it cannot start."""
    for line in process.stdout or ():
        match line.split():
            case ["ready", url, "key", key]:
                return Service(url=url, key=key, process=process)
    raise NotServing(f"the service ended with exit code {process.wait()} before it was ready")


def _stop(process: subprocess.Popen[str]) -> None:
    process.terminate()
    try:
        process.wait(_STOPS_WITHIN_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()
