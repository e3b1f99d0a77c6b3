"""The matrix as people read it: printed while it is drilled, and written to docs/faults.md."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.faults.drill import Row

PAGE = Path(__file__).parents[2] / "docs" / "faults.md"
HEAD = (
    "fault",
    "on",
    "frames",
    "lost",
    "twice",
    "wrong",
    "errors",
    "goes on [s]",
    "all done [s]",
    "told",
    "machine [s]",
)


@dataclass(frozen=True, kw_only=True)
class Run:
    """The run that has drilled a row."""

    command: str
    began: str
    machine: str


TEXT = """# Faults

What stilb does on bad days of its machine and of its neighbours. `make faults` drills each row on really
started processes and writes this page. On "embedded", which is `make up` on SQLite, a folder and the
bundled Valkey; on "composed", which is what `docker-compose.yml` runs, on PostgreSQL, Valkey and an S3
store, started without containers. The database and the S3 store are reached through a proxy on loopback
that can fall silent, slow down, fail or go away.

Each row works with {frames} small frames of an organisation of its own. Half of them are read and fitted
in peace. Under the fault the other half is sent, the first half is measured and fitted once more. The fault
begins at a moment that the seed chooses. What fails with an error is asked again, as a user would. When all
is answered and no job is left, everything is compared with a run without a fault, to the last bit.

| column | meaning |
|---|---|
| lost | frames, measurements or fits that were asked for and are not there, not read or not readable |
| twice | frames, extractions, jobs, measurements, versions or audit entries that exist more than once |
| wrong | files, statistics, previews, K, measurements that differ; a broken audit trail; seen by a stranger |
| errors | exceptions that users of `stilb.Client` saw, and after which they asked again |
| goes on | from the end of the fault until another job has ended |
| all done | from the end of the fault until the last answer |
| told | from 4 s on: did `/readyz` and `/livez` say how it was, in 2 s and `machine`? empty: not asked |
| machine | the slowest answer of an idle web server beside it, asked four times a second; empty: not asked |

Where other work keeps the machine busy, as `machine` or a high load average shows, all seconds are
upper values.

Where each part is restarted in turn, composed has two services behind one address, and K is looked up
twenty times a second; large files are sent slowly meanwhile.

A part that hangs is stopped by a signal and left so: the fault ends when it has been replaced. The clock is
set for all processes but PostgreSQL's by a library that is loaded before theirs; their monotonic clocks run
on, as they do on a machine. Leases and sweeps are those that stilb is
delivered with, except with `--quick`, as in the tests.

"""


def line(row: Row) -> str:
    """One row of the table."""
    if row.skipped:
        return f"| {row.fault} | {row.kind} | 0 | skipped: {row.skipped} ||||||||"
    found = row.verdict
    counts = [len(found.lost), len(found.twice), len(found.wrong), row.errors]
    goes_on, all_done, machine = (
        "" if value is None else f"{value:.1f}" for value in (row.goes_on_s, row.all_done_s, row.machine_s)
    )
    cells = [row.fault, row.kind, row.frames, *counts, goes_on, all_done, row.told, machine]
    return "| " + " | ".join(map(str, cells)) + " |"


def head() -> str:
    return f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}"


def summary(rows: Sequence[Row]) -> str:
    """The sums, in a sentence."""
    run = [row for row in rows if not row.skipped]
    sums = [sum(len(getattr(row.verdict, name)) for row in run) for name in ("lost", "twice", "wrong")]
    held = sum(row.holds for row in run)
    return (
        f"{len(run)} rows with {sum(row.frames for row in run)} frames: "
        f"{sums[0]} lost, {sums[1]} twice, {sums[2]} wrong; "
        f"{held} rows hold, {len(run) - held} do not, {len(rows) - len(run)} were skipped."
    )


def complaints(row: Row) -> list[str]:
    found = row.verdict
    named = (("lost", found.lost), ("twice", found.twice), ("wrong", found.wrong), ("", row.complaints))
    return [f"{kind}: {text}" if kind else text for kind, texts in named for text in texts]


def page(drilled: Sequence[tuple[Run, Row]]) -> str:
    """The whole page."""
    runs = list(dict.fromkeys(run for run, _ in drilled))
    rows = [row for _, row in drilled]
    parts = [TEXT.format(frames=max(row.frames for row in rows)), "## The last runs\n\n"]
    for number, run in enumerate(runs, start=1):
        own = [row for of, row in drilled if of == run]
        parts.append(
            f"Run {number}, {len(own)} rows: {run.began} UTC, `{run.command}`, on {run.machine}.\n\n"
        )
    lines = [f"{line(row)} {runs.index(run) + 1} |" for run, row in drilled]
    parts += [
        f"{summary(rows)}\n\n",
        "\n".join([f"| {' | '.join(HEAD)} | run |", f"|{'---|' * (len(HEAD) + 1)}", *lines, ""]),
    ]
    failed = [row for row in rows if not row.holds]
    if failed:
        parts.append("\n## What does not hold\n\n")
        for row in failed:
            texts = [text.splitlines()[0][:300] for text in complaints(row)]
            parts.append(f"- {row.fault}, {row.kind}: {'; '.join(texts[:5])}\n")
    return "".join(parts)
