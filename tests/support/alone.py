"""The service as one real process, alone with its database, to be stopped and started again."""

import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

from tests.support.deployments import spawn
from tests.support.fieldwork import Team, new_team
from tests.support.ports import pick_port
from tests.support.waiting import status_of, wait_for

KEY = "stilb_key_of_a_service_that_is_alone_here"


class Alone:
    """`python -m service` on a migrated SQLite database; its log is kept over its restarts."""

    def __init__(self, folder: Path, template: Path, **settings: str):
        self.log = folder / "service.log"
        (folder / "stilb.sqlite").write_bytes(template.read_bytes())
        port = pick_port()
        self.url = f"http://127.0.0.1:{port}"
        self._environment = (
            os.environ | {"STILB_DATA": str(folder), "STILB_PORT": str(port), "STILB_KEY": KEY} | settings
        )

    def start(self) -> None:
        with self.log.open("ab") as log:
            self.process: subprocess.Popen = spawn(
                [sys.executable, "-m", "service"], self._environment, stdout=log, stderr=log
            )

    def begin(self) -> None:
        """Start, and wait until it answers."""
        self.start()
        wait_for(lambda: status_of(f"{self.url}/livez") == 200)

    def ask_to_stop(self) -> None:
        self.process.send_signal(signal.SIGTERM)

    def team(self, **settings) -> Team:
        return new_team(self.url, KEY, **settings)


@contextmanager
def alone(folder: Path, template: Path, **settings: str):
    """A service of one's own, as long as the block."""
    service = Alone(folder, template, **settings)
    service.begin()
    try:
        yield service
    finally:
        service.process.kill()
        service.process.wait()
