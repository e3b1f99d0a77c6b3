"""A stored result drawn as SVG: one file a method, one case each below."""

from typing import Any

from service.plots import geometry, luminance, noise, reflectance, sharpness, vignetting

__all__ = ["draw_calibration"]


def draw_calibration(method: str, result: dict[str, Any]) -> str:
    """Draw a result as it is stored; what does not exist may be None or left out."""
    match method:
        case "luminance":
            return luminance.draw(result)
        case "reflectance":
            return reflectance.draw(result)
        case "vignetting":
            return vignetting.draw(result)
        case "sharpness":
            return sharpness.draw(result)
        case "geometry":
            return geometry.draw(result)
        case "noise":
            return noise.draw(result)
        case _:
            raise ValueError(method)
