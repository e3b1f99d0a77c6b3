"""``python -m tests.faults``: drill the matrix and print it; with --write, also to docs/faults.md."""

import argparse
import json
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from tests.faults import report
from tests.faults.drill import BOTH, Row
from tests.faults.machine import described
from tests.faults.matrix import Matrix
from tests.faults.report import Run
from tests.faults.table import FAULTS, QUIET
from tests.faults.verdict import Verdict
from tests.support.fieldwork import write_campaign


def main() -> int:
    asked = _parser().parse_args()
    if asked.merge:
        return _merge(asked.merge)
    chosen = [fault for fault in FAULTS if not asked.only or any(word in fault.name for word in asked.only)]
    faults = [QUIET, *(fault for fault in chosen if fault is not QUIET)]
    kinds = asked.on or list(BOTH)
    # where rows were kept on this machine says nothing to the reader of the page
    words = [word for word in sys.argv[1:] if word not in ("--keep", str(asked.keep))]
    run = Run(
        command=" ".join(["python -m tests.faults", *words]),
        began=f"{datetime.now(UTC):%Y-%m-%d %H:%M}",
        machine=described(),
    )
    with tempfile.TemporaryDirectory(prefix="stilb-drill-") as folder:
        (shots_in := Path(folder, "shots")).mkdir()
        shots = write_campaign(shots_in)
        half = len(shots) // 2
        matrix = Matrix(
            base=shots[:half],
            card=shots[half:],
            folder=Path(folder, "rows"),
            seed=asked.seed,
            show=_shower(run, asked.keep),
        )
        matrix.run(faults, kinds)
    _say(report.summary(matrix.rows))
    if asked.write:
        _write([(run, row) for row in matrix.rows])
    return 0 if all(row.holds for row in matrix.rows) else 1


def _merge(files: list[Path]) -> int:
    """Write the page from rows that runs have kept; the last run of a row replaces the earlier ones."""
    found: dict[tuple[str, str], tuple[Run, Row]] = {}
    for line in (line for file in files for line in file.read_text(encoding="utf-8").splitlines()):
        kept = json.loads(line)
        row = Row(**kept["row"] | {"verdict": Verdict(**kept["row"]["verdict"])})
        found[row.fault, row.kind] = (Run(**kept["run"]), row)
    order = [(fault.name, kind) for kind in BOTH for fault in FAULTS]
    _write([found[place] for place in sorted(found, key=order.index)])
    return 0 if all(row.holds for _, row in found.values()) else 1


def _write(drilled: list[tuple[Run, Row]]) -> None:
    report.PAGE.write_text(report.page(drilled), encoding="utf-8")
    _say(f"written to {report.PAGE}")


def _say(text: str) -> None:
    print(text, flush=True)  # noqa: T201 (for whoever drills)


def _shower(run: Run, keep: Path | None) -> Callable[[Row], None]:
    def show(row: Row) -> None:
        _say(report.line(row))
        for complaint in report.complaints(row):
            _say(f"    {complaint}")
        if keep is not None:
            with keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"run": asdict(run), "row": asdict(row)}) + "\n")

    return show


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.faults")
    parser.add_argument("--only", action="append", help="rows whose name holds these words; may be repeated")
    parser.add_argument("--on", action="append", choices=BOTH, help="on this deployment only")
    parser.add_argument("--seed", type=int, default=1, help="chooses the moments of the faults")
    parser.add_argument("--write", action="store_true", help="write docs/faults.md")
    parser.add_argument("--keep", type=Path, help="append each row to this file as it ends")
    parser.add_argument(
        "--merge", type=Path, nargs="+", help="drill nothing: write docs/faults.md from kept rows"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
