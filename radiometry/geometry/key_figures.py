"""Key figures of a geometry version: focal length, principal point, and what is left over."""

from typing import Any

from radiometry.specification.key_figures import KeyFigure, of_quantity


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    """Return the focal length, in mm where the pixel pitch is known, and the principal point."""
    named = {each["name"]: each for each in result["coefficients"]}
    focal = result.get("principal_distance_mm") or named["fx_px"]
    return (
        *of_quantity("Lens", "Focal length", focal),
        *of_quantity("Principal point", "Column", named.get("cx_px")),
        *of_quantity("Principal point", "Row", named.get("cy_px")),
        *of_quantity("All views", "Error of a corner, rms", named.get("rms_px")),
    )
