"""Progress: bars in a terminal, plain lines elsewhere."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

_LINE_EVERY_S = 2.0

Advance = Callable[[float], None]  # takes the share that is done, 0..1


class Display:
    """One stage after another, each with its share done."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def say(self, text: str) -> None:
        """Print one line as it is."""
        self._console.print(text, highlight=False, soft_wrap=True)

    def show(self, table: Table) -> None:
        """Print a table."""
        self._console.print(table)

    @contextmanager
    def stage(self, name: str) -> Iterator[Advance]:
        """Show one stage from its begin to its end; the body reports how far it is."""
        if self._console.is_terminal:
            with self._bar(name) as advance:
                yield advance
        else:
            with self._lines(name) as advance:
                yield advance

    @contextmanager
    def _bar(self, name: str) -> Iterator[Advance]:
        columns = (
            TextColumn("{task.description:<34}"),
            BarColumn(),
            TaskProgressColumn(),
            TimeElapsedColumn(),
        )
        with Progress(*columns, console=self._console) as progress:
            task = progress.add_task(name, total=1.0)
            yield lambda share: progress.update(task, completed=share)
            progress.update(task, completed=1.0)

    @contextmanager
    def _lines(self, name: str) -> Iterator[Advance]:
        began = said = time.monotonic()

        def advance(share: float) -> None:
            nonlocal said
            if time.monotonic() - said >= _LINE_EVERY_S:
                said = time.monotonic()
                self.say(f"{name}: {share:.0%}")

        yield advance
        self.say(f"{name}: done in {time.monotonic() - began:.1f} s")
