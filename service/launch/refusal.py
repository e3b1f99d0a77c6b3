"""Why the launcher does not start, or ends: one line for a person, one number for a script."""

import sys
from enum import IntEnum


class Exit(IntEnum):
    STOPPED = 0
    GAVE_UP = 1
    """A part does not stay alive."""
    CANNOT_START = 2
    """A setting, the data folder or the port is in the way."""
    NEWER_SCHEMA = 3
    """The database was written by a newer stilb; the number that `store.migrate` answers."""
    ALREADY_RUNS = 4
    """Another launcher serves the same data folder."""


class Refusal(Exception):  # noqa: N818 (it says what was found)
    def __init__(self, message: str, code: Exit = Exit.CANNOT_START) -> None:
        super().__init__(message)
        self.code = code


def report(line: str) -> None:
    """Print one line for the terminal, or for the log of a container."""
    print(f"stilb: {line}", file=sys.stderr, flush=True)  # noqa: T201 (speaks to the terminal)
