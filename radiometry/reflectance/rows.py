"""What goes into a reflectance fit: parameters, panel frames with features, the panel's reflectances."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from radiometry.fitting.evidence import Exclusion
from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.reflectance.features import Features
from radiometry.reflectance.sunshine import Choice
from radiometry.reflectance.tilt import TiltParams

Normalisation = Literal["sunshine", "panel_only"]
Interpolation = Literal["constant", "linear"]


@dataclass(frozen=True, kw_only=True)
class Params:
    """What a person may decide about a reflectance fit.

    ``normalisation`` : sunshine: K carries the sunshine sensor's reading, so it holds while the light
        changes; panel_only: it does not, and K holds for the panel capture's own light
    ``sunshine_choice`` : mean of a file's valid readings | the last | the nearest to the exposure in time
    ``interpolation`` : constant: the mean of all panel captures, their drift in u(K); linear: K(t) between
        them
    ``incidence_angle_deg`` : between the panel's normal and the sun. The procedure calls it the angle of
        observation; for a diffuse panel the cosine belongs to the incoming light. 0: the panel lies as the
        sunshine sensor does, which is the usual way, and both see the same cosine.
    ``incidence_angle_u_deg`` : its standard uncertainty; 2 degrees is a panel levelled by eye
    ``tilt`` : corrects the sunshine sensor's own tilt by the sun's position; None, the default, does not
    """

    normalisation: Normalisation = "sunshine"
    sunshine_choice: Choice = "mean"
    interpolation: Interpolation = "constant"
    incidence_angle_deg: float = 0.0
    incidence_angle_u_deg: float = 2.0
    tilt: TiltParams | None = None
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Hold what every caller must have checked at its edge."""
        chosen = (
            self.normalisation in get_args(Normalisation),
            self.sunshine_choice in get_args(Choice),
            self.interpolation in get_args(Interpolation),
        )
        angles = (self.incidence_angle_deg, self.incidence_angle_u_deg)
        if not all(chosen) or not all(math.isfinite(angle) and 0.0 <= angle < 90.0 for angle in angles):
            raise ValueError(f"an unknown choice, or an angle outside [0, 90): {self}")


@dataclass(frozen=True, kw_only=True)
class FrameRow:
    """One frame of a campaign as the fit sees it: one band of one capture.

    ``frame`` : its name in messages and points; ``role`` : "panel", others are not looked at
    ``features`` : of `extract`, None while the frame waits for it; ``has_region`` : False while nobody has
        drawn a region for it
    """

    frame: str
    role: str
    header: FrameHeader
    exposure: Exposure
    features: Features | None
    has_region: bool = True


@dataclass(frozen=True, kw_only=True)
class Reading:
    """The panel's reflectance in one band, as its certificate says.

    ``reflectance`` : of the panel under these directions, (0, 1.2]; ``standard_uncertainty`` : absolute, None
        where it is not stated
    """

    panel: str
    band: str
    reflectance: float
    standard_uncertainty: float | None = None

    def __post_init__(self) -> None:
        """Hold what every caller must have checked at its edge."""
        uncertainty = self.standard_uncertainty or 0.0
        if not (0.0 < self.reflectance <= 1.2 and 0.0 <= uncertainty < 1.0):
            raise ValueError(f"a reflectance that cannot be: {self}")
