"""What goes into a geometry fit: parameters, and pictures of a board with their corners."""

import math
from dataclasses import dataclass
from typing import Final, Literal, get_args

from radiometry.fitting.evidence import Exclusion, FrameEvidence
from radiometry.geometry.features import Features

CHART: Final = "chart"
Window = Literal["fixed", "fitted"]
RadialTerms = Literal[0, 1, 2, 3]

FrameRow = FrameEvidence[Features]


@dataclass(frozen=True, kw_only=True)
class Params:
    """What a person may decide about a geometry fit.

    ``pixel_pitch_um`` : of the sensor; without it nothing is reported in millimetres and micrometres
    ``corner_window`` : of a checkerboard; fixed: corners placed as OpenCV's own sample places them; fitted:
        in a window that keeps clear of neighbours where they are closer than 28 pixels
    ``fix_aspect_ratio`` : pixels are square, fx = fy; free, the two differ by their noise
    ``radial_terms`` : how many of k1, k2, k3 are free, the others 0; ``tangential`` : whether p1, p2 are
    ``reject_above_px`` : a view that fits worse than this (rms) is left out, the worst first, and the others
        are fitted anew; None keeps every view
    """

    pixel_pitch_um: float | None = None
    corner_window: Window = "fixed"
    fix_aspect_ratio: bool = True
    radial_terms: RadialTerms = 3
    tangential: bool = True
    reject_above_px: float | None = 2.0
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Hold what every caller must have checked at its edge."""
        if self.corner_window not in get_args(Window) or self.radial_terms not in get_args(RadialTerms):
            raise ValueError(f"an unknown choice: {self}")
        pitch, limit = self.pixel_pitch_um, self.reject_above_px
        if pitch is not None and not 0.1 <= pitch <= 100.0:
            raise ValueError("pixel_pitch_um must lie between 0.1 and 100")
        if limit is not None and not (math.isfinite(limit) and limit > 0.0):
            raise ValueError("reject_above_px must be above 0")
