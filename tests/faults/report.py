"""The matrix as people read it: printed while it is drilled, and written to docs/faults.md."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.faults.drill import Row

PAGE = Path(__file__).parents[2] / "docs" / "faults.md"


@dataclass(frozen=True, kw_only=True)
class Run:
    command: str
    began: str
    machine: str


TEXT = """# Faults

`make faults` drills each fault on really started processes and writes this page: "embedded" is `make up`
(SQLite, a folder, the bundled Valkey), "composed" what `docker-compose.yml` runs (PostgreSQL, Valkey and
an S3 store behind a proxy that can fall silent, slow down, fail or go away), without containers.

Each drill has {frames} small frames. Half of them are read and fitted before; under the fault the other
half is sent, and the first half is measured and fitted once more. What fails with an error is repeated,
as a user would. Then everything is compared with a run without a fault, to the last bit: what is lost,
exists twice or differs. A part that hangs is stopped by a signal until it has been replaced; the clock is
set by a library that is loaded before the processes.

The table states the seconds from the end of the fault until another job has ended, and until the last
answer; in brackets the exceptions that users of `stilb.Client` saw. "told": from 4 s on, `/readyz` and
`/livez` said how it was, in time; empty: not asked.
Where other work kept the machine busy, all seconds are upper values.

"""


def line(row: Row) -> str:
    if row.skipped:
        return f"{row.fault}, {row.kind}: skipped: {row.skipped}"
    found = row.verdict
    counts = f"{len(found.lost)} lost, {len(found.twice)} twice, {len(found.wrong)} wrong"
    return f"{row.fault}, {row.kind}: {row.frames} frames, {counts}, {_seconds(row)} s; told: {row.told}"


def summary(rows: Sequence[Row]) -> str:
    run = [row for row in rows if not row.skipped]
    sums = [sum(len(getattr(row.verdict, name)) for row in run) for name in ("lost", "twice", "wrong")]
    held = sum(row.holds for row in run)
    return (
        f"{len(run)} rows with {sum(row.frames for row in run)} frames: "
        f"{sums[0]} lost, {sums[1]} twice, {sums[2]} wrong; "
        f"{held} rows hold, {len(run) - held} do not, {len(rows) - len(run)} were skipped."
    )


def table(rows: Sequence[Row]) -> Iterable[str]:
    """The lines of the page's table: a row a fault, with seconds and errors on both deployments."""
    yield "| fault | embedded | composed | told |"
    yield f"|{'---|' * 4}"
    for fault in dict.fromkeys(row.fault for row in rows if not row.skipped):
        drilled = {row.kind: row for row in rows if row.fault == fault and not row.skipped}
        told = {row.told for row in drilled.values() if row.told}
        seconds = [_seconds(drilled[kind]) if kind in drilled else "" for kind in ("embedded", "composed")]
        yield f"| {fault} | {' | '.join(seconds)} | {', '.join(sorted(told))} |"


def _seconds(row: Row) -> str:
    known = [f"{value:.1f}" for value in (row.goes_on_s, row.all_done_s) if value is not None]
    return ", ".join(known) + (f" ({row.errors})" if row.errors else "")


def complaints(row: Row) -> list[str]:
    found = row.verdict
    named = (("lost", found.lost), ("twice", found.twice), ("wrong", found.wrong), ("", row.complaints))
    return [f"{kind}: {text}" if kind else text for kind, texts in named for text in texts]


def page(drilled: Sequence[tuple[Run, Row]]) -> str:
    runs = list(dict.fromkeys(run for run, _ in drilled))
    rows = [row for _, row in drilled]
    parts = [TEXT.format(frames=max(row.frames for row in rows)), "## The last runs\n\n"]
    for number, run in enumerate(runs, start=1):
        own = [row for of, row in drilled if of == run]
        parts.append(
            f"Run {number}, {len(own)} rows: {run.began} UTC, `{run.command}`, on {run.machine}.\n\n"
        )
    parts += [f"{summary(rows)}\n\n", "\n".join(table(rows)), "\n"]
    failed = [row for row in rows if not row.holds]
    if failed:
        parts.append("\n## What does not hold\n\n")
        for row in failed:
            texts = [text.splitlines()[0][:300] for text in complaints(row)]
            parts.append(f"- {row.fault}, {row.kind}: {'; '.join(texts[:5])}\n")
    return "".join(parts)
