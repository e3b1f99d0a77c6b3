"""The table at the end: what came out beside the truth that only a simulation knows."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from rich import box
from rich.table import Table

import stilb

AGREES_WITHIN = 3.0  # standard uncertainties


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One figure."""

    what: str
    value: float
    standard_uncertainty: float
    truth: float
    unit: str

    @classmethod
    def of(cls, what: str, found: stilb.Coefficient | stilb.Quantity, *, truth: float) -> Self:
        """Take a figure as the service reports it."""
        return cls(
            what=what,
            value=found.value,
            standard_uncertainty=found.standard_uncertainty,
            truth=truth,
            unit=found.unit,
        )

    @property
    def difference(self) -> float:
        """How far the figure lies from the truth, in its own standard uncertainties."""
        return (self.value - self.truth) / self.standard_uncertainty

    @property
    def agrees(self) -> bool:
        """Return True if the figure agrees with the truth."""
        return abs(self.difference) <= AGREES_WITHIN


def as_table(title: str, findings: Sequence[Finding]) -> Table:
    """Lay the findings out for a person."""
    table = Table(title=f"{title} beside the simulated truth", box=box.SIMPLE_HEAD)
    table.add_column("", no_wrap=True)
    for heading in ("found", "u", "truth", "off / u"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("unit")
    for one in findings:
        table.add_row(
            one.what,
            f"{one.value:.5g}",
            f"{one.standard_uncertainty:.2g}",
            f"{one.truth:.5g}",
            f"{one.difference:+.2f}" + ("" if one.agrees else " FAR"),
            "" if one.unit == "1" else one.unit,
        )
    return table
