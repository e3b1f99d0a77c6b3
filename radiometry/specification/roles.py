"""Roles of frames in a campaign, the same for all methods."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, kw_only=True)
class Role:
    """Role of a frame.

    Attributes
    ----------
    has_scene : bool
        True if the frame belongs to a scene, one light level.

    """

    name: str
    label: str
    description: str
    has_scene: bool = False


LIGHT: Final = Role(
    name="light",
    label="Light",
    description="The lit surface at one light level; the scene names the level.",
    has_scene=True,
)
DARK: Final = Role(
    name="dark",
    label="Dark",
    description="No light on the sensor: lens cap on, at the exposure time and ISO value of the other "
    "frames.",
)
FLAT: Final = Role(name="flat", label="Flat", description="An evenly lit surface that fills the frame.")
PANEL: Final = Role(name="panel", label="Panel", description="A reflectance panel of known reflectance.")
CHART: Final = Role(name="chart", label="Chart", description="A test chart or board.")
FIELD: Final = Role(
    name="field",
    label="Field",
    description="A frame that the calibration is applied to, not used in the fit.",
)

ROLES: Final = (LIGHT, DARK, FLAT, PANEL, CHART, FIELD)
