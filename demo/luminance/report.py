"""The table at the end: each K beside the truth that only a simulation knows."""

from collections.abc import Mapping
from dataclasses import dataclass

from rich import box
from rich.table import Table

from demo.findings import AGREES_WITHIN
from demo.luminance.journey import Outcome


@dataclass(frozen=True, kw_only=True)
class Row:
    """One ISO value."""

    iso: int
    luminance_k: float
    standard_uncertainty: float
    truth: float
    largest_error_rel: float
    tolerance_rel: float

    @property
    def difference(self) -> float:
        """How far K lies from the truth, in its own standard uncertainties."""
        return (self.luminance_k - self.truth) / self.standard_uncertainty

    @property
    def agrees(self) -> bool:
        """Whether K agrees with the truth."""
        return abs(self.difference) <= AGREES_WITHIN

    @property
    def passed(self) -> bool:
        """Whether every point lies within the procedure's tolerance."""
        return self.largest_error_rel <= self.tolerance_rel


def compare(outcome: Outcome, *, truth: Mapping[int, float], tolerance_rel: float) -> list[Row]:
    """Set what the dashboard reads beside the truth; an ISO value without a coefficient is an error."""
    found = {row.iso: row for row in outcome.in_force if row.name == "luminance_k"}
    shown = {row["iso"]: row["value"] for row in outcome.series if row["name"] == "luminance_k"}
    rows = []
    for iso, true_k in truth.items():
        k = found[iso]
        if shown[iso] != k.value:
            raise ValueError(f"iso {iso}: the series says {shown[iso]}, the coefficients say {k.value}")
        rows.append(
            Row(
                iso=iso,
                luminance_k=k.value,
                standard_uncertainty=k.standard_uncertainty,
                truth=true_k,
                largest_error_rel=_largest_error_rel(outcome, iso),
                tolerance_rel=tolerance_rel,
            )
        )
    return rows


def as_table(rows: list[Row]) -> Table:
    """Lay the rows out for a person."""
    table = Table(title="luminance K [DN*m2/(cd*s)] beside the simulated truth", box=box.SIMPLE_HEAD)
    for heading in ("ISO", "K", "u(K)", "truth", "(K-truth)/u(K)", "largest error"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict")
    for row in rows:
        verdict = f"{'within' if row.passed else 'beyond'} {row.tolerance_rel:.0%}"
        table.add_row(
            str(row.iso),
            f"{row.luminance_k:.3f}",
            f"{row.standard_uncertainty:.3f}",
            f"{row.truth:.3f}",
            f"{row.difference:+.2f}",
            f"{row.largest_error_rel:.2%} of L",
            verdict if row.agrees else f"{verdict}, far from the truth",
        )
    return table


def _largest_error_rel(outcome: Outcome, iso: int) -> float:
    points = outcome.calibration.raw["points"]
    return max(abs(float(point["residual_rel"])) for point in points if point["iso"] == iso and point["used"])
