"""Key figures of a luminance version: K of each ISO value, with its verdict."""

from typing import Any

from radiometry.specification.key_figures import KeyFigure


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    """Return K of each ISO value of a stored result."""
    return tuple(
        KeyFigure(
            group=f"ISO {c['iso']:g}",
            label="K",
            value=c["luminance_k"],
            standard_uncertainty=c["luminance_k_standard_uncertainty"],
            unit=c["luminance_k_unit"],
            expanded_uncertainty=c.get("expanded_uncertainty"),
            coverage_factor=c.get("coverage_factor"),
            passed=fit.get("passed"),
        )
        for fit in result["iso_fits"]
        for c in (fit["coefficient"],)
    )
