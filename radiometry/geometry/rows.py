"""Inputs of a geometry fit: parameters, and pictures of a board with their corners."""

from dataclasses import dataclass
from typing import Final, Literal

from radiometry.fitting.evidence import Exclusion, FrameEvidence
from radiometry.geometry.features import Features
from radiometry.specification.parameters import check_parameters, parameter

CHART: Final = "chart"
Window = Literal["fixed", "fitted"]
RadialTerms = Literal[0, 1, 2, 3]

FrameRow = FrameEvidence[Features]


@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of a geometry fit."""

    pixel_pitch_um: float | None = parameter(
        None,
        label="Pixel pitch",
        description="Distance of neighbouring pixels; without it nothing is reported in millimetres and "
        "micrometres.",
        unit="um",
        default_text="the camera's, where it is registered",
        example=3.28,
        bounds="[0.1, 100]",
    )
    corner_window: Window = parameter(
        "fixed",
        label="Window of the corner search",
        description="For a checkerboard: fixed as OpenCV's own sample places corners, or fitted to keep "
        "clear of neighbours where they are closer than 28 pixels.",
        labels={"fixed": "Fixed", "fitted": "Fitted to the spacing"},
    )
    fix_aspect_ratio: bool = parameter(
        default=True,
        label="Square pixels",
        description="fx = fy; if free, the two differ by their noise.",
    )
    radial_terms: RadialTerms = parameter(
        3,
        label="Radial terms",
        description="How many of k1, k2, k3 are free; the others are 0.",
        labels={0: "None", 1: "k1", 2: "k1, k2", 3: "k1, k2, k3"},
    )
    tangential: bool = parameter(
        default=True,
        label="Tangential terms",
        description="p1 and p2 are free; otherwise they are 0.",
    )
    reject_above_px: float | None = parameter(
        2.0,
        label="Rejection limit of a view",
        description="A view with a larger rms residual is rejected, the worst first, and the others are "
        "fitted again; `none` keeps every view.",
        unit="px",
        none_allowed=True,
        bounds="(0, 1000]",
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Check every parameter against its range and choices."""
        check_parameters(self)
