"""Key figures of a sharpness version: MTF50 in the centre and farthest from it."""

from typing import Any

from radiometry.specification.key_figures import KeyFigure, choose_channel, of_quantity

_LABELS = {"mtf50_cycles_per_pixel": "MTF50", "resolving_power_cycles_per_pixel": "Resolving power"}


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    """Return the figure of the positions nearest to the middle and farthest from it, at each f-number."""
    positions = sorted(result["positions"], key=lambda each: float(each["radius_rel"]))
    if not positions:
        return ()
    shown = choose_channel(each["channel"] for each in positions)
    figures: list[KeyFigure] = []
    for f_number in dict.fromkeys(each.get("f_number") for each in positions):
        here = [each for each in positions if each["channel"] == shown and each.get("f_number") == f_number]
        for each in here[:1] + here[1:][-1:]:
            group = each["position"] or ("centre" if each is here[0] else "corner")
            group += f", f/{f_number:g}" if f_number else ""
            named = {row["name"]: row["quantity"] for row in each["coefficients"]}
            name = next((name for name in _LABELS if name in named), None)
            if name is not None:
                figures += of_quantity(group, f"{_LABELS[name]}, {shown}", named[name])
    return tuple(figures)
