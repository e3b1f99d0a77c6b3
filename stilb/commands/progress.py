"""Progress of a push on stderr: a bar with rate and remaining time on a terminal, else one line per step."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
    TransferSpeedColumn,
)

from stilb.commands.tables import NUMBER, group_alike, name_some
from stilb.field.push import Listener, Report
from stilb.problem import Problem
from stilb.side_by_side import Progress as Sent


class _Screen:
    """One bar for the counts, and one for the bytes as soon as there are any."""

    def __init__(self, console: Console, progress: Progress) -> None:
        self._console = console
        self._progress = progress
        self._bars: dict[str, TaskID] = {}

    def count(self, what: str, done: int, total: int) -> None:
        if not self._console.is_terminal:
            if done == total:
                self._console.print(f"{what}: {done} of {total}")
            return
        self._progress.update(
            self._bar(what), completed=done, total=total, description=f"{what} {done} of {total}"
        )

    def sent(self, sent: Sent) -> None:
        if not self._console.is_terminal:
            if sent.files_done == sent.files_total:
                self._console.print(f"sent: {sent.files_done} files, {sent.bytes_sent / 1e6:.1f} MB")
            return
        description = f"sent {sent.files_done} of {sent.files_total}"
        bar = self._bar("sent")
        self._progress.update(bar, completed=sent.bytes_sent, total=sent.bytes_total, description=description)

    def _bar(self, what: str) -> TaskID:
        if what not in self._bars:
            self._bars[what] = self._progress.add_task(what, total=None)
        return self._bars[what]


@contextmanager
def showing(console: Console) -> Iterator[Listener]:
    """Show one push as it goes."""
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), DownloadColumn())
    with Progress(
        *columns,
        TransferSpeedColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
        transient=True,
    ) as progress:
        screen = _Screen(console, progress)
        yield Listener(on_count=screen.count, on_progress=screen.sent)


def tell_retry(console: Console, problem: Problem, pause_s: float) -> None:
    """A person who sees nothing move wants to know why, and until when."""
    console.print(f"{(problem.detail or problem.code).rstrip('.')}; retry in {math.ceil(pause_s)} s")


def lines(report: Report) -> Iterator[str]:
    """Return the lines at the end: files that do not simply pass, by their reasons, then the sum.

    Reasons that differ only in numbers are one, with the range of each number.
    """
    told = (file for file in report.files if file.outcome != "pass" or file.reasons)
    for files in group_alike(told, lambda file: (file.outcome, *file.reasons)):
        yield f"{name_some([file.name for file in files], 'files')}  {files[0].outcome}"
        yield from (f"    {_merge(some)}" for some in zip(*(file.reasons for file in files), strict=True))
    if report.left_out:
        yield f"left out, no rule fits: {', '.join(report.left_out)}"
    if report.receipt:
        yield f"receipt: {report.receipt}"
    yield report.sentence()


def _merge(reasons: Sequence[str]) -> str:
    """Return sentences that are equal but for their numbers as one."""
    ranges = (
        (min(numbers, key=float), max(numbers, key=float))
        for numbers in zip(*map(NUMBER.findall, reasons), strict=True)
    )
    spans = (low if float(low) == float(high) else f"{low} to {high}" for low, high in ranges)
    return NUMBER.sub(lambda _: next(spans), reasons[0])
