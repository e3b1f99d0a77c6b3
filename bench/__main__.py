"""Run the benchmarks, or those that are named; the exit code says only whether they ran."""

import os
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import cache

from bench import growth, harness, lookups, reading, uploads, workers
from tests.support.postgres import PostgresServer

_FULL = harness.Scale(coefficients=(10_000, 100_000, 1_000_000))


def main(scale: harness.Scale, *names: str) -> int:
    began = time.monotonic()
    harness.say(harness.describe_machine())
    harness.say("medians of turns (the middle half in brackets); ratios are formed turn by turn")
    verdicts: list[bool] = []
    spent: list[str] = []
    with ExitStack() as stack:

        @cache
        def postgres() -> PostgresServer:
            return stack.enter_context(PostgresServer(fsync="on", synchronous_commit="on"))

        parts: dict[str, Callable[[], list[bool]]] = {
            "reading": lambda: reading.run(scale),
            "uploads": lambda: uploads.run(scale, postgres()),
            "growth": lambda: growth.run(scale),
            "lookups": lambda: lookups.run(scale, postgres()),
            "workers": lambda: workers.run(scale, postgres()),
            "start": lambda: workers.run_start(scale),
        }
        if strange := set(names) - parts.keys():
            harness.say(f"no benchmark is called {', '.join(sorted(strange))}; there are {', '.join(parts)}")
            return 2
        for name in names or parts:
            part_began = time.monotonic()
            verdicts += parts[name]()
            spent.append(f"{name} {time.monotonic() - part_began:.0f}")
    harness.say(f"\nseconds: {', '.join(spent)}")
    harness.say(f"{harness.summarise(verdicts)}; in {time.monotonic() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main(_FULL if os.environ.get("SCALE") == "full" else harness.Scale(), *sys.argv[1:]))
