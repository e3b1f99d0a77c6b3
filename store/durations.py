"""How long a process's jobs took: counts that its heartbeat carries to whoever serves the metrics."""

from bisect import bisect_left
from typing import Final

from store.tables.job import KINDS

BOUNDS_S: Final = (0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 300.0, 1800.0)


class Durations:
    """The jobs of one process by kind: how many took at most each bound, beyond the last, and their sum [s].

    `found` is one JSON object for the life of the process and never changes its shape: a heartbeat may
    write it while a job ends.
    """

    def __init__(self) -> None:
        self.found = {kind: [0.0] * (len(BOUNDS_S) + 2) for kind in KINDS}

    def observe(self, kind: str, seconds: float) -> None:
        self.found[kind][bisect_left(BOUNDS_S, seconds)] += 1
        self.found[kind][-1] += seconds
