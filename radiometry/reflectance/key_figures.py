"""Key figures of a reflectance version: K of each band."""

from typing import Any

from radiometry.specification.key_figures import KeyFigure


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    """Return K of each band of a stored result."""
    return tuple(
        KeyFigure(
            group=c["band"],
            label="Reflectance K",
            value=c["reflectance_k"],
            standard_uncertainty=c["reflectance_k_standard_uncertainty"],
            unit=c["reflectance_k_unit"],
            expanded_uncertainty=c.get("expanded_uncertainty"),
            coverage_factor=c.get("coverage_factor"),
        )
        for fit in result["band_fits"]
        for c in (fit["coefficient"],)
    )
