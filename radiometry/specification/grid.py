"""The grid of a campaign's frames: the axes of a method, and the gaps that its plan finds."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Axis = Literal["scene", "iso", "f_number", "exposure_time_s", "band", "capture_id"]
"""Field of a frame whose values make the rows or columns of a grid."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Axes of the grid in which a method's frames are shown.

    Attributes
    ----------
    rows : Axis or None
        A row per role and value; "scene" splits only roles that have scenes. None for one row per role.
    columns : tuple of Axis
        A column per combination of values, the outer axis first; empty if the frames of a row are laid
        side by side.
    """

    rows: Axis | None = None
    columns: tuple[Axis, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Gap:
    """A frame to photograph next.

    Attributes
    ----------
    role : str
        Role of the frame.
    at : mapping
        Values of the grid's axes, as far as they are known.
    exposure_time_s : float or None
        Exposure time to use [s]; None if the plan does not know one.
    text : str
        What to photograph, if exposure and place do not say it.
    """

    role: str
    at: Mapping[Axis, str | float] = field(default_factory=dict)
    exposure_time_s: float | None = None
    text: str = ""
