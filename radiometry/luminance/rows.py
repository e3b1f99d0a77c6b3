"""What goes into a luminance fit: parameters, frames with their statistics, meter readings."""

import math
from dataclasses import dataclass

from radiometry.fitting.evidence import Exclusion, Quantity
from radiometry.frame.exposure import Exposure
from radiometry.frame.statistics import ChannelStatistics

MODELS = ("proportional", "affine", "power", "semilog")
CHANNELS = ("green", "grey")
BASES = ("nominal", "apex")


@dataclass(frozen=True, kw_only=True)
class Params:
    """What a person may decide about a luminance fit. The defaults are the procedure's.

    ``model`` : proportional | affine | power | semilog: the one whose K is reported; all four are fitted
    ``tolerance_rel`` : largest |L_fit - L_meter| / L_meter that passes; the procedure asks for 4 %
    ``channel`` : green | grey, the signal
    ``exposure_basis`` : nominal | apex, see `radiometry.frame.exposure.Exposure.on_basis`
    ``meter_repeatability_rel`` : standard uncertainty of one luminance reading apart from the meter's
        calibration: aim, spot, digits. None: estimated from the scatter between scenes.
    ``f_number_u_rel`` : standard uncertainty of a marked f-number. 1.5 %: markings are rounded by up to 2.8 %
        (f/11 for 11.314), which as a rectangular distribution is 2.8 / sqrt(3).
    ``exposure_time_u_rel`` : standard uncertainty of a marked time, 0.5 %: electronic shutters are timed by a
        quartz; what is left is the choice of 1/60 or 1/64 s, for which there is the basis.
    ``panel_rho`` : luminance factor of the target, for the cross-check L = rho E / pi; None where unknown
    ``vignetting`` : content hash of the vignetting version that the signals are divided by; None: none
    """

    model: str = "proportional"
    tolerance_rel: float = 0.04
    channel: str = "green"
    exposure_basis: str = "nominal"
    meter_repeatability_rel: float | None = None
    f_number_u_rel: float = 0.015
    exposure_time_u_rel: float = 0.005
    panel_rho: float | None = None
    exclude: tuple[Exclusion, ...] = ()
    vignetting: str | None = None

    def __post_init__(self) -> None:
        """Hold what every caller must have checked at its edge."""
        shares = (
            self.tolerance_rel,
            self.f_number_u_rel,
            self.exposure_time_u_rel,
            self.meter_repeatability_rel or 0.0,
        )
        if self.model not in MODELS or self.channel not in CHANNELS or self.exposure_basis not in BASES:
            raise ValueError(f"unknown model, channel or basis: {self}")
        if not all(math.isfinite(share) and 0.0 <= share < 1.0 for share in shares):
            raise ValueError(f"a relative uncertainty or tolerance is outside [0, 1): {self}")


@dataclass(frozen=True, kw_only=True)
class FrameRow:
    """One frame of a campaign as the fit sees it.

    ``frame`` : its name in messages and points; unique in a campaign
    ``role`` : "light" | "dark"; ``scene`` : the light level's name, None for a dark frame
    ``statistics`` : rows of `extract`, None while the frame waits for its extraction or its region
    ``has_region`` : False while nobody has drawn a region for it
    ``gain_maps`` : sha256 of each GainMap opcode the file carries
    ``lens_share`` : mean V of its region at its f-number, where the fit corrects vignetting
    """

    frame: str
    role: str
    scene: str | None
    exposure: Exposure
    statistics: tuple[ChannelStatistics, ...] | None
    has_region: bool = True
    rendered: bool = False
    gain_maps: tuple[str, ...] = ()
    lens_share: Quantity | None = None


@dataclass(frozen=True, kw_only=True)
class Reading:
    """One meter reading of a scene.

    ``quantity`` : "luminance" [cd/m2] | "illuminance" [lx]; ``value`` in that unit, > 0
    ``expanded_uncertainty_rel``, ``coverage_factor`` : from the meter's certificate, None where there is none
    """

    scene: str
    quantity: str
    value: float
    meter: str | None = None
    expanded_uncertainty_rel: float | None = None
    coverage_factor: float | None = None
