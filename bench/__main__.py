"""Run every benchmark; the exit code says only whether they ran, each missed target is named."""

import sys
import time

from bench import growth, mapping, pages, reading, reflectance, upload
from bench.report import describe_machine, say, summarise
from bench.subject import Scale


def main(scale: Scale | None = None) -> int:
    began = time.monotonic()
    scale = scale or Scale()
    say(describe_machine())
    say("medians of turns (the middle half in brackets); ratios are formed turn by turn")
    verdicts = [
        *reading.run(scale),
        *mapping.run(scale),
        *reflectance.run(scale),
        *upload.run(scale),
        *pages.run(scale),
        *growth.run(scale),
    ]
    say(f"\n{summarise(verdicts)}; in {time.monotonic() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
