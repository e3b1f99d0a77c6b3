"""Inputs of a sharpness fit: target, parameters, and a frame's evidence."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from radiometry.fitting.evidence import Exclusion, FrameEvidence
from radiometry.sharpness.features import Features
from radiometry.specification.parameters import check_parameters, parameter

Kind = Literal["slanted_edge", "siemens_star"]
ToneCurve = Literal["linear", "srgb", "gamma"]
FrameRow = FrameEvidence[Features]

_EDGE_ORDERS = (1, 5)
_CYCLES = (4, 1000)
_GAMMAS = (0.2, 5.0)


@dataclass(frozen=True, kw_only=True)
class StarCentre:
    """Centre of a star: x right, y down [px], as regions are drawn; `region` names the star."""

    region: str
    x_px: float
    y_px: float


@dataclass(frozen=True, kw_only=True)
class Target:
    """Photographed target; every region of a frame shows one edge or one star.

    Attributes
    ----------
    kind : Kind, default: "slanted_edge"
        Kind of the target.
    edge_order : int, default: 5
        Order of the polynomial through the edge, 1 (straight) to 5 (ISO 12233:2023).
    cycles : int, default: 48
        Cycles of a star: pairs of a dark and a bright sector, 48 for 96 sectors.
    centres : tuple of StarCentre, default: ()
        Centres of stars, where they are known; the others are found.
    tone_curve, gamma : ToneCurve, float
        Tone curve to undo in rendered images; raw files are linear and need neither.
        "linear": as they are; "srgb": IEC 61966-2-1; "gamma": signal = light ^ (1 /
        gamma).
    """

    kind: Kind = "slanted_edge"
    edge_order: int = 5
    cycles: int = 48
    centres: tuple[StarCentre, ...] = ()
    tone_curve: ToneCurve = "linear"
    gamma: float = 2.2

    def __post_init__(self) -> None:
        """Check for values that no target can have; the messages are for the person who entered them."""
        if self.kind not in get_args(Kind):
            raise ValueError(f"kind must be one of {', '.join(get_args(Kind))}")
        if self.tone_curve not in get_args(ToneCurve):
            raise ValueError(f"tone_curve must be one of {', '.join(get_args(ToneCurve))}")
        for name, value, (low, high) in (
            ("edge_order", self.edge_order, _EDGE_ORDERS),
            ("cycles", self.cycles, _CYCLES),
            ("gamma", self.gamma, _GAMMAS),
        ):
            if not low <= value <= high:
                raise ValueError(f"{name} must lie between {low} and {high}")
        if not all(math.isfinite(each.x_px) and math.isfinite(each.y_px) for each in self.centres):
            raise ValueError("x_px and y_px of centres must be finite numbers")


@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of a sharpness fit."""

    pixel_pitch_um: float | None = parameter(
        None,
        label="Pixel pitch",
        description="Distance of neighbouring pixels; without it nothing is reported in line pairs per "
        "millimetre.",
        unit="um",
        default_text="the camera's, where it is registered",
        example=3.28,
        bounds="[0.1, 100]",
    )
    star_contrast: float = parameter(
        0.1,
        label="Contrast at the limiting resolution",
        description="Contrast at which a star counts as resolved, relative to its contrast far outside.",
        bounds="[0.01, 0.9]",
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Check every parameter against its range and choices."""
        check_parameters(self)
