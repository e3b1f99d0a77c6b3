"""Numbers and times as print shows them: rounded for a reader, never changed."""

import math
from datetime import datetime
from typing import Any

from radiometry.drawing.text import in_step


def expanded(certificate: dict[str, Any], value: float, row: dict[str, Any]) -> tuple[str, str]:
    """Return U and k as printed; what is relative only has neither."""
    if certificate.get("uncertainty_scope") == "relative_only":
        return "relative only", "-"
    return in_step(value, row["expanded_uncertainty"])[1], f"{row['coverage_factor']:.2f}"


def plain(value: float, digits: int = 5) -> str:
    """A number to so many significant digits, without zeros that say nothing."""
    return f"{value:.{digits}g}"


def percent(share: float) -> str:
    """Two decimals of a percent."""
    return f"{100 * share:.2f} %"


def extent(limits: list[float]) -> str:
    """Format a range, from the lowest to the highest."""
    return f"{plain(limits[0])} to {plain(limits[1])}"


def degrees(row: dict[str, Any]) -> str:
    """Degrees of freedom: beyond a thousand there is nothing to tell apart."""
    dof = row.get("effective_dof", math.inf)
    return plain(dof, 3) if dof <= 1000.0 else "> 1000"


def stamp(moment: str) -> str:
    """An instant to the second."""
    return datetime.fromisoformat(moment).strftime("%Y-%m-%d %H:%M:%S UTC")


def optional(row: dict[str, Any], name: str, form: Any = str) -> str:  # noqa: ANN401  a callable
    """Format a value that may be absent: then a dash."""
    return form(row[name]) if name in row else "-"
