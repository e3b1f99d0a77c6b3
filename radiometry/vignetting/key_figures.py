"""Key figures of a vignetting version: the corner falloff at each f-number."""

from typing import Any

from radiometry.specification.key_figures import KeyFigure, choose_channel


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    """Return the corner falloff of the channel that stands for brightness."""
    coefficients = [fit["coefficient"] for fit in result["channel_fits"]]
    shown = choose_channel(c["channel"] for c in coefficients)
    return tuple(
        KeyFigure(
            group=f"f/{c['f_number']:g}",
            label=f"Corner falloff, {shown}",
            value=100.0 * c["corner_falloff"],
            standard_uncertainty=100.0 * c["corner_falloff_standard_uncertainty"],
            unit="%",
        )
        for c in sorted(coefficients, key=lambda c: float(c["f_number"]))
        if c["channel"] == shown
    )
