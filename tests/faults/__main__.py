"""``python -m tests.faults``: drill the matrix and print it; with --write, also to docs/faults.md."""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from tests.faults import report
from tests.faults.drill import BOTH, Row
from tests.faults.machine import be_alone_with_mounts
from tests.faults.matrix import Matrix
from tests.faults.table import FAULTS, HASTEN, QUIET
from tests.support.deployments import QUICK
from tests.support.fieldwork import write_campaign


def main() -> int:
    asked = _parser().parse_args()
    be_alone_with_mounts()
    chosen = [fault for fault in FAULTS if not asked.only or any(word in fault.name for word in asked.only)]
    if asked.short:
        chosen = [fault for fault in chosen if fault.lasts_s < 100]
    faults = [QUIET, *(fault for fault in chosen if fault is not QUIET)]
    kinds = asked.on or list(BOTH)
    pace = {"settings": QUICK, "hasten": HASTEN} if asked.quick else {}
    started = time.monotonic()
    _say(report.head())
    with tempfile.TemporaryDirectory(prefix="stilb-drill-") as folder:
        (shots_in := Path(folder, "shots")).mkdir()
        shots = write_campaign(shots_in)
        matrix = Matrix(shots=shots, folder=Path(folder, "rows"), seed=asked.seed, show=_show, **pace)
        matrix.run(faults, kinds)
    _say(report.summary(matrix.rows))
    if asked.write:
        text = report.page(
            matrix.rows,
            seed=asked.seed,
            took_s=time.monotonic() - started,
            per_row=len(shots),
            command=" ".join(["python -m tests.faults", *sys.argv[1:]]),
        )
        report.PAGE.write_text(text, encoding="utf-8")
        _say(f"written to {report.PAGE}")
    return 0 if all(row.holds for row in matrix.rows) else 1


def _say(text: str) -> None:
    print(text, flush=True)  # noqa: T201 (for whoever drills)


def _show(row: Row) -> None:
    _say(report.line(row))
    for complaint in report.complaints(row):
        _say(f"    {complaint}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.faults")
    parser.add_argument("--only", action="append", help="rows whose name holds these words; may be repeated")
    parser.add_argument("--on", action="append", choices=BOTH, help="on this deployment only")
    parser.add_argument("--short", action="store_true", help="without the rows that last for minutes")
    parser.add_argument(
        "--quick", action="store_true", help="with quick leases, short faults: as in the tests"
    )
    parser.add_argument("--seed", type=int, default=1, help="chooses the moments of the faults")
    parser.add_argument("--write", action="store_true", help="write docs/faults.md")
    return parser


if __name__ == "__main__":
    sys.exit(main())
