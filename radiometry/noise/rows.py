"""What a noise fit may be told."""

import math
from dataclasses import dataclass

from radiometry.evidence import Exclusion

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
        """Hold what every caller must have checked at its edge."""
        low, high = self.linearity_range_share
        shares = (self.gain_range_share, low, high, self.largest_drift_rel)
        if not (all(math.isfinite(share) and 0.0 < share <= 1.0 for share in shares) and low < high):
            raise ValueError(f"shares that cannot be: {self}")
