"""Run every benchmark; the exit code says only whether they ran, each missed target is named."""

import os
import sys
import tempfile
import time
from pathlib import Path

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
from worker.__main__ import build_context


def main(scale: Scale | None = None) -> int:
    began = time.monotonic()
    scale = scale or Scale.named(os.environ.get("SCALE", ""))
    say(describe_machine())
    say("medians of turns (the middle half in brackets); ratios are formed turn by turn")
    with PostgresServer(fsync="on", synchronous_commit="on") as postgres:
        verdicts = [
            *reading.run(scale),
            *mapping.run(scale),
            *reflectance.run(scale),
            *_serve(scale),
            *crowd.run(scale, postgres),
            *lookups.run(scale, postgres),
            *workers.run(scale, postgres),
            *start.run(scale),
        ]
    say(f"\n{summarise(verdicts)}; in {time.monotonic() - began:.0f} s")
    return 0


def _serve(scale: Scale) -> list[bool]:
    """Measure what one service does, with a worker that is called where it is needed."""
    with tempfile.TemporaryDirectory(prefix="stilb-bench-") as name:
        folder = Path(name)
        with upload.serving(folder / "data") as service:
            verdicts = upload.run(scale, service, folder)
            crowd.show(scale, service)
            worker = build_context(Settings(data=folder / "data"))
            try:
                verdicts += pages.run(scale, service, worker, folder)
                verdicts += scrolling.run(scale, service, worker, folder)
                verdicts += growth.run(scale, service, worker, folder)
                return verdicts + jobs.run(scale, service, worker)
            finally:
                worker.decoders.close()
                worker.database.dispose()


if __name__ == "__main__":
    sys.exit(main())
