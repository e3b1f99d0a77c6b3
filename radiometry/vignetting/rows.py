"""Parameters of a vignetting fit."""

from dataclasses import dataclass

from radiometry.fitting.evidence import Exclusion
from radiometry.specification.parameters import check_parameters, parameter

FLAT, DARK = "flat", "dark"


@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of a fit; the defaults serve a campaign shot as the documentation says."""

    flats_turned_deg: float | None = parameter(
        None,
        label="Camera turned between flats",
        description="Angle by which the camera was turned about its axis from each flat of an f-number to "
        "the next, in either sense; the light then turns in the frame, and the lens does not.",
        unit="deg",
        bounds="(0, 360)",
        default_text="not turned",
        example=180.0,
        later=True,
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Check every parameter against its range."""
        check_parameters(self)
