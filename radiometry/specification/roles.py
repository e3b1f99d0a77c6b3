"""Roles of the frames of a campaign, the grid in which they are shown, and its gaps."""

from collections.abc import Mapping
from typing import Final, Literal

from radiometry.records import Record, about


class Role(Record):
    """Role of a frame."""

    name: str
    label: str
    description: str
    has_scene: bool = about("True if the frame belongs to a scene, one light level.", default=False)


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


# Field of a frame whose values make the rows or columns of a grid
Axis = Literal["scene", "iso", "f_number", "exposure_time_s", "band", "capture_id"]


class Grid(Record):
    """Axes of the grid in which a method's frames are shown."""

    rows: Axis | None = about(
        'A row per role and value; "scene" splits only roles that have scenes. None for one row per role.',
        default=None,
    )
    columns: tuple[Axis, ...] = about(
        "A column per combination of values, the outer axis first; empty if the frames of a row are "
        "laid side by side.",
        default=(),
    )


class Gap(Record):
    """A frame to photograph next."""

    role: str = about("Role of the frame.")
    at: Mapping[Axis, str | float] = about(
        "Values of the grid's axes, as far as they are known.", default_factory=dict
    )
    exposure_time_s: float | None = about(
        "Exposure time to use [s]; None if the plan does not know one.", default=None
    )
    text: str = about("What to photograph, if exposure and place do not say it.", default="")
