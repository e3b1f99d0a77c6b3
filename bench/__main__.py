"""Run every benchmark; the exit code says only whether they ran, each missed target is named."""

import os
import sys
import tempfile
import time
from pathlib import Path
from types import ModuleType

from bench import (
    crowd,
    growth,
    jobs,
    lookups,
    mapping,
    pages,
    reading,
    reflectance,
    scrolling,
    start,
    upload,
    workers,
)
from bench.report import describe_machine, say, summarise
from bench.subject import Scale
from store.settings import Settings
from tests.support.postgres import PostgresServer
from worker.context import build_context, make_decoders


def main(scale: Scale | None = None) -> int:
    began = time.monotonic()
    scale = scale or Scale.named(os.environ.get("SCALE", ""))
    say(describe_machine())
    say("medians of turns (the middle half in brackets); ratios are formed turn by turn")
    parts = _Parts(scale)
    for part in (reading, mapping, reflectance):
        parts.run(part)
    _serve(parts)
    with PostgresServer(fsync="on", synchronous_commit="on") as postgres:
        for part in (crowd, lookups, workers):
            parts.run(part, postgres)
    parts.run(start)
    say(f"\nseconds: {', '.join(f'{name} {spent_s:.0f}' for name, spent_s in parts.seconds.items())}")
    say(f"{summarise(parts.verdicts)}; in {time.monotonic() - began:.0f} s")
    return 0


class _Parts:
    """Verdicts of the parts that have run, and how long each took."""

    def __init__(self, scale: Scale) -> None:
        self.scale = scale
        self.verdicts: list[bool] = []
        self.seconds: dict[str, float] = {}

    def run(self, part: ModuleType, *given: object) -> None:
        began = time.monotonic()
        self.verdicts += part.run(self.scale, *given)
        self.seconds[part.__name__.removeprefix("bench.")] = time.monotonic() - began


def _serve(parts: _Parts) -> None:
    """Measure what one service does, with a worker that is called where it is needed."""
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name:
        folder = Path(name)
        with upload.serving(folder / "data") as service:
            parts.run(upload, service, folder)
            crowd.show(parts.scale, service)
            settings = Settings(data=folder / "data")
            worker = build_context(settings, make_decoders(settings))
            worker.database.post = None
            try:
                for part in (pages, scrolling, growth):
                    parts.run(part, service, worker, folder)
                parts.run(jobs, service, worker)
            finally:
                worker.decoders.close()
                worker.database.dispose()


if __name__ == "__main__":
    sys.exit(main())
