"""Runs the launcher on stand-ins for the service and the worker, which start at once and do as told."""

import http.server
import os
import signal
import sqlite3
import subprocess
import sys
import time
import uuid
from contextlib import contextmanager, suppress
from pathlib import Path

from store.pulse import Pulse
from tests.support.processes import marked

SELF = [sys.executable, "-m", "tests.support.launcher"]


@contextmanager
def launched(data: Path, *, parts=("serve", "wait"), before=(), **settings):
    """Start the launcher; it is killed at the end, and every process of its tree bears its `mark`."""
    mark = f"STILB_TEST_MARK={uuid.uuid4()}"
    name, _, value = mark.partition("=")
    environment = os.environ | {"STILB_DATA": str(data), "STILB_PORT": "0", name: value} | settings
    with subprocess.Popen(
        [*SELF, "launch", ",".join(parts), ",".join(before)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # under nohup the launcher would rightly outlive a hang-up, which a test of hang-ups must not
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),  # noqa: PLW1509
    ) as process:
        process.mark = mark
        try:
            yield process
        finally:
            process.kill()
            for pid in marked(mark):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)


def ready(process) -> tuple[str, str]:
    """Wait for the line with which scripts wait; return the address and the key."""
    word, address, key_word, key = process.stdout.readline().split() or (process.stderr.read(),) * 4
    assert (word, key_word) == ("ready", "key"), word
    return address, key


def _launch(parts: str, before: str) -> int:
    # the stand-ins, of which there are many, start in a fifth of the time without them
    from service.launch import supervisor  # noqa: PLC0415
    from service.launch.run import Roster, launch, read_apart  # noqa: PLC0415

    # what a machine needs to recover, a stand-in does not
    supervisor.FIRST_PAUSE_S, supervisor.LONGEST_PAUSE_S = 0.02, 1.0
    return launch(
        read_apart(),
        Roster(
            before=[[*SELF, step] for step in before.split(",") if step],
            parts=[
                supervisor.Part(
                    name=part,
                    command=[*SELF, part],
                    stop_within_s=float(os.environ.get("STILB_TEST_STOP_S", "1")),
                    has_pulse=part in {"beat", "lock"},
                )
                for part in parts.split(",")
                if part
            ],
        ),
    )


def _serve() -> None:
    class Ready(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.end_headers()

    address = (os.environ["STILB_HOST"], int(os.environ["STILB_PORT"]))
    http.server.HTTPServer(address, Ready).serve_forever()


def _wait() -> None:
    time.sleep(600)


def _beat() -> None:
    pulse = Pulse(os.environ["STILB_PULSE"])
    while True:
        pulse.beat()
        time.sleep(0.5)


def _lock() -> None:
    """Is stopped amid its first transaction; its successor only beats."""
    pulse = Pulse(os.environ["STILB_PULSE"])
    time.sleep(1.5)
    pulse.beat()
    database = sqlite3.connect(Path(os.environ["STILB_DATA"], "stilb.sqlite"), isolation_level=None)
    if not database.execute("SELECT count(*) FROM kept").fetchone()[0]:
        database.execute("INSERT INTO kept VALUES (1)")
        database.execute("BEGIN IMMEDIATE")
        os.kill(os.getpid(), signal.SIGSTOP)
    _beat()


def _write() -> None:
    """Ends when nothing can be written."""
    while True:
        written = Path(os.environ["STILB_DATA"], "written")
        written.write_bytes(bytes(100_000))
        written.unlink()
        time.sleep(0.02)


def _parent() -> None:
    """Has a child of its own, as a worker has decoders."""
    subprocess.run([*SELF, "wait"], check=True)


def _stubborn() -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    sys.stdout.write(f"deaf, {'with' if 'STILB_KEY' in os.environ else 'without'} the key\n")
    sys.stdout.flush()
    time.sleep(600)


def _fail() -> None:
    sys.exit(7)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["launch", parts, before]:
            sys.exit(_launch(parts, before))
        case [action]:
            globals()[f"_{action}"]()
