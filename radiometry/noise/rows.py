"""Parameters of a noise fit."""

from dataclasses import dataclass

from radiometry.fitting.evidence import Exclusion
from radiometry.specification.parameters import check_parameters, parameter

LIGHT, FLAT, DARK = "light", "flat", "dark"


@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of a noise fit; the defaults are those of EMVA 1288."""

    gain_range_share: float = parameter(
        0.70,
        label="Upper end of the photon transfer fit",
        description="The photon transfer is fitted up to this fraction of saturation.",
        bounds="(0, 1]",
    )
    linearity_range_share: tuple[float, float] = parameter(
        (0.05, 0.95),
        label="Range of the linearity fit",
        description="Range of the straight line of the linearity error, as fractions of saturation.",
        bounds="(0, 1]",
    )
    largest_drift_rel: float = parameter(
        0.10,
        label="Largest drift of the light",
        description="Stacks whose frames differ more in their means are left out, because their light "
        "changed.",
        bounds="(0, 1]",
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Check every parameter against its range and choices."""
        check_parameters(self)
