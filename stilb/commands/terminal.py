"""Tables for terminals, files and pipes."""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from rich import box
from rich import progress as bars
from rich.console import Console
from rich.table import Table
from rich.text import Text

from stilb import records, upload
from stilb.field.files import RAW_SUFFIXES
from stilb.field.push import Listener, Report, Told
from stilb.problem import Problem

_MOST_DECIMALS = 7
_HOLDS_FOR = {"iso": "ISO", "f_number": "f", "band": "band", "channel": "channel"}


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> Table:
    """A row a thing; nothing of a cell is taken for markup."""
    made = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        made.add_column(column, overflow="fold")
    for row in rows:
        made.add_row(*(Text(str(cell)) for cell in row))
    if not made.rows:
        made.add_row("none", *[""] * (len(columns) - 1))
    return made


def figure(quantity: records.Quantity | records.Coefficient) -> str:
    """A value with its standard uncertainty, to two digits of the latter."""
    value, uncertainty = quantity.value, quantity.standard_uncertainty
    # the value ends where its uncertainty does; 0.0996 is 0.10 at two digits
    is_known = 0.0 < uncertainty < math.inf
    decimals = 1 - math.floor(math.log10(float(f"{uncertainty:.1e}"))) if is_known else -1
    if not 0 <= decimals <= _MOST_DECIMALS:
        return f"{value:.6g} ± {uncertainty:.2g} {quantity.unit}"
    return f"{value:.{decimals}f} ± {uncertainty:.{decimals}f} {quantity.unit}"


def show_scope(scope: str | None) -> str:
    """Return the remark on a value whose uncertainty lacks the error of the scale of its reference."""
    return " (relative only)" if scope == "relative_only" else ""


def of_coefficients(rows: Iterable[records.Coefficient]) -> Table:
    found = list(rows)
    held = {name: head for name, head in _HOLDS_FOR.items() if any(getattr(row, name) for row in found)}
    return table(
        ("name", *held.values(), "value", "flags"),
        [
            (
                row.name,
                *(_plain(getattr(row, name)) for name in held),
                figure(row) + show_scope(row.uncertainty_scope),
                " ".join(row.flags),
            )
            for row in found
        ],
    )


def holds_for(row: Mapping[str, Any]) -> str:
    held = [f"{head} {_plain(row[name])}" for name, head in _HOLDS_FOR.items() if name in row]
    return ", ".join([row["name"], *held])


def _plain(value: float | str | None) -> str:
    return f"{value:g}" if isinstance(value, float | int) else value or ""


def counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


NUMBER = re.compile(r"\d+(?:\.\d+)?")
_MOST_NAMED = 5
_Row = TypeVar("_Row")


def name_some(names: Sequence[str], what: str) -> str:
    """Return the names, or how many there are and the first few."""
    if len(names) <= _MOST_NAMED:
        return ", ".join(names)
    return f"{len(names)} {what}: {', '.join(names[:_MOST_NAMED])} and {len(names) - _MOST_NAMED} more"


def group_alike(rows: Iterable[_Row], words: Callable[[_Row], Sequence[str]]) -> list[list[_Row]]:
    """Return rows in groups whose words are the same but for their numbers."""
    alike: dict[tuple[str, ...], list[_Row]] = {}
    for row in rows:
        alike.setdefault(tuple(NUMBER.sub("#", each) for each in words(row)), []).append(row)
    return list(alike.values())


def format_findings(found: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return a line for equal findings: severity, code, what was found and what to do, and where."""
    lines = []
    for each in found:
        subjects = [*dict.fromkeys(filter(None, each["subjects"]))]
        more = len(subjects) - _MOST_NAMED + each["count"] - len(each["subjects"])
        where = ", ".join(subjects[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
        place = f" ({where})" if subjects else ""
        told = each["detail"]
        if not told.lower().endswith(each["action"].lower()):
            told = f"{told.removesuffix('.')}. {each['action']}".removeprefix(". ")
        lines.append(f"{each['severity']} {each['code']}: {told}{place}")
    return lines


class _Screen:
    """One bar for the counts, and one for the bytes as soon as there are any."""

    def __init__(self, console: Console, progress: bars.Progress) -> None:
        self._console, self._progress = console, progress
        self._bars: dict[str, bars.TaskID] = {}

    def count(self, what: str, done: int, total: int) -> None:
        if not self._console.is_terminal:
            if done == total:
                self._console.print(f"{what}: {done} of {total}")
            return
        self._progress.update(
            self._bar(what), completed=done, total=total, description=f"{what} {done} of {total}"
        )

    def sent(self, sent: upload.Progress) -> None:
        if not self._console.is_terminal:
            if sent.files_done == sent.files_total:
                self._console.print(
                    f"sent: {counted(sent.files_done, 'file')}, {sent.bytes_sent / 1e6:.1f} MB"
                )
            return
        description = f"sent {sent.files_done} of {sent.files_total}"
        bar = self._bar("sent")
        self._progress.update(bar, completed=sent.bytes_sent, total=sent.bytes_total, description=description)

    def _bar(self, what: str) -> bars.TaskID:
        if what not in self._bars:
            self._bars[what] = self._progress.add_task(what, total=None)
        return self._bars[what]


@contextmanager
def showing(console: Console) -> Iterator[Listener]:
    columns = (bars.TextColumn("{task.description}", markup=False), bars.BarColumn(), bars.DownloadColumn())
    with bars.Progress(
        *columns,
        bars.TransferSpeedColumn(),
        bars.TimeRemainingColumn(),
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
    """Return the files that do not simply pass, by reasons alike but for their numbers, then the sum."""
    told = (file for file in report.files if file.outcome != "pass" or file.reasons)
    for files in group_alike(told, lambda file: (file.outcome, *file.reasons)):
        yield f"{name_some([file.name for file in files], 'files')}  {files[0].outcome}"
        for some in zip(*(file.reasons for file in files), strict=True):
            yield f"    {_merge(files, some)}"
    if report.left_out:
        yield f"left out, no rule fits: {', '.join(report.left_out)}"
    if report.receipt:
        yield f"receipt: {report.receipt}"
    yield report.sentence()


def _merge(files: Sequence[Told], reasons: Sequence[str]) -> str:
    """Return sentences that are equal but for their numbers as one; numbers of names are no range."""
    if len(set(reasons)) > 1 and any(suffix in reasons[0].lower() for suffix in RAW_SUFFIXES):
        return f"{files[0].name}: {reasons[0]}"
    ranges = (
        (min(numbers, key=float), max(numbers, key=float))
        for numbers in zip(*map(NUMBER.findall, reasons), strict=True)
    )
    spans = (low if float(low) == float(high) else f"{low} to {high}" for low, high in ranges)
    return NUMBER.sub(lambda _: next(spans), reasons[0])
