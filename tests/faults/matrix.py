"""Runs many rows: one deployment for all rows that need the same, one truth for all."""

import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from tests.faults.drill import Fault, Kind, Row, run_row
from tests.faults.grounds import AS_DELIVERED, ComposedGround, EmbeddedGround, Ground
from tests.faults.machine import Clock
from tests.faults.verdict import Truth
from tests.faults.watching import bystander
from tests.support.deployments import short_folder
from tests.support.disks import small_disk
from tests.support.fieldwork import Shot
from tests.support.postgres import PostgresServer

_SEEN_FOR_S = 8.0
"""A fault that lasts is noticed meanwhile, and then seen for a while."""


@contextmanager
def ground(
    kind: Kind, needs: str, server: PostgresServer | None, settings: dict[str, str]
) -> Iterator[Ground]:
    """A running deployment; on a small disk, with its own clock, or with two services if that is needed."""
    with ExitStack() as stack:
        folder = stack.enter_context(short_folder())
        disk = stack.enter_context(small_disk(folder)) if needs == "disk" else None
        clock = Clock(folder) if needs == "clock" else None
        made: EmbeddedGround | ComposedGround
        if kind == "embedded":
            made = EmbeddedGround(disk or folder, **settings, **(clock.environment if clock else {}))
        else:
            assert server is not None
            services = 2 if needs == "pair" else 1
            made = ComposedGround(disk or folder, server, stack, services=services, **settings)
        made.disk, made.clock = disk, clock
        yield stack.enter_context(made)


class Matrix:
    """Drills faults one after the other; all must end as the first run, in which nothing happens."""

    def __init__(
        self,
        *,
        base: Sequence[Shot],
        card: Sequence[Shot],
        folder: Path,
        seed: int,
        settings: dict[str, str] = AS_DELIVERED,
        hasten: float = 1.0,
        show: Callable[[Row], None] = lambda _: None,
    ):
        """Fit ``base`` in peace, send ``card`` under a fault, and let it last ``1 / hasten`` of its time."""
        self.rows: list[Row] = []
        self._settings = settings
        self._hasten = hasten
        self._base = base
        self._card = card
        self._folder = folder
        self._seed = seed
        self._show = show
        self._truth: Truth | None = None
        self._beside = ""

    def run(self, faults: Sequence[Fault], kinds: Sequence[Kind]) -> None:
        with ExitStack() as stack:
            self._folder.mkdir(parents=True)
            self._beside = stack.enter_context(bystander(self._folder))
            server = stack.enter_context(PostgresServer()) if "composed" in kinds else None
            for kind in kinds:
                for needs in ("", "disk", "clock", "pair"):
                    chosen = [fault for fault in faults if fault.needs == needs and kind in fault.on]
                    while chosen:
                        chosen = self._run_some(chosen, kind, needs, server)

    def _run_some(
        self, faults: Sequence[Fault], kind: Kind, needs: str, server: PostgresServer | None
    ) -> Sequence[Fault]:
        """Drill on one deployment until a row leaves it broken; return the faults that remain."""
        try:
            with ground(kind, needs, server, self._settings) as made:
                for number, fault in enumerate(faults, start=1):
                    if not self._drill(fault, made):
                        return faults[number:]
        except pytest.skip.Exception as reason:
            for fault in faults:
                self._add(Row(fault=fault.name, kind=kind, skipped=str(reason)))
        return []

    def _drill(self, fault: Fault, made: Ground) -> bool:
        folder = self._folder / f"{len(self.rows)}-{made.kind}"
        try:
            row, self._truth = run_row(
                replace(fault, lasts_s=max(fault.lasts_s / self._hasten, min(fault.lasts_s, _SEEN_FOR_S))),
                made,
                beside=self._beside,
                base=self._base,
                card=self._card,
                folder=folder,
                seed=self._seed,
                truth=self._truth,
            )
        except Exception as error:  # noqa: BLE001 (a drill that breaks is a row that does not hold)
            last = "".join(traceback.format_exception(error, limit=-4))
            row = Row(fault=fault.name, kind=made.kind, complaints=[f"{error!r:.500}", last])
        self._add(row)
        return row.holds

    def _add(self, row: Row) -> None:
        self.rows.append(row)
        self._show(row)
