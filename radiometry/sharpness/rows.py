"""What goes into a sharpness fit: what was photographed, parameters, and a frame's evidence."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from radiometry.evidence import Exclusion, FrameEvidence
from radiometry.sharpness.features import Features

Kind = Literal["slanted_edge", "siemens_star"]
ToneCurve = Literal["linear", "srgb", "gamma"]
FrameRow = FrameEvidence[Features]

_EDGE_ORDERS = (1, 5)
_CYCLES = (4, 1000)


@dataclass(frozen=True, kw_only=True)
class StarCentre:
    """Where a star's centre lies: x right, y down [px], as regions are drawn; ``region`` names the star."""

    region: str
    x_px: float
    y_px: float


@dataclass(frozen=True, kw_only=True)
class Target:
    """What was photographed; every region of a frame shows one edge, or one star.

    ``edge_order`` : of the polynomial through the edge, 1 (straight) to 5 (ISO 12233:2023)
    ``cycles`` : of a star: pairs of a dark and a bright sector, 48 for 96 sectors
    ``centres`` : of stars, where they are known; the others are found
    ``tone_curve``, ``gamma`` : what to undo in rendered images; raw files are linear and need neither.
        linear: as they are; srgb: IEC 61966-2-1; gamma: signal = light ^ (1 / gamma)
    """

    kind: Kind = "slanted_edge"
    edge_order: int = 5
    cycles: int = 48
    centres: tuple[StarCentre, ...] = ()
    tone_curve: ToneCurve = "linear"
    gamma: float = 2.2

    def __post_init__(self) -> None:
        """Hold what every caller must have checked at its edge."""
        known = self.kind in get_args(Kind) and self.tone_curve in get_args(ToneCurve)
        counts = (
            _EDGE_ORDERS[0] <= self.edge_order <= _EDGE_ORDERS[1] and _CYCLES[0] <= self.cycles <= _CYCLES[1]
        )
        finite = all(math.isfinite(each.x_px) and math.isfinite(each.y_px) for each in self.centres)
        if not (known and counts and finite and 0.2 <= self.gamma <= 5.0):
            raise ValueError(f"a target that cannot be: {self}")


@dataclass(frozen=True, kw_only=True)
class Params:
    """What a person may decide about a sharpness fit.

    ``pixel_pitch_um`` : of the sensor; without it nothing is said in line pairs per millimetre
    ``star_contrast`` : at which a star counts as resolved, relative to its contrast far outside
    """

    pixel_pitch_um: float | None = None
    star_contrast: float = 0.1
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Hold what every caller must have checked at its edge."""
        pitch = self.pixel_pitch_um
        if not (pitch is None or 0.1 <= pitch <= 1000.0) or not 0.01 <= self.star_contrast <= 0.9:
            raise ValueError(f"a pixel pitch or a contrast that cannot be: {self}")
