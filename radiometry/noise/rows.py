"""What a noise fit may be told."""

from dataclasses import dataclass

from radiometry.fitting.evidence import Exclusion

LIGHT, FLAT, DARK = "light", "flat", "dark"


@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of a fit; the defaults are EMVA 1288's own.

    ``gain_range_share`` : the photon transfer is fitted up to this share of saturation
    ``linearity_range_share`` : the straight line of the linearity error, from and to
    ``largest_drift_rel`` : stacks whose frames differ more in their means are left out: their light moved
    """

    gain_range_share: float = 0.70
    linearity_range_share: tuple[float, float] = (0.05, 0.95)
    largest_drift_rel: float = 0.10
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Hold what cannot be, in sentences for whoever typed it in."""
        low, high = self.linearity_range_share
        if not 0.0 < low < high <= 1.0:
            raise ValueError("linearity_range_share must be two shares above 0 and up to 1, the lower first")
        for name in ("gain_range_share", "largest_drift_rel"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must lie above 0 and at most at 1")
