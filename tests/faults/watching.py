"""What is seen from outside during a drill: what the health routes say, and when jobs end."""

import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import func, select
from sqlalchemy.exc import SQLAlchemyError

from store.database import Database
from store.jobs import FINAL_STATES
from store.tables import Job
from tests.support.deployments import spawn
from tests.support.ports import pick_port
from tests.support.waiting import status_of

_EVERY_S = 0.25
_WITHIN_S = 8.0


@dataclass(frozen=True, kw_only=True)
class Probe:
    """One look at a health route; ``status`` is 0 where nothing answered."""

    at: float
    status: int
    took_s: float


@contextmanager
def bystander(folder: Path) -> Iterator[str]:
    """Serve an empty folder from a process that no fault strikes: nothing answers quicker on this machine."""
    port = pick_port()
    command = [sys.executable, "-m", "http.server", str(port), "--bind", "127.0.0.1"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with spawn([*command, "--directory", str(folder)], dict(os.environ), **quiet) as process:
        try:
            yield f"http://127.0.0.1:{port}/"
        finally:
            process.kill()


class Watch:
    """Looks at /readyz, /livez and a bystander four times a second, and counts the jobs that have ended."""

    def __init__(self, url: str, beside: str, database: Callable[[], Database], since: frozenset[str]):
        self._urls = {"readyz": f"{url}/readyz", "livez": f"{url}/livez", "bystander": beside}
        self._database = database
        self._since = since
        self.probes: dict[str, list[Probe]] = {name: [] for name in self._urls}
        self.ends: list[tuple[float, int]] = []
        self._ended = threading.Event()
        self._threads = [
            *(threading.Thread(target=self._probe, args=(name,), daemon=True) for name in self._urls),
            threading.Thread(target=self._count, daemon=True),
        ]

    def __enter__(self):
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        for thread in self._threads:
            thread.join(2 * _WITHIN_S)

    def first_end_after(self, moment: float) -> float | None:
        """How long after the moment another job had ended [s]."""
        before = max((count for at, count in self.ends if at <= moment), default=0)
        return next((at - moment for at, count in self.ends if at > moment and count > before), None)

    def slowest_s(self, route: str, start: float = 0.0, end: float = math.inf) -> float:
        return max((probe.took_s for probe in self.seen(route, start, end)), default=0.0)

    def seen(self, route: str, start: float, end: float) -> list[Probe]:
        return [probe for probe in self.probes[route] if start <= probe.at < end]

    def _probe(self, route: str) -> None:
        while not self._ended.wait(_EVERY_S):
            at = time.monotonic()
            status = status_of(self._urls[route], timeout_s=_WITHIN_S)
            self.probes[route].append(Probe(at=at, status=status, took_s=time.monotonic() - at))

    def _count(self) -> None:
        ended = select(func.count()).where(Job.state.in_(FINAL_STATES), Job.organisation_id.in_(self._since))
        while not self._ended.wait(0.05):
            try:
                with self._database().reading() as session:
                    count = session.scalar(ended)
            except SQLAlchemyError:
                continue
            if count is not None and (not self.ends or count != self.ends[-1][1]):
                self.ends.append((time.monotonic(), count))
